"""Frames taken together are what each gives alone: the same checks, the same values, whatever comes in which order."""

import math
import os
import random
import subprocess
import sys
from dataclasses import replace
from enum import IntEnum

import pytest

from dbc import exchange, intake
from dbc.batch import Batch
from dbc.bench_messages import BENCH_MESSAGES, StimulusDriver, TruthMotion
from dbc.codec import CodecError
from dbc.contract import spec_of
from dbc.e2e import check_value
from dbc.exchange import Receiver
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.intake import NO_COUNTER, WELL
from dbc.messages import BRAKE_MESSAGES, BatteryStatus, BrakePedal, EhbPressureFront
from hil.validation.perf.cantools_codec import cantools_spec

MS = 1_000_000
KINDS = (*BRAKE_MESSAGES, *BENCH_MESSAGES)
READ = (BrakePedal, EhbPressureFront, TruthMotion, StimulusDriver, BatteryStatus)


class Gap(IntEnum):
    """Choices with a gap."""

    A = 0
    B = 2


def as_numbers(message, spec):
    return [math.nan] * len(spec.fields) if message is None else [math.nan if v is None else v for v in message]


def same(ours, theirs):
    return all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(ours, theirs, strict=True))


def payload_of(spec, rng, counter):
    """Any payload of a message, with its protection."""
    data = bytearray(rng.randbytes(spec.length))
    for k in range(spec.length):
        if rng.random() < 0.3:
            data[k] = rng.choice((0, 0xFF))
    if spec.data_id is not None:
        data[1] = (data[1] & 0xF0) | counter
        data[0] = check_value(spec.data_id, data)
    return bytes(data)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_same_values_as_the_codec_and_as_cantools(kind):
    rng = random.Random(kind.__name__)
    spec, theirs = spec_of(kind), cantools_spec(kind)
    receiver = Receiver([kind])
    taken = receiver.of(kind)
    unknown = 0
    for k in range(300):
        data = payload_of(spec, rng, k % 15)
        receiver.accept(k * spec.cycle_ns, [Frame(spec.bus, spec.can_id, data)])
        reception = receiver.receptions[kind]
        if k > 0:
            assert reception.fresh
            assert receiver.latest(kind) == spec.decode(data)
            assert same(taken.tolist(), as_numbers(spec.decode(data), spec))
            unknown += sum(map(math.isnan, taken))
    assert unknown > 0 or all(field.sna is None for field in spec.fields)
    message = spec.type(*(field.minimum * field.si_per_unit for field in spec.fields))
    for counter in (0, 1, 2):
        receiver.accept(
            (320 + counter) * spec.cycle_ns, [Frame(spec.bus, spec.can_id, theirs.encode(message, counter))]
        )
    assert same(taken.tolist(), as_numbers(theirs.decode(theirs.encode(message, 2)), spec))


class NothingUsual(intake.Intake):
    """Leaves every frame to be judged alone."""

    def take(self, now_ns, begin, frames):
        super().take(now_ns, 0, frames[:0]) if begin == 0 else None  # nothing is fresh yet
        return min(begin, len(frames) // 9)


@pytest.fixture
def one_by_one(monkeypatch):
    """A receiver that takes no frames together."""
    with monkeypatch.context() as patched:
        patched.setattr(exchange, "Intake", NothingUsual)
        return Receiver(READ)


def disturbed(frame, rng):
    """A frame as a bus may bring it: mostly itself, else lost, doubled, changed, cut, or somebody else's."""
    kind = rng.randrange(24)
    data = bytearray(frame.data)
    if kind == 0:
        return []
    if kind == 1:
        return [frame, frame]
    if kind == 2:
        data[rng.randrange(8)] ^= 1 << rng.randrange(8)
        return [frame._replace(data=bytes(data))]
    if kind == 3:
        return [frame._replace(data=bytes(data[: rng.randrange(8)]))]
    if kind == 4:
        return [frame._replace(data=bytes(data) + b"\0")]
    if kind == 5:
        return [frame._replace(extended=True), frame]
    if kind == 6:
        return [frame._replace(bus=BusName.BENCH if frame.bus is BusName.VEHICLE else BusName.VEHICLE), frame]
    if kind == 7:
        return [LinkEvent(BusName.VEHICLE, LinkState.BUS_ERROR), frame]
    return [frame]


@pytest.mark.parametrize("seed", range(20))
def test_any_stream_is_judged_as_one_by_one(seed, one_by_one):
    rng = random.Random(seed)
    receiver, alone = Receiver(READ), one_by_one
    sender, second, late = Batch(READ), Batch(READ), []
    second.values[:] = 0.0
    usable = 0
    for tick in range(150):
        now_ns = tick * 10 * MS
        for kind in READ:
            sender.of(kind)[:] = [rng.uniform(f.minimum, f.maximum) * f.si_per_unit for f in spec_of(kind).fields]
        frames = sender.frames(now_ns) + (second.frames(now_ns) if 60 < tick < 75 and seed % 2 else [])
        inbox = late + [got for frame in frames for got in disturbed(frame, rng)]
        late = [inbox.pop() for _ in range(rng.randrange(3)) if rng.random() < 0.2 and inbox]
        receiver.accept(now_ns, inbox)
        alone.accept(now_ns, inbox)
        assert receiver.link_events == [item for item in inbox if isinstance(item, LinkEvent)]
        for kind in READ:
            got, one = receiver.receptions[kind], alone.receptions[kind]
            assert got.memory.tolist() == one.memory.tolist()
            assert (got.message, got.odd_ns, got.bad, got.foreign) == (one.message, one.odd_ns, one.bad, one.foreign)
            assert same(receiver.of(kind).tolist(), as_numbers(got.message, got.spec))
            assert same(receiver.of(kind).tolist(), alone.of(kind).tolist())
            assert got.memory[WELL] == (got.fresh and not got.bad_in_row and got.odd_ns != now_ns)
            usable += got.fresh
        assert (receiver.lost, receiver.corrupt) == (alone.lost, alone.corrupt)
        assert receiver.counters == [NO_COUNTER if (n := receiver.counter(kind)) is None else n for kind in READ]
    assert 200 < usable < 600


def test_refuses_a_big_endian_signal_and_choices_with_a_gap(monkeypatch):
    spec = spec_of(EhbPressureFront)
    for changed, words in (
        (replace(spec.fields[0], little_endian=False), "PRESSURE_FL: expected a little-endian signal"),
        (replace(spec.fields[0], enum=Gap), "PRESSURE_FL: expected choices without a gap"),
    ):
        monkeypatch.setattr(exchange, "spec_of", lambda kind, f=changed: replace(spec, fields=(f, *spec.fields[1:])))
        with pytest.raises(CodecError, match=f"EHB_PRESSURE_FRONT.{words}"):
            Receiver([EhbPressureFront])


def test_refuses_more_messages_than_an_index_can_tell():
    with pytest.raises(CodecError, match="a receiver of 256 messages: expected at most 255"):
        intake.Intake([spec_of(BrakePedal)] * 256)


UNCOMPILED = """
from dbc.batch import Batch
from dbc.bench_messages import BENCH_MESSAGES
from dbc.contract import spec_of
from dbc.exchange import Receiver
from dbc.messages import BRAKE_MESSAGES
kinds = (*BRAKE_MESSAGES, *BENCH_MESSAGES)
sender, receiver = Batch(kinds), Receiver(kinds)
for tick in range(6):
    for kind in kinds:
        for i, f in enumerate(spec_of(kind).fields):
            sender.of(kind)[i] = (f.minimum + (0.3 * tick - 0.3) * (f.maximum - f.minimum)) * f.si_per_unit
    sender.of(BRAKE_MESSAGES[0])[0] = float("nan")
    frames = sender.frames(tick * 100_000_000)
    receiver.accept(tick * 100_000_000, frames)
    print(b"".join(frame.data for frame in frames).hex(), receiver.values.tolist(), receiver.counters)
"""


@pytest.mark.slow
def test_same_bytes_and_values_uncompiled():
    told = [
        subprocess.run(
            [sys.executable, "-c", UNCOMPILED], env=os.environ | more, capture_output=True, text=True, check=True
        ).stdout
        for more in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert told[0] == told[1]
    assert len(told[0]) > 1000
