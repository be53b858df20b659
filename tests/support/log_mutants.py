"""Drawn and damaged logs, and whether the two ways of reading a log agree on them."""

import random
import re

import numpy as np

from hil.log.frames import FrameFlag, FrameTable, LogError
from hil.log.read import open_log
from hil.log.source import ReadOptions

COLUMNS = ("time_ns", "channel", "can_id", "extended", "length", "data", "flags")


def mutant(seed, content):
    """A copy with one to three damages: flipped bytes, cuts, inserted, doubled and swapped pieces, blown up numbers."""
    draw = random.Random(seed)
    raw = bytearray(content)
    for _ in range(draw.randint(1, 3)):
        if not raw:
            break
        at, size = draw.randrange(len(raw)), draw.choice([1, 1, 2, 4, 16, 60])
        kind = draw.randrange(8)
        if kind == 0:
            raw[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            raw[at] = draw.randrange(256)
        elif kind == 2:
            del raw[at : at + size]
        elif kind == 3:
            raw[at:at] = draw.randbytes(size)
        elif kind == 4:
            raw[at:at] = raw[at : at + size]
        elif kind == 5:
            to = draw.randrange(len(raw))
            raw[at : at + size], raw[to : to + size] = raw[to : to + size], raw[at : at + size]
        elif kind == 6:
            del raw[at + size :]
        else:
            numbers = list(re.finditer(rb"\d+", raw))
            if numbers:
                number = draw.choice(numbers)
                raw[number.start() : number.end()] = draw.choice([b"0", b"-1", b"9" * draw.randint(1, 30)])
    return bytes(raw)


def read_both(path, form):
    """(frames, account) of the careful and of the compiled way; the text of a LogError instead, where it is one."""
    results = []
    for fast in (False, True):
        try:
            with open_log(path, form, ReadOptions(fast=fast)) as log:
                results.append((log.frames(), log.account))
        except LogError as error:
            results.append(str(error))
    return results


def assert_alike(careful, compiled):
    """Assert that both ways found the same, and nothing that no bus can carry."""
    if isinstance(careful, str) or isinstance(compiled, str):
        assert careful == compiled
        return
    (frames, account), (other, its_account) = careful, compiled
    assert frames.channels == other.channels
    for column in COLUMNS:
        assert np.array_equal(getattr(frames, column), getattr(other, column)), column
    assert account == its_account
    assert_possible(frames)


def assert_possible(frames: FrameTable):
    """Assert that each frame is one that a bus can carry."""
    remote = frames.flags & FrameFlag.REMOTE != 0
    fd = frames.flags & FrameFlag.FD != 0
    wide = frames.extended | (frames.flags & FrameFlag.ERROR != 0)
    assert (frames.can_id <= np.where(wide, 0x1FFFFFFF, 0x7FF)).all()
    assert (frames.length[~fd] <= 8).all()
    assert np.isin(frames.length, [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]).all()
    shown = np.where(remote, 0, frames.length)
    assert not frames.data[np.arange(frames.data.shape[1]) >= shown[:, None]].any()


def rows(frames):
    """(time_ns, channel name, id, extended, flags, length, data as hex) of each frame."""
    return [
        (
            int(frames.time_ns[k]),
            frames.channels[frames.channel[k]],
            int(frames.can_id[k]),
            bool(frames.extended[k]),
            FrameFlag(int(frames.flags[k])),
            int(frames.length[k]),
            frames.data[k, : 0 if frames.flags[k] & FrameFlag.REMOTE else frames.length[k]].tobytes().hex(),
        )
        for k in range(len(frames))
    ]


def varied(n, seed=1, names=("can0", 'bus "a", front', "bremse ä")):
    """Return frames of all kinds."""
    rng = np.random.default_rng(seed)
    table = FrameTable.empty(n, 64, names)
    fd = FrameFlag.FD
    kinds = np.array(
        [0, fd, fd | FrameFlag.BIT_RATE_SWITCH, fd | FrameFlag.ERROR_STATE, FrameFlag.REMOTE, FrameFlag.ERROR]
    )[rng.integers(0, 6, n)]
    lengths = np.where(kinds & fd, np.array([0, 5, 8, 12, 24, 64])[rng.integers(0, 6, n)], rng.integers(0, 9, n))
    table.time_ns[:] = rng.integers(-(10**12), 10**12, n) * rng.choice([1, 1_700_000], n)
    table.channel[:] = rng.integers(0, len(names), n)
    table.extended[:] = (rng.random(n) < 0.5) & (kinds & FrameFlag.ERROR == 0)
    table.can_id[:] = np.where(table.extended, rng.integers(0, 1 << 29, n), rng.integers(0, 1 << 11, n))
    table.length[:] = lengths
    table.flags[:] = kinds | np.where(rng.random(n) < 0.3, FrameFlag.SENT, 0)
    table.data[:] = rng.integers(0, 256, (n, 64))
    table.data[np.arange(64) >= np.where(kinds & FrameFlag.REMOTE, 0, lengths)[:, None]] = 0
    return table
