"""Inflates the containers of a BLF file in a second thread, a little ahead of whoever takes their content.

zlib and isal release the interpreter's lock, and so does the compiled pass over the content.
"""

import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from hil.log.blf import layout
from hil.log.blf.objects import Container
from hil.log.frames import FrameTable

INFLATE: Any
try:
    from isal import isal_zlib as INFLATE  # noqa: N812 (takes two thirds of the time)
except ImportError:
    INFLATE = zlib

GROUP_BYTES = 512 * 1024  # of containers that are inflated together
GROUPS_AHEAD = 2
FREE_BYTES = 64 * 1024 * 1024
MAX_RATIO = 50
"""A file may inflate to FREE_BYTES and this many times its size; real logs inflate to some ten times."""
MAX_DEFLATE = 1032  # bytes that one byte inflates to at most


@dataclass(frozen=True, slots=True)
class Content:
    """What a container at an offset of the file holds, and what is wrong with it ("" for nothing)."""

    offset: int
    content: bytes
    problem: str = ""
    cut: bool = False  # the file ends inside it


class Inflater:
    """Inflates containers one after the other, and refuses them from where the file is a deflate bomb.

    Parameters
    ----------
    level : compression level in the file's header; 0 says that containers of vblf are not compressed.
    """

    def __init__(self, level: int) -> None:
        self._level = level
        self._inflated = 0
        self._wasted = 0  # bytes beyond what their containers stated

    def ahead(self, pieces: Iterable[FrameTable | Container | None]) -> Iterator[FrameTable | Content]:
        """Yield the pieces of a file in their order, containers as their content.

        None among the pieces says that all containers before must be taken before the next piece is asked for.
        """
        group: list[Container] = []
        jobs: deque[Future[list[Content]]] = deque()
        size = 0
        with ThreadPoolExecutor(1) as pool:
            for piece in pieces:
                if isinstance(piece, Container):
                    group.append(piece)
                    size += (piece.content_size or 4 * len(piece.body)) + len(piece.body)
                    if size < GROUP_BYTES:
                        continue
                jobs.append(pool.submit(self._contents, group))
                ahead = GROUPS_AHEAD if isinstance(piece, Container) and size < 4 * GROUP_BYTES else 0
                group, size = [], 0
                yield from _taken(jobs, ahead)
                if isinstance(piece, FrameTable):
                    yield piece
            jobs.append(pool.submit(self._contents, group))
            yield from _taken(jobs, 0)

    def _contents(self, group: list[Container]) -> list[Content]:
        return [self._content(container) for container in group]

    def _content(self, container: Container) -> Content:
        offset, body, stated = container.offset, container.body, container.content_size
        if len(body) < layout.CONTAINER.size:
            return Content(offset, b"", "container without its header", container.cut)
        method, _ = layout.CONTAINER.unpack_from(body)
        size = layout.MAX_CONTAINER if stated is None else stated
        if stated is None and self._level == 0:
            method, size = layout.STORED, len(body) - layout.CONTAINER.size
        if size > layout.MAX_CONTAINER:
            return Content(offset, b"", f"container of {size} bytes; at most {layout.MAX_CONTAINER} are read")
        left = FREE_BYTES + MAX_RATIO * (offset + len(body)) - self._inflated
        packed = memoryview(body)[layout.CONTAINER.size :]
        if method == layout.STORED:
            content, whole = bytes(packed[:size]), len(packed) >= size
        elif method == layout.DEFLATED:
            try:
                content, whole = self._inflate(packed, min(size, left))
            except INFLATE.error as error:
                return Content(offset, b"", f"container of {size} bytes cannot be inflated: {error}")
        else:
            return Content(offset, b"", f"container of unknown compression {method}; known are 0 and 2")
        if len(content) > size:
            self._wasted += len(content)
            return Content(offset, b"", f"container states {size} bytes and holds more")
        if len(content) > left:
            return Content(offset, b"", f"container of {size} bytes: the file inflates more than {MAX_RATIO} times")
        self._inflated += len(content)
        problem = "" if whole else f"container of {size} bytes ends after {len(content)}"
        return Content(offset, content, problem, container.cut)

    def _inflate(self, packed: memoryview, size: int) -> tuple[bytes, bool]:
        """Inflate to ``size`` bytes, or a little more where there is more; and whether the end was reached.

        The faster way has no bound of its own: it is for what cannot grow beyond any container, while nothing did.
        """
        if len(packed) * MAX_DEFLATE <= layout.MAX_CONTAINER and size > len(packed) and not self._wasted:
            with suppress(INFLATE.error):  # damaged, or cut off: then as far as it goes
                return INFLATE.decompress(packed, bufsize=size + 1), True
        inflater = INFLATE.decompressobj()
        return inflater.decompress(packed, max(size, 0) + 1), inflater.eof


def _taken(jobs: deque[Future[list[Content]]], ahead: int) -> Iterator[Content]:
    """Contents of all but the last few jobs; none is kept here, as one may be large."""
    while len(jobs) > ahead:
        contents = deque(jobs.popleft().result())
        while contents:
            yield contents.popleft()
