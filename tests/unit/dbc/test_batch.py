"""Messages encoded side by side are, byte for byte, what each gives alone, and what cantools gives."""

import math
import random
from dataclasses import replace

import pytest

from dbc import batch, e2e
from dbc.batch import Batch
from dbc.bench_messages import BENCH_MESSAGES, TruthMotion
from dbc.codec import CodecError
from dbc.contract import spec_of
from dbc.exchange import Transmitter
from dbc.messages import BRAKE_MESSAGES, BatteryStatus, BrakeEstimateFront, BrakePedal, BrakeStatus
from hil.validation.perf.cantools_codec import cantools_spec

MS = 1_000_000
KINDS = (*BRAKE_MESSAGES, *BENCH_MESSAGES)


def interesting(field, rng):
    """Values of a field in SI units: ends, beyond, halves between two raw numbers and their neighbours, any."""
    ends = (field.minimum, field.maximum)
    values = [end * share for end in ends for share in (0.0, 1.0, 1.0 + 1e-12, 1.5, 1e30)]
    raws = [round(end / field.factor) for end in ends] + [rng.randrange(-1000, 1000) for _ in range(4)]
    values += [(raw + part) * field.factor + field.offset for raw in raws for part in (-0.5, 0.0, 0.5)]
    values += [math.nextafter(value, side) for value in values for side in (-math.inf, math.inf)]
    values += [rng.uniform(*ends) for _ in range(20)]
    values = [value * field.si_per_unit for value in values]
    return values + ([math.nan, math.inf, -math.inf, 1e300] if field.sna is not None else [])


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_same_bytes_as_the_codec_and_as_cantools(kind):
    rng = random.Random(kind.__name__)
    spec, theirs = spec_of(kind), cantools_spec(kind)
    columns = [interesting(field, rng) for field in spec.fields]
    one = Batch([kind])
    step_ns = spec.cycle_ns or MS
    for k in range(200):
        values = [rng.choice(column) for column in columns]
        one.of(kind)[:] = values
        counter = k % e2e.COUNTER_MODULUS
        (frame,) = one.frames(k * step_ns)
        assert frame == (spec.bus, spec.can_id, spec.encode(values, counter), 0, False)
        if k % 10 == 0:
            message = [v if abs(v) < batch.LIMIT else None for v in values]
            assert frame.data == theirs.encode(spec.type(*message), counter)


@pytest.mark.parametrize("period_ms", [1, 2, 5, 10, 30])
def test_the_frames_of_a_transmitter(period_ms):
    kinds = (BrakePedal, BatteryStatus, TruthMotion, BrakeStatus, BrakeEstimateFront)
    rng = random.Random(period_ms)
    side_by_side, transmitter = Batch(kinds), Transmitter()
    sent = 0
    for tick in range(300):
        messages = [kind(*(rng.uniform(0.0, 1.0) for _ in kind._fields)) for kind in kinds]
        for message in messages:
            side_by_side.of(type(message))[:] = message
        now_ns = (tick * period_ms + rng.randrange(5) // 4 * 40) * MS  # now and then late
        frames = side_by_side.frames(now_ns)
        assert frames == transmitter.frames(now_ns, messages)
        sent += len(frames)
    assert sent > 300 * min(period_ms, 10) / 10


def test_refuses_what_has_no_value_and_no_sna():
    truth = Batch([BrakePedal, TruthMotion])
    truth.values[:] = 0.0
    truth.of(TruthMotion)[2] = math.nan
    with pytest.raises(CodecError, match=r"TRUTH_MOTION.DISTANCE: expected a finite number, got nan"):
        truth.frames(0)


def test_refuses_a_big_endian_signal(monkeypatch):
    spec = spec_of(BrakePedal)
    turned = replace(spec, fields=(replace(spec.fields[0], little_endian=False), spec.fields[1]))
    monkeypatch.setattr(batch, "spec_of", lambda kind: turned)
    with pytest.raises(CodecError, match=r"BRAKE_PEDAL.PEDAL_TRAVEL_1: expected a little-endian signal"):
        Batch([BrakePedal])
