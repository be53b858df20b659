"""The watch over one recorded stop, with what can go wrong put into it."""

import re
from dataclasses import replace

import pytest

from dbc.bench_messages import EcuTiming, FaultCommand, PlantReception
from dbc.contract import contract, encode, spec_of
from dbc.e2e import COUNTER_MODULUS, protect
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal, BrakeStatus, EhbDemandFront, MotorDemandFront
from hil.bench.virtual import VirtualBench
from hil.bench.watch import Watch
from hil.errors import Verdict
from hil.scenario.scenario import load_scenario

MS = 1_000_000


@pytest.fixture(scope="module")
def heard(tmp_path_factory):
    """What the bench hears of two seconds, tick by tick, and when the manoeuvre begins."""
    scenario = load_scenario("stop72")
    scenario = replace(scenario, manoeuvre=replace(scenario.manoeuvre, duration_s=2.0))
    ticks, start = [], None
    with VirtualBench(scenario, tmp_path_factory.mktemp("run")) as bench:
        bench.start()
        while bench.tick():
            if start is None and bench.stimulus_node.time_s is not None:
                start = len(ticks)
            ticks.append([frame for frame in bench.stimulus_node.inbox if isinstance(frame, Frame)])
    return ticks, start


def findings(heard, change=lambda t_ms, frame: [frame], said=None, excused=()):
    """Findings over the run whose frames `change` makes others of; times count from the start of the manoeuvre."""
    ticks, start = heard
    watch = Watch(said.append) if said is not None else Watch()
    watch.excuse(excused)
    for i, inbox in enumerate(ticks):
        t_ms = (i - start) * 10
        frames = [one for frame in inbox for one in change(t_ms, frame)]
        watch.hear(i * 10 * MS + 1, frames)
        if i == start:
            watch.begin()
    return watch.findings()


def spec_of_frame(frame):
    return contract(frame.bus).by_id[frame.can_id]


def of_ecu(frame):
    return spec_of_frame(frame).sender == "ECU"


def is_a(frame, message):
    spec = spec_of(message)
    return (frame.bus, frame.can_id) == (spec.bus, spec.can_id)


def test_a_flawless_run_has_no_findings(heard):
    assert findings(heard) == []


def test_a_node_that_falls_silent_for_good_breaks_the_run_and_is_named_with_the_time(heard):
    said = []
    (found,) = findings(heard, lambda t, f: [] if of_ecu(f) and t >= 1000 else [f], said)
    assert found.verdict is Verdict.BROKEN
    assert "messages of the ECU stopped" in found.text
    assert "at 0.990 s" in found.text or "at 0.980 s" in found.text
    assert said == ["watch: the ECU is silent since 0.990 s"]


@pytest.mark.parametrize("until_ms", [-10, -20, -40])
def test_a_stall_that_ended_before_the_manoeuvre_blames_no_message_for_its_gap(heard, until_ms):
    """A slow message is back only after the manoeuvre began: its gap is the node's, and over."""
    assert findings(heard, lambda t, f: [] if of_ecu(f) and until_ms - 450 <= t <= until_ms else [f]) == []


def test_one_message_that_stops_for_good_breaks_the_run(heard):
    (found, *others) = findings(heard, lambda t, f: [] if is_a(f, EhbDemandFront) and t >= 1000 else [f])
    assert found.verdict is Verdict.BROKEN
    assert "EHB_DEMAND_FRONT at 0.990 s" in found.text
    assert all(other.verdict is Verdict.INCONCLUSIVE for other in others)


def test_a_message_that_pauses_beyond_its_time_out_fails(heard):
    def pause(length_ms):
        return lambda t, f: [] if is_a(f, MotorDemandFront) and 500 <= t < 500 + length_ms else [f]

    assert findings(heard, pause(30)) == []
    found = findings(heard, pause(60))[0]
    assert found.verdict is Verdict.FAILED
    assert "MOTOR_DEMAND_FRONT (0xB0 on the vehicle bus) was silent from 0.490 s to 0.560 s" in found.text


def test_a_whole_node_that_pauses_is_inconclusive(heard):
    found = findings(heard, lambda t, f: [] if of_ecu(f) and 500 <= t < 600 else [f])
    assert {one.verdict for one in found} == {Verdict.INCONCLUSIVE}
    assert "the ECU was silent from 0.490 s to 0.600 s" in [one.text for one in found]


@pytest.mark.parametrize(("skipped", "verdicts"), [(3, []), (4, [Verdict.INCONCLUSIVE])])
def test_overruns_beyond_their_share_are_inconclusive(heard, skipped, verdicts):
    """By the node's own word; 3 of 200 ticks are few."""
    spec = spec_of(EcuTiming)

    def late(t_ms, frame):
        if not is_a(frame, EcuTiming):
            return [frame]
        told = spec.decode(frame.data)
        return [frame._replace(data=encode(told._replace(overruns=skipped * (t_ms >= 500))))]

    found = findings(heard, late)
    assert [one.verdict for one in found] == verdicts
    assert all(f"the ECU skipped {skipped} of " in one.text for one in found)


def test_a_controller_that_tells_nothing_of_its_ticks_is_measured_by_its_cycles(heard):
    """Without ECU_TIMING: every tenth frame of all its messages is not sent, the counters go on without a hole."""
    counters = {}

    def slow(t_ms, frame):
        if is_a(frame, EcuTiming):
            return []
        if not of_ecu(frame) or spec_of_frame(frame).data_id is None:
            return [frame]
        if t_ms % 100 == 0:
            return []
        counters[frame.can_id] = (counters.get(frame.can_id, -1) + 1) % COUNTER_MODULUS
        return [again(frame, counters[frame.can_id])]

    found = findings(heard, slow)
    assert any("the ECU skipped" in one.text and "cycles of" in one.text for one in found)
    assert {one.verdict for one in found} == {Verdict.INCONCLUSIVE}


def again(frame, counter):
    """The frame with another counter, protected anew."""
    return frame._replace(data=protect(spec_of_frame(frame).data_id, bytearray(frame.data), counter))


@pytest.mark.parametrize("message", [BrakePedal, BrakeStatus])
def test_a_second_sender_is_named(heard, message):
    said = []
    spec = spec_of(message)
    found = findings(heard, lambda t, f: [f, f] if is_a(f, message) and t >= 500 else [f], said)
    assert [one.verdict for one in found] == [Verdict.INCONCLUSIVE]
    assert f"{spec.name} (0x{spec.can_id:X} on the vehicle bus) came more often than its cycle" in found[0].text
    assert len(said) == 1


def test_a_second_sender_is_told_before_the_manoeuvre_too(heard):
    """It may keep the manoeuvre from beginning at all."""
    ticks, start = heard
    watch = Watch()
    for i, inbox in enumerate(ticks[:start]):
        watch.hear(i * 10 * MS + 1, [*inbox, *(frame for frame in inbox if is_a(frame, BrakePedal))])
    assert watch.others == ["BRAKE_PEDAL (0xA0 on the vehicle bus)"]
    assert watch.findings() == []


def test_a_second_sender_that_sends_now_and_then_is_told_by_its_counters(heard):
    def now_and_then(t_ms, frame):
        if not is_a(frame, BrakePedal) or t_ms % 200:
            return [frame]
        return [frame, again(frame, ((frame.data[1] & 0x0F) + 7) % COUNTER_MODULUS)]

    (found,) = findings(heard, now_and_then)
    assert found.verdict is Verdict.INCONCLUSIVE
    assert "BRAKE_PEDAL" in found.text
    assert "with a counter out of sequence" in found.text


def test_demands_that_never_reach_the_plant_are_told(heard):
    """The plant's own word: the counter it took last stays."""
    spec = spec_of(PlantReception)

    def deaf(t_ms, frame):
        if not is_a(frame, PlantReception) or t_ms < 500:
            return [frame]
        return [frame._replace(data=encode(spec.decode(frame.data)._replace(counter_motor_demand_front=3)))]

    (found,) = findings(heard, deaf)
    assert found.verdict is Verdict.INCONCLUSIVE
    assert re.search(r"MOTOR_DEMAND_FRONT was sent, but the plant took none of it from 0\.5[01]0 s to", found.text)


@pytest.mark.parametrize("field", ["frames_lost", "frames_corrupt"])
def test_frames_that_a_receiver_misses_are_inconclusive_beyond_their_share(heard, field):
    spec = spec_of(PlantReception)

    def missing(t_ms, frame):
        if not is_a(frame, PlantReception) or t_ms < 500:
            return [frame]
        return [frame._replace(data=encode(spec.decode(frame.data)._replace(**{field: 20})))]

    (found,) = findings(heard, missing)
    assert found.verdict is Verdict.INCONCLUSIVE
    assert "20 of 796 frames to the plant" in found.text
    assert field.removeprefix("frames_") in found.text


def test_what_the_test_itself_disturbs_is_not_judged(heard):
    spec = spec_of(MotorDemandFront)
    pause = lambda t, f: [] if is_a(f, MotorDemandFront) and 500 <= t < 600 else [f]  # noqa: E731
    assert findings(heard, pause) != []
    assert findings(heard, pause, excused=[(spec.bus, spec.can_id)]) == []
    assert findings(heard, pause, excused=None) == []
    by_hand = Frame(BusName.BENCH, spec_of(FaultCommand).can_id, bytes(8))
    assert findings(heard, lambda t, f: [*pause(t, f), by_hand]) == []


def test_frames_of_nobody_change_nothing(heard):
    strangers = [Frame(BusName.VEHICLE, 0x7AB, b""), Frame(BusName.VEHICLE, 0xA0, bytes(8), 0, True)]
    assert findings(heard, lambda t, f: [f, *strangers]) == []
