"""Vector's binary logging format (BLF): read container by container in bounded memory; written by `hil.log.blf.write`.

python-can's reader is not used: it loops for ever on an object of size 0, inflates without a bound and takes a cut file
for a whole one.
"""

from collections.abc import Iterator

from hil.log.account import Account
from hil.log.blf import layout
from hil.log.blf.inflate import Inflater
from hil.log.blf.objects import FEW_BYTES, Container, ObjectStream
from hil.log.blf.write import write_blf
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameTable, LogError
from hil.log.source import ReadOptions, Source

__all__ = ["read_blf", "write_blf"]

BLOCK_BYTES = 1024 * 1024  # read at once, and walked at once


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
    header_size, level, stated = fields[1], fields[4], fields[7]
    if not layout.FILE_HEADER.size <= header_size <= 1024:
        header_size = layout.FILE_HEADER_SIZE
    account.start_ns = layout.start_ns(fields[11:19], options.timezone)
    account.local_start = account.start_ns is not None
    if account.start_ns is None and any(fields[11:19]):
        account.note("the start time in the header cannot be read: stamps count from 1970")
    begin = len(head) + len(source.read(header_size - len(head)))
    builder = FrameBuilder(account)
    fast = True if options.fast is None and source.size > FEW_BYTES else options.fast
    outer = ObjectStream(builder, account.start_ns or 0, fast, outer=True)
    inner = ObjectStream(builder, account.start_ns or 0, fast)
    for piece in Inflater(level).ahead(_file(source, outer, begin)):
        if isinstance(piece, FrameTable):
            yield piece
            continue
        for at in range(0, len(piece.content), BLOCK_BYTES):
            inner.feed(piece.content[at : at + BLOCK_BYTES], piece.offset)
            yield from inner.tables()
        if piece.cut:
            account.cut_at(piece.offset)
        elif piece.problem:
            account.reject(piece.offset, piece.problem)
            inner.drop()
        del piece  # before the next one is inflated, as it may be large
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
