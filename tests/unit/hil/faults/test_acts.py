"""What each fault makes of frames: on a talker that sends two messages, without a car."""

import itertools

import pytest

from dbc.contract import spec_of
from dbc.e2e import Checker, Status, check_value
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakePedal, WheelSpeedFront
from hil.faults.catalogue import ENTRIES, injection
from hil.faults.line import FaultyNode
from hil.faults.targets import Takes
from hil.faults.wire import start_messages, stop_messages

TICK_NS = 10_000_000
PEDAL, SPEED = spec_of(BrakePedal), spec_of(WheelSpeedFront)
ARM_TICK = 10


class Talker:
    """Sends both messages in every tick: pedal 0.1 % more each tick, wheels at 50 rad/s; keeps what it heard."""

    def __init__(self):
        self.ticks, self.heard = [], []
        self._transmitter = Transmitter()

    def step(self, now_ns, inbox):
        tick = now_ns // TICK_NS
        self.ticks.append(tick)
        self.heard += inbox
        messages = [BrakePedal(0.001 * tick, 0.001 * tick), WheelSpeedFront(50.0, 50.0)]
        return self._transmitter.frames(now_ns, messages)


def run(*armed, ticks=60, end_tick=None, nodes=("DRIVER", "SENSORS", "PLANT"), talker=None):
    """Frames of each tick; the faults are armed with tick `ARM_TICK`, and stopped at ``end_tick``."""
    talker = talker or Talker()
    node, bench, sent = FaultyNode(talker, nodes), Transmitter(), []
    for tick in range(ticks):
        inbox = [Frame(BusName.VEHICLE, 0x7F0, bytes([tick % 256]))]
        for one in armed:
            inbox += bench.frames(0, start_messages(one)) if tick == ARM_TICK else []
            inbox += bench.frames(0, stop_messages(one)) if tick == end_tick else []
        sent.append(node.step(tick * TICK_NS, inbox))
    return sent


def of(sent, spec, since=0):
    """Frames of a message from a tick on, tick by tick."""
    return [[f for f in frames if f.can_id == spec.can_id] for frames in sent[since:]]


def flat(sent, spec, since=0):
    return [f for frames in of(sent, spec, since) for f in frames]


def statuses(sent, spec):
    checker = Checker(spec.data_id, spec.length)
    return [checker.check(f.data) for f in flat(sent, spec)][ARM_TICK:]


def counters(sent, spec):
    return [f.data[1] & 15 for f in flat(sent, spec)]


def valid(frame, spec):
    return frame.data[0] == check_value(spec.data_id, frame.data)


CLEAN = run()


def test_without_a_fault_a_node_is_as_it_is():
    talker = Talker()
    assert [talker.step(tick * TICK_NS, []) for tick in range(60)] == CLEAN


@pytest.mark.parametrize("name", ["lost", "doubled", "bits_flipped", "id_space"])
def test_the_same_seed_gives_the_same_and_the_other_message_is_left_alone(name):
    on = "PLANT" if name == "id_space" else "BRAKE_PEDAL"
    values = {} if name == "id_space" else {"share": 0.4}
    one, same, other = (run(injection(name, on, seed=seed, **values)) for seed in (1, 1, 2))
    assert one == same
    assert one != other
    if on == "BRAKE_PEDAL":
        assert of(one, SPEED) == of(CLEAN, SPEED)
        assert of(run(injection(name, "ALL", seed=1, **values)), PEDAL) == of(one, PEDAL)


@pytest.mark.parametrize("entry", [e for e in ENTRIES if e.act and e.kind.in_virtual_time], ids=lambda e: e.kind.name)
def test_every_fault_is_decided_by_its_seed_alone(entry):
    on = {"signal": "BRAKE_PEDAL.PEDAL_TRAVEL_1", "link": "PLANT", "process": "PLANT"}.get(entry.kind.family)
    on = on or ("PLANT" if entry.kind.takes is Takes.PROCESS else "BRAKE_PEDAL")
    armed = entry.kind.on(on, seed=7, values={"for_s": 0.2})
    assert run(armed) == run(armed)


def test_frames_before_it_is_armed_are_as_they_were_and_after_its_end_too():
    sent = run(injection("silent", "BRAKE_PEDAL", for_s=0.1))
    assert [not frames for frames in of(sent, PEDAL)] == [ARM_TICK <= tick < ARM_TICK + 10 for tick in range(60)]
    sent = run(injection("silent", "BRAKE_PEDAL"), end_tick=30)
    assert [not frames for frames in of(sent, PEDAL)] == [ARM_TICK <= tick < 30 for tick in range(60)]


def test_a_count_and_pauses_bound_a_fault():
    sent = run(injection("silent", "BRAKE_PEDAL", count=7))
    assert [not frames for frames in of(sent, PEDAL)] == [ARM_TICK <= tick < ARM_TICK + 7 for tick in range(60)]
    sent = run(injection("silent", "BRAKE_PEDAL", on_s=0.02, off_s=0.03))
    gone = [tick for tick, frames in enumerate(of(sent, PEDAL)) if not frames]
    assert gone == [tick for tick in range(ARM_TICK, 60) if (tick - ARM_TICK) % 5 < 2]


def test_a_share_is_met():
    sent = run(injection("lost", "BRAKE_PEDAL", share=0.2, seed=3), ticks=2000)
    assert len(flat(sent, PEDAL)) == pytest.approx(2000 - 0.2 * 1990, abs=60)


def test_a_fault_of_others_does_not_act_here():
    assert run(injection("silent", "MOTOR_DEMAND_FRONT")) == CLEAN
    assert run(injection("silent", "BRAKE_PEDAL"), nodes=("ECU",)) == CLEAN


def test_late_frames_keep_their_order_and_all_come():
    sent = run(injection("late", "BRAKE_PEDAL", ticks=4, seed=2, for_s=0.3))
    assert flat(sent, PEDAL) == flat(CLEAN, PEDAL)
    assert of(sent, PEDAL) != of(CLEAN, PEDAL)
    delays = [
        later - tick
        for tick, frames in enumerate(of(CLEAN, PEDAL))
        for later, others in enumerate(of(sent, PEDAL))
        if frames[0] in others and abs(later - tick) < 8
    ]
    assert {0, 1, 4} <= set(delays) <= {0, 1, 2, 3, 4}


def test_doubled_stale_and_swapped():
    assert [len(f) for f in of(run(injection("doubled", "BRAKE_PEDAL")), PEDAL)] == [1] * 10 + [2] * 50
    sent = run(injection("stale", "BRAKE_PEDAL"))
    assert flat(sent, PEDAL, 20) == flat(CLEAN, PEDAL, 19)[:-1]
    sent = run(injection("swapped", "BRAKE_PEDAL"))
    assert counters(sent, PEDAL)[10:16] == [11, 10, 13, 12, 0, 14]
    assert sorted(flat(sent, PEDAL)) == sorted(flat(CLEAN, PEDAL))


def test_a_replay_is_of_old_frames():
    sent = run(injection("replayed", "BRAKE_PEDAL", delay_s=0.2))
    assert flat(sent, PEDAL)[:30] == flat(CLEAN, PEDAL)[:30]  # listens so long
    assert flat(sent, PEDAL)[30:] == flat(CLEAN, PEDAL)[10:40]


def test_a_second_sender_is_valid_and_counts_by_itself():
    sent = run(injection("second_sender", "BRAKE_PEDAL", offset=5, value=0.0))
    pairs = of(sent, PEDAL, ARM_TICK)
    assert [pair[0] for pair in pairs] == flat(CLEAN, PEDAL, ARM_TICK)
    assert all(valid(pair[1], PEDAL) and PEDAL.decode(pair[1].data) == BrakePedal(0.0, 0.0) for pair in pairs)
    assert all(((b.data[1] & 15) - (a.data[1] & 15)) % 15 == 5 for a, b in pairs)
    pairs = of(run(injection("answering_sender", "BRAKE_PEDAL.PEDAL_TRAVEL_2", value=0.5)), PEDAL, ARM_TICK)
    assert all(((b.data[1] & 15) - (a.data[1] & 15)) % 15 == 1 and valid(b, PEDAL) for a, b in pairs)
    assert all(PEDAL.decode(b.data)[0] == PEDAL.decode(a.data)[0] for a, b in pairs)
    assert all(PEDAL.decode(b.data)[1] == 0.5 for _, b in pairs)


def test_talkers_keep_their_rate():
    sent = run(injection("babble", "PLANT", rate_1_s=250.0, for_s=0.4))
    assert sum(f.can_id == 0 for frames in sent for f in frames) == 100
    assert flat(sent, PEDAL) == flat(CLEAN, PEDAL)
    talked = [f for frames in run(injection("id_space", "PLANT", rate_1_s=4500.0), ticks=60) for f in frames]
    talked = [f for f in talked if f not in flat(CLEAN, PEDAL) + flat(CLEAN, SPEED)]
    assert len({f.can_id for f in talked[:2048]}) == 2048
    assert {len(f.data) for f in talked} == set(range(9))


def test_bits_before_and_after_the_protection():
    for name, first in (("bits_flipped", 0), ("bits_altered", 12)):
        for bits in (1, 2, 16):
            sent = run(injection(name, "BRAKE_PEDAL", bits=bits))
            for was, now in zip(flat(CLEAN, PEDAL, ARM_TICK), flat(sent, PEDAL, ARM_TICK), strict=True):
                a, b = (int.from_bytes(f.data, "little") >> first for f in (was, now))
                assert (a ^ b).bit_count() == bits
                assert valid(now, PEDAL) or name == "bits_flipped"
    assert set(statuses(run(injection("bits_flipped", "BRAKE_PEDAL", bits=2)), PEDAL)) == {Status.WRONG_CRC}


def test_check_values_leave_the_counter_right():
    for name, crc in (
        ("crc_value", lambda was, before: 77),
        ("crc_frozen", lambda was, before: before),
        ("crc_offset", lambda was, before: (was + 3) % 256),
    ):
        values = {"crc_value": {"value": 77}, "crc_offset": {"offset": 3}}.get(name, {})
        sent = run(injection(name, "BRAKE_PEDAL", **values))
        clean = flat(CLEAN, PEDAL)
        frozen = clean[ARM_TICK].data[0]
        for was, now in zip(clean[ARM_TICK:], flat(sent, PEDAL, ARM_TICK), strict=True):
            assert now.data == bytes([crc(was.data[0], frozen)]) + was.data[1:]
    values = [f.data[0] for f in flat(run(injection("crc_random", "BRAKE_PEDAL")), PEDAL, ARM_TICK)]
    assert len(set(values)) > 30


@pytest.mark.parametrize(
    ("name", "values", "first"),
    [
        ("counter_value", {"value": 4}, [4] * 5),
        ("counter_frozen", {}, [9] * 5),
        ("counter_offset", {"offset": 3}, [13, 14, 0, 1, 2]),
        ("counter_jump", {"step": 4}, [13, 2, 6, 10, 14]),
    ],
)
@pytest.mark.parametrize("goes_on", [0, 1, 2])
def test_counters_have_the_check_value_that_belongs_to_them_and_go_on_as_asked(name, values, first, goes_on):
    sent = run(injection(name, "BRAKE_PEDAL", count=5, goes_on=goes_on, **values))
    assert all(valid(f, PEDAL) for f in flat(sent, PEDAL))
    found = counters(sent, PEDAL)
    last = found[ARM_TICK + 4]
    assert found[ARM_TICK : ARM_TICK + 5] == first
    goes = (15, 10, last + 1)[goes_on]
    assert found[ARM_TICK + 5 :] == [(goes + k) % 15 for k in range(45)]
    assert [f.data[2:] for f in flat(sent, PEDAL)] == [f.data[2:] for f in flat(CLEAN, PEDAL)]


def test_a_counter_that_no_sender_gives_and_other_protection():
    assert set(statuses(run(injection("counter_value", "BRAKE_PEDAL", value=15)), PEDAL)) == {Status.WRONG_CRC}
    assert set(counters(run(injection("counter_random", "BRAKE_PEDAL"), ticks=400), PEDAL)) == set(range(15))
    assert set(statuses(run(injection("data_id_wrong", "BRAKE_PEDAL")), PEDAL)) == {Status.WRONG_CRC}
    for length in range(9):
        frames = flat(run(injection("length_wrong", "BRAKE_PEDAL", length=length)), PEDAL, ARM_TICK)
        assert {len(f.data) for f in frames} == {length}


def signal(name, **values):
    """Raw values of the second pedal channel under a fault, and that all else is as it was."""
    sent = run(injection(name, "BRAKE_PEDAL.PEDAL_TRAVEL_2", seed=1, **values))
    frames = flat(sent, PEDAL)
    assert all(valid(f, PEDAL) for f in frames)
    assert set(statuses(sent, PEDAL)) == {Status.OK}
    assert [PEDAL.decode(f.data)[0] for f in frames] == [PEDAL.decode(f.data)[0] for f in flat(CLEAN, PEDAL)]
    return [int.from_bytes(f.data, "little") >> 24 & 0xFFF for f in frames]


TRUE = [round(0.1 * tick / 0.025) for tick in range(60)]  # raw: 0.025 % a step, 0.1 % a tick


def test_signals():
    assert signal("signal_value", value=0.5) == TRUE[:10] + [2000] * 50
    assert signal("signal_value") == TRUE[:10] + [4000] * 50
    assert signal("signal_offset", offset=0.1) == TRUE[:10] + [raw + 400 for raw in TRUE[10:]]
    assert signal("signal_offset", offset=0.1, frames=10)[10:20] == [TRUE[10 + k] + 40 * (k + 1) for k in range(10)]
    assert signal("signal_gain", gain=3.0) == TRUE[:10] + [3 * raw for raw in TRUE[10:]]
    assert signal("signal_stuck") == TRUE[:10] + [TRUE[10]] * 50
    assert signal("signal_step", step=0.2) == TRUE[:10] + [TRUE[10] + 800] * 50
    spiked = signal("signal_spike", every=4, value=1.0)
    assert spiked == TRUE[:10] + [4000 if k % 4 == 0 else TRUE[10 + k] for k in range(50)]
    assert signal("signal_not_available") == TRUE[:10] + [4095] * 50
    beyond = signal("signal_out_of_range")[10:]
    assert set(beyond) <= set(range(4001, 4095))
    assert len(set(beyond)) > 20
    noise = [now - was for now, was in zip(signal("signal_noise", sigma=0.05), TRUE, strict=True)][10:]
    assert any(noise)
    assert max(map(abs, noise)) < 5 * 0.05 * 4000
    assert len(set(signal("signal_random")[10:])) > 40


def test_a_link_that_is_down():
    for name, state in (("bus_off", LinkState.BUS_OFF), ("unplugged", LinkState.DISCONNECTED)):
        talker = Talker()
        sent = run(injection(name, "PLANT", for_s=0.2), talker=talker)
        assert [bool(frames) for frames in sent] == [not 10 <= tick < 30 for tick in range(60)]
        events = [item for item in talker.heard if isinstance(item, LinkEvent)]
        assert [event.state for event in events] == [state, LinkState.RESTARTED]
        heard = {item.data[0] for item in talker.heard if isinstance(item, Frame) and item.bus is BusName.VEHICLE}
        assert heard == set(range(60)) - set(range(10, 30))


def test_queues_that_are_full():
    talker = Talker()
    sent = run(injection("queue_full", "PLANT", for_s=0.03), talker=talker)
    assert [len(frames) for frames in sent] == [0 if 10 <= tick < 13 else 2 for tick in range(60)]
    events = [(e.state, e.number) for e in talker.heard if isinstance(e, LinkEvent)]
    assert events == [(LinkState.TX_OVERFLOW, 2)] * 3
    talker = Talker()
    assert run(injection("rx_overflow", "PLANT", count=4), talker=talker) == CLEAN
    events = [(e.state, e.number) for e in talker.heard if isinstance(e, LinkEvent)]
    assert events == [(LinkState.RX_OVERFLOW, 1)] * 4


def test_processes_in_virtual_time():
    talker = Talker()
    sent = run(injection("process_killed", "PLANT"), talker=talker)
    assert talker.ticks == list(range(10))
    assert not any(sent[10:])
    for name, first in (("process_stopped", 10), ("process_busy", 11)):
        talker = Talker()
        sent = run(injection(name, "PLANT", for_s=0.05), talker=talker)
        assert talker.ticks == [tick for tick in range(60) if not first <= tick < 15]
        assert [len(frames) for frames in sent[9:17]] == [2, 0, 0, 0, 0, 0, 2 if first == 10 else 4, 2]
        heard = [item.data[0] for item in talker.heard if isinstance(item, Frame) and item.bus is BusName.VEHICLE]
        assert heard == list(range(60))  # what arrived meanwhile waited
    talker = Talker()
    run(injection("process_late", "PLANT", for_s=0.05), talker=talker)
    assert talker.ticks == [tick for tick in range(60) if not 10 <= tick < 15]


def test_two_faults_act_one_behind_the_other():
    sent = run(injection("doubled", "BRAKE_PEDAL"), injection("signal_value", "BRAKE_PEDAL.PEDAL_TRAVEL_1", value=1.0))
    assert all(len(pair) == 2 and pair[0] == pair[1] for pair in of(sent, PEDAL, ARM_TICK))
    assert {PEDAL.decode(f.data)[0] for f in flat(sent, PEDAL, ARM_TICK)} == {1.0}


def test_armed_again_a_fault_begins_anew():
    one = injection("silent", "BRAKE_PEDAL", for_s=0.05)
    node, bench = FaultyNode(Talker(), ("DRIVER",)), Transmitter()
    gone = []
    for tick in range(40):
        inbox = bench.frames(0, start_messages(one)) if tick in (10, 13, 30) else []
        if not flat([node.step(tick * TICK_NS, inbox)], PEDAL):
            gone.append(tick)
    assert gone == list(itertools.chain(range(10, 18), range(30, 35)))
