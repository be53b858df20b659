"""Text logs: blocks of whole lines, a compiled pass for the plain ones, a careful parser for all others."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameTable
from hil.log.source import Source

BLOCK_BYTES = 256 * 1024  # stays in the cache
MAX_LINE_BYTES = 4096
MAX_WAIT = 100  # lines that the careful parser takes at once where the compiled pass takes none


class LineParser(Protocol):
    """A text format: two parsers of one grammar, which must agree on every line that both take."""

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Compiled: add the frames of the lines from ``begin`` on, all of which end with a line feed.

        Returns the begin of the first line it leaves to `line`, the end of the buffer when it took all, or where
        it stands when the builder is full.
        """
        ...

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add, pass over or reject one line (without its end).

        Returns whether nothing can be missing at its end, had the log been cut off there.
        """
        ...


def read_lines(source: Source, account: Account, parser: LineParser, fast: bool | None = None) -> Iterator[FrameTable]:
    """Yield the frames of a text log; every line is taken by one of the parser's two ways.

    Parameters
    ----------
    fast : False never uses the compiled pass, True always; None uses it for all but small logs.
    """
    builder = FrameBuilder(account)
    end_at = 0  # of what was taken, in the log
    taken = _limited(builder, account, 0)
    left = wait = 0  # calls of the compiled pass that took nothing, one after the other; lines to go before the next
    for offset, block in _blocks(source, account):
        end = block.rfind(b"\n") + 1
        compiled = not source.few(offset) if fast is None else fast
        buffer = np.frombuffer(block, np.uint8, end)
        at = 0
        while at < len(block):
            if builder.full:
                if account.wanted_frame == taken + builder.n - 1:
                    account.wanted_end = offset + at
                yield builder.take()
                taken = _limited(builder, account, taken + builder.rows)
            if compiled and at < end and not wait:
                begin, at = at, parser.take(buffer, at, builder)
                left = left + 1 if at == begin else 0
                wait = min(left // 4, MAX_WAIT)
                if at >= len(block) or builder.full:
                    continue
            wait = max(wait - 1, 0)
            stop = block.find(b"\n", at)
            if stop - at > MAX_LINE_BYTES:
                account.reject(offset + at, block[at : at + MAX_LINE_BYTES])
                at = stop + 1
                continue
            whole = parser.line(block[at:] if stop < 0 else block[at:stop], offset + at, builder)
            if stop < 0:
                if not whole:
                    account.cut_at(offset + at)
                break
            at = stop + 1
        end_at = offset + len(block)
    if account.wanted_frame == taken + builder.n - 1:
        account.wanted_end = end_at
    yield builder.take()


def _limited(builder: FrameBuilder, account: Account, taken: int) -> int:
    """Have the next table end with the frame whose line is asked for; ``taken`` frames were handed on."""
    if account.wanted_frame is not None and taken <= account.wanted_frame:
        builder.limit(account.wanted_frame + 1 - taken)
    return taken


def _blocks(source: Source, account: Account) -> Iterator[tuple[int, bytes]]:
    """Yield (offset, whole lines); the last block may lack its line end. Overlong lines are rejected here."""
    carry = b""
    offset = 0  # of carry
    overlong: int | None = None  # where a line began that has not ended yet
    while chunk := source.read(BLOCK_BYTES):
        block = carry + chunk if carry else chunk
        if overlong is not None:
            end = block.find(b"\n")
            if end < 0:
                offset += len(block)
                carry = b""
                continue
            overlong = None
            offset, block = offset + end + 1, block[end + 1 :]
        end = block.rfind(b"\n") + 1
        if end:
            yield offset, block[:end]
        offset, carry = offset + end, block[end:]
        if len(carry) > MAX_LINE_BYTES:
            account.reject(offset, carry[:MAX_LINE_BYTES])
            overlong, offset, carry = offset, offset + len(carry), b""
    if overlong is not None:
        account.cut_at(overlong)
    if carry:
        yield offset, carry
