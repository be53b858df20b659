import random

import pytest

from dbc.bench_messages import BENCH_MESSAGES, EcuReception
from dbc.contract import contract, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakeStatus
from ecu.node import EcuNode


def test_sends_every_message_of_the_ecu_at_its_cycle_time(rig):
    counts: dict[tuple, int] = {}
    for _ in range(100):
        for frame in rig.step():
            counts[frame.bus, frame.can_id] = counts.get((frame.bus, frame.can_id), 0) + 1
    for spec in contract(BusName.VEHICLE).sent_by("ECU"):
        assert counts.pop((spec.bus, spec.can_id)) == 100 * 10_000_000 // spec.cycle_ns, spec.name
    reception = spec_of(EcuReception)
    assert counts.pop((reception.bus, reception.can_id)) == 100
    assert not counts


def test_truth_replaced_by_noise_leaves_the_bytes_alone(parameters, rig):
    truth = [spec_of(t) for t in BENCH_MESSAGES if t.__name__.startswith("Truth")]
    other = EcuNode(parameters)
    noise = random.Random(1)
    for tick in range(300):
        inbox = list(rig.waiting)
        zeros = [Frame(s.bus, s.can_id, bytes(s.length)) for s in truth]
        random_bytes = [Frame(s.bus, s.can_id, noise.randbytes(s.length)) for s in truth]
        now = tick * 10_000_000
        assert rig.node.step(now, zeros + inbox) == other.step(now, inbox + random_bytes)
        rig.waiting = rig.car.frames(now)


def test_reception_reports_counters_and_losses(rig):
    rig.step(20)
    rig.step()
    report = next(f for f in rig.step() if f.can_id == spec_of(EcuReception).can_id)
    seen = spec_of(EcuReception).decode(report.data)
    assert seen.counter_brake_pedal == 20 % 15
    assert seen.frames_lost == 0
    rig.waiting = []
    rig.step()
    report = next(f for f in rig.step() if f.can_id == spec_of(EcuReception).can_id)
    assert spec_of(EcuReception).decode(report.data).frames_lost > 0


@pytest.mark.parametrize("period_ns", [1_000_000, 5_000_000])
def test_a_faster_task_keeps_the_cycle_times(parameters, rig, period_ns):
    node = EcuNode(parameters, period_ns)
    spec = spec_of(BrakeStatus)
    number = 0
    for n in range(200_000_000 // period_ns):
        number += sum(f.can_id == spec.can_id and f.bus == spec.bus for f in node.step(n * period_ns, []))
    assert number == 10


def test_a_late_tick_sends_each_message_once(rig):
    rig.step(10)
    late = rig.node.step(10 * 10_000_000 + 200_000_000, rig.waiting)
    ids = [(f.bus, f.can_id) for f in late]
    assert len(ids) == len(set(ids))
