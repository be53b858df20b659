"""The objects in a stream of BLF bytes: those that are CAN frames go to a builder, all others are counted.

A stream comes in blocks of any size and objects cross them. Where the bytes are damaged it goes on at the next object:
what stands before that is one rejected piece. The work is linear in the size of the stream.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hil.log.account import FIRST_REJECTED
from hil.log.blf import layout
from hil.log.blf.frame import fields_of
from hil.log.blf.layout import FULL_BODY, LEAST_BODY, OBJECT, SIGNATURE
from hil.log.builder import FrameBuilder
from hil.log.frames import FD_CODES, FrameFlag, FrameTable

FEW_BYTES = 200_000  # of a stream that are left to the careful parser, as the compiled pass takes time to load
BODIES = np.stack((LEAST_BODY, FULL_BODY))
REQUESTS, UNKNOWN = 256, 257  # where requests to send, and objects of types from 256 on, are counted


@dataclass(frozen=True, slots=True)
class Container:
    """A container in a file.

    Attributes
    ----------
    offset : of it in the file.
    header_size : as it states it; 16, but 32 as vblf writes it, which then states no size of the content.
    body : its bytes from the first 16 on.
    cut : the file ends inside it.
    """

    offset: int
    header_size: int
    body: bytes
    cut: bool = False

    @property
    def content_size(self) -> int | None:
        """Bytes of its content as it states them; None where it does not."""
        if self.header_size == layout.TIME_HEADER_SIZE or len(self.body) < layout.CONTAINER.size:
            return None
        return int(layout.CONTAINER.unpack_from(self.body)[1])


class ObjectStream:
    """Takes the objects of a stream block by block.

    Parameters
    ----------
    builder : takes the frames.
    start_ns : added to the stamps.
    fast : as `hil.log.source.ReadOptions.fast`.
    outer : the stream is the file itself; its containers are handed on.

    Attributes
    ----------
    end : bytes fed so far.
    """

    def __init__(self, builder: FrameBuilder, start_ns: int, fast: bool | None, outer: bool = False) -> None:
        self.builder = builder
        self.account = builder.account
        self.outer = outer
        self._start_ns = start_ns
        self._fast = fast
        self._tail = b""
        self._more: list[bytes] = []  # blocks behind the tail
        self._position = 0  # in the stream, of the tail
        self.end = 0
        self._need = 0  # fewest bytes from the tail on that may let it go on
        self._lost = False  # the next object is being searched, its lack is counted already
        self._origins: list[tuple[int, int]] = []  # stream position, file offset
        least, most = -(2**63) - start_ns, 2**63 - 1 - start_ns
        self._units = {True: (10_000, -(-least // 10_000), most // 10_000), False: (1, least, most)}
        self._limits = np.array(
            [start_ns, *(min(max(x, -(2**63)), 2**63 - 1) for unit in (True, False) for x in self._units[unit][1:])],
            np.int64,
        )
        self._passed: npt.NDArray[np.int64] = np.zeros(258, np.int64)
        self._indices: npt.NDArray[np.int32] = np.full(65_536, -1, np.int32)

    def feed(self, block: bytes, offset: int) -> None:
        """Append a block; ``offset`` in the file is that of its begin, or of the container it comes from."""
        self._origins.append((self.end, offset))
        self._more.append(block)
        self.end += len(block)

    def drop(self) -> None:
        """Forget what is unfinished: bytes are missing, and the next object is to be searched without a word."""
        self._tail, self._more, self._need, self._position, self._lost = b"", [], 0, self.end, True

    def tables(self, final: bool = False) -> Iterator[FrameTable]:
        """Take what can be taken; yields tables as they fill."""
        for piece in self.walk(final):
            if isinstance(piece, FrameTable):
                yield piece

    def walk(self, final: bool = False) -> Iterator[FrameTable | Container | None]:
        """Take what can be taken; yields tables as they fill, and of the file its containers.

        None says that something other than a container follows: what came before must be taken first.
        ``final``: nothing follows.
        """
        size = self.end - self._position
        # Joined only when twice the size is there, lest a huge unfinished object be copied for each block.
        if not final and size < max(self._need, 2 * len(self._tail) if self._need > FEW_BYTES else 0):
            return
        if not size:
            return
        block = b"".join((self._tail, *self._more)) if self._tail or len(self._more) != 1 else self._more[0]
        self._more, self._need = [], 0
        compiled = self.end > FEW_BYTES if self._fast is None else self._fast
        buffer = np.frombuffer(block, np.uint8)
        at = 0
        while at < size and not self._need:
            if self._lost:
                at = self._search(block, at, final)
                continue
            if self.outer and (container := self._container(block, at, final)) is not None:
                at, found = container
                if found is not None:
                    yield found
                continue
            if self.outer:
                yield None
            if self.builder.full:
                yield self.builder.take()
            if compiled:
                before, at = at, self._pass(buffer, at, final)
                if at > before or self._lost or self.builder.full:
                    continue
            at = self._step(block, at, final)
        self._tail = block[at:]
        self._position += at
        del self._origins[: bisect_right(self._origins, (self._position, 2**63)) - 1]
        for kind in np.flatnonzero(self._passed).tolist():
            self.account.passed_over[_named(kind)] += int(self._passed[kind])
        self._passed[:] = 0

    def _pass(self, buffer: npt.NDArray[np.uint8], at: int, final: bool) -> int:
        from hil.log.blf.objects_pass import take_objects

        shown = len(self.account.first_rejected) < FIRST_REJECTED
        rejected = np.array([-1 if shown else 0, 0], np.int64)
        at = self.builder.fill(
            take_objects,
            *(buffer, at, self.outer, final, BODIES, self._limits, self._indices, self._passed, rejected),
        )
        self.account.rejected += max(int(rejected[0]), 0)
        self._lost = bool(rejected[1])
        return at

    def _kind(self, block: bytes, at: int) -> int:
        return OBJECT.unpack_from(block, at)[4] if at + OBJECT.size <= len(block) else -1

    def _offset(self, at: int) -> int:
        """Offset in the file of a place in the block: in the file itself the place, else its container's."""
        position = self._position + at
        start, offset = self._origins[bisect_right(self._origins, (position, 2**63)) - 1]
        return offset + (position - start if self.outer else 0)

    def _reject(self, at: int, text: str) -> None:
        self.account.reject(self._offset(at), text)

    def _search(self, block: bytes, at: int, final: bool) -> int:
        found = block.find(SIGNATURE, at)
        if found >= 0:
            self._lost = False
            return found
        if final:
            return len(block)
        self._need = 4
        return max(at, len(block) - 3)

    def _begin(self, block: bytes, at: int) -> int:
        return block.find(SIGNATURE, at, at + layout.MAX_PADDING + 4)

    def _landed(self, block: bytes, at: int, final: bool) -> bool | None:
        """Whether an object that ends at ``at`` is followed by one, or by the end; None while that cannot be known."""
        if self._begin(block, at) >= 0:
            return True
        left = len(block) - at
        if left < layout.LOOK and not final:
            return None
        return left <= layout.MAX_PADDING

    def _container(self, block: bytes, at: int, final: bool) -> tuple[int, Container | None] | None:
        """The end of a container that begins at ``at``, and itself; None where none does."""
        begin = self._begin(block, at)
        if begin < 0 or self._kind(block, begin) != layout.LOG_CONTAINER:
            return None
        _, header, _, size, _ = OBJECT.unpack_from(block, begin)
        if not 16 <= header <= size <= layout.MAX_CONTAINER + 65_536:
            return None
        end, offset, body = begin + size, self._offset(begin), begin + OBJECT.size
        whole = end <= len(block)
        landed = self._landed(block, end, final) if whole else None
        if landed is None and not final:
            self._need = max(end, len(block) + 1) - at
            return at, None
        if not landed:  # its size is wrong, or bytes are missing
            found = self._next_container(block, begin + OBJECT.size, end + 3)
            if found >= 0:
                return found, Container(offset, header, block[body:found])
        return min(end, len(block)), Container(offset, header, block[body:end], not whole)

    def _next_container(self, block: bytes, begin: int, end: int) -> int:
        """Where the next container seems to begin, -1 for none; other objects may stand inside a stored one."""
        while (found := block.find(SIGNATURE, begin, end)) >= 0:
            if self._kind(block, found) == layout.LOG_CONTAINER:
                return found
            begin = found + len(SIGNATURE)
        return -1

    def _step(self, block: bytes, at: int, final: bool) -> int:
        """Take one object, or count what stands there; returns where to go on."""
        begin, left = self._begin(block, at), len(block) - at
        if begin < 0:
            if left < layout.LOOK and not final:
                self._need = left + 1
                return at
            if left > layout.MAX_PADDING:
                self._reject(at, f"bytes that are no object: {block[at : at + layout.LOOK]!r}")
                self._lost = True
                return at
            return len(block)
        if begin + OBJECT.size > len(block):
            self._need = begin - at + OBJECT.size
            if final:
                self.account.cut_at(self._offset(begin))
                return len(block)
            return at
        _, header, version, size, kind = OBJECT.unpack_from(block, begin)
        frame = kind < 256 and LEAST_BODY[kind] > 0
        if frame:
            sound = version in (1, 2) and 32 <= header <= layout.MAX_HEADER
            sound = sound and LEAST_BODY[kind] <= size - header <= FULL_BODY[kind] + layout.SURPLUS
        else:
            sound = 16 <= header <= size <= layout.MAX_OBJECT
        if not sound:
            self._reject(begin, f"object of type {kind} and {size} bytes")
            self._lost = True
            return begin + 4
        end: int = begin + size
        landed = end <= len(block) if frame else self._landed(block, end, final) if end <= len(block) else None
        if not final and (end > len(block) or landed is None):
            self._need = max(end, len(block) + 1) - at
            return at
        one = block[begin:end]
        if not landed:
            found = block.find(SIGNATURE, begin + OBJECT.size, end + 3)
            if found >= 0:
                self._reject(begin, f"object of type {kind} and {size} bytes: its size is wrong")
                return found
            if end > len(block):
                if frame:
                    self._reject(begin, f"object of type {kind}, cut off: {one[:32].hex(' ')}")
                self.account.cut_at(self._offset(begin))
                return len(block)
        if not frame:
            self._passed[kind if kind < 256 else UNKNOWN] += 1
            return end
        used, frame_fields = fields_of(one, header, kind)
        if size > header + used:
            if len(block) < end + 3 and not final:
                self._need = end + 3 - at
                return at
            found = block.find(SIGNATURE, begin + header + used, end + 3)
            if found >= 0:
                self._reject(begin, f"object of type {kind} and {size} bytes: its size is wrong")
                return found
        if frame_fields is None:
            self._passed[REQUESTS] += 1
        elif not self._add(layout.TIME.unpack_from(one, OBJECT.size), *frame_fields):
            self._reject(begin, f"object of type {kind}: {one[:32].hex(' ')}")
        return end

    def _add(self, time: tuple[int, int], channel: int, dlc: int, can_id: int, data: bytes, flags: FrameFlag) -> bool:
        """Add a frame: the length is the one its DLC states, data bytes that are not there read as zero."""
        unit, stamp = time
        factor, least, most = self._units[unit == layout.TEN_US]
        if dlc > 15 or not least <= stamp <= most:
            return False
        time_ns = self._start_ns + stamp * factor
        length = FD_CODES[dlc] if flags & FrameFlag.FD else min(dlc, 8)
        data = b"" if flags & FrameFlag.REMOTE else data[:length].ljust(length, b"\0")
        name = f"can{max(channel, 1) - 1}"
        extended = bool(can_id & layout.EXTENDED) and not flags & FrameFlag.ERROR
        if not self.builder.add(time_ns, name, can_id & layout.ID_BITS, extended, data, flags, length):
            return False
        self._indices[channel] = self.builder.channel(name)
        return True


def _named(kind: int) -> str:
    if kind == REQUESTS:
        return "requests to send"
    return "objects of unknown type" if kind == UNKNOWN else f"objects of type {kind}"
