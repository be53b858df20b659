import functools
import random
import struct
import zlib

import numpy as np
import pytest
from blf_bytes import classical, container, error, error_64, error_ext, fd, fd_64, file_of, marker, one

from hil.log.blf import blf
from hil.log.blf import inflate as blf_inflate
from hil.log.builder import FrameBuilder
from hil.log.frames import FD_LENGTHS, MAX_EXTENDED_ID, MAX_STANDARD_ID, FrameFlag, LogError
from hil.log.read import open_log
from hil.log.source import ReadOptions

SOME = bytes(range(1, 65))
OBJECTS = [
    classical(0x100, SOME[:8]), classical(0x80000123, SOME[:8], kind=86, stamp=3, version=2), marker(b"some text"),
    fd(0x101, SOME[:12], stamp=4, unit=1), error(), fd_64(0x102, SOME, dlc=15, kinds=0x3000, stamp=-5, channel=200),
    error_ext(0x4, SOME[:8]), classical(0x103, b"", dlc=5, flags=0x80), classical(0x104, flags=2), one(72, bytes(24)),
    error_64(0x5, SOME[:12], dlc=9, kinds=0x80), fd_64(0x105, SOME[:5], dlc=5, kinds=0), fd(0x106, dlc=2, flags=0x81),
    classical(0x107, SOME[:8], channel=9, flags=1), one(300, bytes(9)), fd(0x108, SOME, dlc=15, kinds=7, held=64),
]  # fmt: skip


def padded(objects):
    return b"".join(one + bytes(len(one) % 4) for one in objects)


def file_with(stream, rng):
    """A stream of objects in containers of several sizes, stored and deflated, some objects outside."""
    pieces, at = [], 0
    while at < len(stream):
        size = rng.choice((40, 97, 200, 300))
        pieces.append(container(stream[at : at + size], rng.choice((0, 2, 2))))
        at += size
        if rng.random() < 0.1:
            pieces.append(padded([rng.choice(OBJECTS)]))
    return file_of(*pieces)


def mutant(content, rng, begin):
    """Bytes flipped, cut off, inserted, swapped, doubled, numbers blown up; none before ``begin``."""
    content = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(begin, max(len(content), begin + 1))
        length = rng.choice((1, 2, 4, 16, 48, 120))
        piece = content[at : at + length]
        other = rng.randrange(begin, max(len(content), begin + 1))
        match rng.randrange(9):
            case 0 | 1:
                content[at : at + 1] = bytes([rng.randrange(256)])
            case 2:
                content[at : at + 1] = bytes([(content[at] if at < len(content) else 0) ^ 1 << rng.randrange(8)])
            case 3:
                del content[at:]
            case 4:
                del content[at : at + length]
            case 5:
                content[at:at] = rng.randbytes(length)
            case 6:
                content[other:other] = piece
            case 7:
                content[at : at + len(piece)] = content[other : other + len(piece)]
            case 8:
                number = rng.choice((0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x80000000, 16, 47, 49, 96, 65_536, 16 * 2**20 + 1))
                content[at : at + 4] = struct.pack("<L", number)
    return bytes(content)


def mutants(n):
    rng = random.Random(47)
    stream = padded(rng.choice(OBJECTS) for _ in range(60))
    for k in range(n):
        if k % 3:  # inside the containers
            yield file_with(mutant(stream, rng, 0), rng)
        else:
            yield mutant(file_with(stream, rng), rng, 4)


def reading(path, fast):
    with open_log(path, "blf", ReadOptions(fast=fast)) as log:
        try:
            recording = log.recording()
        except LogError as error:
            return str(error), None, None
        return recording, log.account.passed_over, log.account.start_ns


def check_sound(recording):
    frames = recording.frames
    error = (frames.flags & FrameFlag.ERROR) != 0
    remote = (frames.flags & FrameFlag.REMOTE) != 0
    assert (frames.can_id <= np.where(frames.extended | error, MAX_EXTENDED_ID, MAX_STANDARD_ID)).all()
    assert not (frames.extended & error).any()
    assert (frames.length[(frames.flags & FrameFlag.FD) == 0] <= 8).all()
    assert set(frames.length.tolist()) <= FD_LENGTHS
    held = np.where(remote, 0, frames.length)
    assert not frames.data[np.arange(frames.data.shape[1]) >= held[:, None]].any()
    assert len(recording.first_rejected) == min(recording.rejected, 10)


def same(one, other):
    (a, *rest), (b, *others) = one, other
    if isinstance(a, str):
        return a == b
    columns = ("time_ns", "channel", "can_id", "extended", "length", "data", "flags")
    return (
        rest == others
        and a.frames.channels == b.frames.channels
        and all(np.array_equal(getattr(a.frames, c), getattr(b.frames, c)) for c in columns)
        and (a.rejected, a.first_rejected, a.truncated_at, a.notes)
        == (b.rejected, b.first_rejected, b.truncated_at, b.notes)
    )


def small_blocks(monkeypatch):
    monkeypatch.setattr(blf, "BLOCK_BYTES", 101)
    monkeypatch.setattr(blf_inflate, "GROUP_BYTES", 300)
    monkeypatch.setattr(blf, "FrameBuilder", functools.partial(FrameBuilder, rows=7))


def check_mutants(tmp_path, monkeypatch, n):
    path = tmp_path / "a.blf"
    for content in mutants(n):
        path.write_bytes(content)
        careful = reading(path, False)
        if not isinstance(careful[0], str):
            check_sound(careful[0])
        assert same(careful, reading(path, True)), content
        with monkeypatch.context() as patch:
            small_blocks(patch)
            assert same(careful, reading(path, True)), content
            assert same(careful, reading(path, False)), content


def test_both_ways_and_all_block_sizes_agree(tmp_path, monkeypatch):
    check_mutants(tmp_path, monkeypatch, 40)


@pytest.mark.slow
def test_both_ways_and_all_block_sizes_agree_on_mutants(tmp_path, monkeypatch):
    check_mutants(tmp_path, monkeypatch, 2000)


def test_the_unharmed_log(tmp_path):
    path = tmp_path / "a.blf"
    path.write_bytes(file_of(container(padded(OBJECTS))))
    recording, passed_over, _ = reading(path, True)
    assert len(recording.frames) == 12
    assert recording.rejected == 0
    assert sum(passed_over.values()) == 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "content",
    [
        b"LOBJ" * 2_000_000,
        one(1, b"") * 250_000,
        one(96, b"", size=15 * 2**20) * 250_000,
        one(96, b"", header_size=16)[:16] * 500_000,
        classical(0x800) * 170_000,
        classical(stamp=2**63 - 1) * 170_000,
        (b"\0" * 8 + classical()) * 140_000,
        b"LOB" * 2_700_000,
        b"".join(classical(channel=c) for c in range(65_536)),
    ],
    ids=["signatures", "short", "overlong", "small", "bad", "late", "gaps", "near", "channels"],
)
@pytest.mark.parametrize("packed", [0, 2])
def test_hostile_content_is_counted_in_the_compiled_pass(tmp_path, monkeypatch, content, packed):
    """Each step outside the compiled pass costs microseconds: few may be taken, however many pieces are bad."""
    from hil.log.blf.objects import ObjectStream

    steps = []
    step = ObjectStream._step
    monkeypatch.setattr(ObjectStream, "_step", lambda self, *a: steps.append(1) or step(self, *a))
    path = tmp_path / "a.blf"
    path.write_bytes(file_of(*(container(content[at : at + 2**20], packed) for at in range(0, len(content), 2**20))))
    with open_log(path, "blf", ReadOptions(fast=True)) as log:
        frames = sum(map(len, log.tables()))
        assert frames + log.account.rejected + sum(log.account.passed_over.values()) > 0
    assert len(steps) < 70_000
    assert zlib.crc32(content)
