"""Vector's binary logging format (BLF): read container by container in bounded memory; written by `hil.log.blf_write`.

python-can's reader is not used: it loops for ever on an object of size 0, inflates without a bound and takes a cut file
for a whole one.
"""

import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from hil.log import blf_layout as layout
from hil.log.account import Account
from hil.log.blf_objects import FEW_BYTES, Container, ObjectStream
from hil.log.blf_write import write_blf
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameTable, LogError
from hil.log.source import ReadOptions, Source

INFLATE: Any
try:
    from isal import isal_zlib as INFLATE  # noqa: N812 (takes two thirds of the time)
except ImportError:
    INFLATE = zlib

__all__ = ["read_blf", "write_blf"]

BLOCK_BYTES = 1024 * 1024  # read at once, and walked at once
GROUP_BYTES = 512 * 1024  # of content that is inflated while the group before is walked
FREE_BYTES = 64 * 1024 * 1024
MAX_RATIO = 100
"""A file may inflate to FREE_BYTES and this many times its size; real logs inflate to some ten times."""


MAX_DEFLATE = 1032  # bytes that one byte inflates to at most


@dataclass(frozen=True, slots=True)
class Content:
    """What a container holds, and what is wrong with it ("" for nothing)."""

    offset: int
    packed_size: int
    content: bytes
    problem: str = ""
    cut: bool = False  # the file ends inside it


def read_blf(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of a BLF file.

    Objects that are no CAN frame are counted by type in ``account.passed_over``. A damaged container is one rejected
    piece; so is each object that should be a frame and is none, at the offset of the container it begins in.

    Raises
    ------
    LogError
        When it has no BLF header.
    """
    head = source.read(layout.FILE_HEADER.size)
    if len(head) < layout.FILE_HEADER.size or head[:4] != b"LOGG":
        expected = f"expected LOGG and a header of {layout.FILE_HEADER_SIZE} bytes, got {head[:16]!r}"
        raise LogError(source.path, f"no BLF file: {expected}; give a BLF file", 0)
    fields = layout.FILE_HEADER.unpack(head)
    header_size, stated = fields[1], fields[7]
    if not layout.FILE_HEADER.size <= header_size <= 1024:
        header_size = layout.FILE_HEADER_SIZE
    account.start_ns = layout.start_ns(fields[11:19], options.timezone)
    account.local_start = account.start_ns is not None
    begin = len(head) + len(source.read(header_size - len(head)))
    builder = FrameBuilder(account)
    fast = True if options.fast is None and source.size > FEW_BYTES else options.fast
    outer = ObjectStream(builder, account.start_ns or 0, fast, outer=True)
    inner = ObjectStream(builder, account.start_ns or 0, fast)
    inflated = 0
    with ThreadPoolExecutor(1) as pool:
        for piece in _inflated(_file(source, outer, begin), pool):
            if isinstance(piece, FrameTable):
                yield piece
                continue
            if inflated + len(piece.content) > FREE_BYTES + MAX_RATIO * (piece.offset + piece.packed_size):
                account.reject(piece.offset, f"container of {len(piece.content)} bytes: the file is a deflate bomb")
                inner.drop()
                continue
            inflated += len(piece.content)
            for at in range(0, len(piece.content), BLOCK_BYTES):
                inner.feed(piece.content[at : at + BLOCK_BYTES], piece.offset)
                yield from inner.tables()
            if piece.cut:
                account.cut_at(piece.offset)
            elif piece.problem:
                account.reject(piece.offset, piece.problem)
                inner.drop()
        yield from inner.tables(final=True)
    size = begin + outer.end
    if account.truncated_at is None and (stated > size or stated == header_size < size):
        account.note(f"the file has {size} bytes, its header states {stated}: it is cut off, or its writer was killed")
        account.cut_at(size)
    yield builder.take()


def _file(source: Source, outer: ObjectStream, offset: int) -> Iterator[FrameTable | Container | None]:
    while block := source.read(BLOCK_BYTES):
        outer.feed(block, offset)
        offset += len(block)
        yield from outer.walk()
    yield from outer.walk(final=True)


def _inflated(
    pieces: Iterable[FrameTable | Container | None], pool: ThreadPoolExecutor
) -> Iterator[FrameTable | Content]:
    """Inflate containers group by group in the pool, two groups ahead; the order of the file is kept."""
    group: list[Container] = []
    jobs: deque[Future[list[Content]]] = deque()
    size = 0
    for piece in pieces:
        if isinstance(piece, Container):
            group.append(piece)
            size += piece.content_size
            if size < GROUP_BYTES:
                continue
        jobs.append(pool.submit(_contents, group))
        ahead = 2 if isinstance(piece, Container) and size < 4 * GROUP_BYTES else 0
        group, size = [], 0
        while len(jobs) > ahead:
            yield from jobs.popleft().result()
        if isinstance(piece, FrameTable):
            yield piece
    jobs.append(pool.submit(_contents, group))
    for job in jobs:
        yield from job.result()


def _contents(group: list[Container]) -> list[Content]:
    return [_content(container) for container in group]


def _content(container: Container) -> Content:
    body, size = container.body, container.content_size
    end = (container.offset, len(body))
    if len(body) < layout.CONTAINER.size:
        return Content(*end, b"", "container without its header", container.cut)
    method, _ = layout.CONTAINER.unpack_from(body)
    if size > layout.MAX_CONTAINER:
        return Content(*end, b"", f"container of {size} bytes; at most {layout.MAX_CONTAINER} are read")
    packed = memoryview(body)[layout.CONTAINER.size :]
    if method == layout.STORED:
        content, whole = bytes(packed[:size]), len(packed) >= size
    elif method == layout.DEFLATED:
        try:
            content, whole = _inflate(packed, size)
        except INFLATE.error as problem:
            return Content(*end, b"", f"container of {size} bytes cannot be inflated: {problem}")
    else:
        return Content(*end, b"", f"container of unknown compression {method}; known are 0 and 2")
    if len(content) > size:
        return Content(*end, b"", f"container states {size} bytes and holds more")
    return Content(
        *end, content, "" if whole else f"container of {size} bytes ends after {len(content)}", container.cut
    )


def _inflate(packed: memoryview, size: int) -> tuple[bytes, bool]:
    """Inflate to ``size`` bytes, or a little more where there is more; and whether the end was reached."""
    if len(packed) * MAX_DEFLATE <= layout.MAX_CONTAINER:
        with suppress(INFLATE.error):  # damaged, or cut off: then as far as it goes
            return INFLATE.decompress(packed, bufsize=size + 1), True
    inflater = INFLATE.decompressobj()
    return inflater.decompress(packed, size + 1), inflater.eof
