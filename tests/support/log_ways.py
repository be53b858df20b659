"""Reading a text log both ways, compiled and careful, which must agree; and damaging one."""

import random
from datetime import UTC

import numpy as np

from hil.log import builder
from hil.log.account import Account
from hil.log.builder import recording_of
from hil.log.formats import BY_NAME
from hil.log.frames import FrameFlag, FrameTable
from hil.log.source import ReadOptions, Source
from hil.log.text import lines


def read_bytes(path, content, form, fast, zone=UTC):
    """(tables, account) of a log that is written to ``path`` first."""
    path.write_bytes(content)
    account = Account()
    with Source(path) as source:
        tables = list(BY_NAME[form].read(source, account, ReadOptions(zone, fast)))
    assert all(isinstance(table, FrameTable) for table in tables)
    return tables, account


def read_both(path, content, form, zone=UTC):
    """Recording and account of a log that both ways of reading agree on."""
    content = content.encode("latin-1") if isinstance(content, str) else content
    sides = [read_bytes(path, content, form, fast, zone) for fast in (False, True)]
    logs = [recording_of(path, form, tables, account) for tables, account in sides]
    assert_equal(logs[0].frames, logs[1].frames)
    assert sides[0][1] == sides[1][1]
    return logs[1], sides[1][1]


def assert_equal(one, other):
    """The same frames, and the same names of their channels."""
    width = max(one.data.shape[1], other.data.shape[1])
    assert one.channels == other.channels
    for name in ("time_ns", "channel", "can_id", "extended", "length", "flags"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    np.testing.assert_array_equal(one.widened(width).data, other.widened(width).data)


def assert_sound(frames):
    """No frame that CAN does not have."""
    error = (frames.flags & FrameFlag.ERROR) != 0
    fd = (frames.flags & FrameFlag.FD) != 0
    assert (frames.can_id[~frames.extended & ~error] <= 0x7FF).all()
    assert (frames.can_id <= 0x1FFFFFFF).all()
    assert not (frames.extended & error).any()
    assert (frames.length[~fd] <= 8).all()
    assert np.isin(frames.length[fd], [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]).all()
    held = np.where(frames.flags & FrameFlag.REMOTE, 0, frames.length)
    assert not frames.data[np.arange(frames.data.shape[1]) >= held[:, None]].any()


def mutants(content, count, seed):
    """Yield damaged copies: bytes changed, cut, put in, pieces doubled and swapped, numbers blown up."""
    draw = random.Random(seed)
    letters = b"0123456789abcdefxXABRTdr#_[]().:;-= \t\r\n\0\xff\x0b"
    for _ in range(count):
        damaged = bytearray(content)
        for _ in range(draw.choice((1, 1, 2, 5))):
            at, size = draw.randrange(len(damaged) + 1), draw.choice((1, 1, 2, 7, 60))
            kind = draw.randrange(7)
            if kind == 0 and at < len(damaged):
                damaged[at] = draw.choice(letters)
            elif kind == 1:
                del damaged[at : at + size]
            elif kind == 2:
                damaged[at:at] = bytes(draw.choice(letters) for _ in range(size))
            elif kind == 3:
                damaged[at:at] = damaged[at : at + size]
            elif kind == 4:
                other = draw.randrange(len(damaged) + 1)
                one, two = slice(at, at + size), slice(other, other + size)
                damaged[one], damaged[two] = damaged[two], damaged[one]
            elif kind == 5:
                damaged[at:at] = b"9" * draw.choice((1, 8, 19, 40))
            else:
                del damaged[at:]
                if not damaged:
                    damaged += b"\n"
        yield bytes(damaged)


def check_mutants(path, content, form, count, seed, monkeypatch):
    """Both ways agree on every mutant, whatever the sizes of blocks and tables; nothing is raised."""
    for k, damaged in enumerate(mutants(content, count, seed)):
        with monkeypatch.context() as patch:
            patch.setattr(lines, "BLOCK_BYTES", (97, 1000, 2**21)[k % 3])
            patch.setattr(builder, "ROWS", (3, 65_536)[k % 2])
            patch.setattr(builder.FrameBuilder.__init__, "__defaults__", (None, (3, 65_536)[k % 2]))
            log, account = read_both(path, damaged, form)
        assert_sound(log.frames)
        assert account.rejected >= len(account.first_rejected)
        for piece in account.first_rejected:
            assert 0 <= piece.offset < len(damaged)
        if account.truncated_at is not None:
            assert damaged[-1:] != b"\n"
            assert b"\n" not in damaged[account.truncated_at :]
