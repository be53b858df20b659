"""Replay: what is chosen of a log, and when it is sent, in virtual time."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.contract import contract
from dbc.database import parse_database
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.playback import AFTER_CUE_NS, LISTEN_NS, STALL_NS, Replay
from hil.bench.replay_selection import ReplayError, select
from hil.log.builder import FrameBuilder
from hil.log.choice import Choice, Moment
from hil.log.frames import FrameFlag
from hil.log.signals.databases import Databases
from hil.rt.clock import VirtualClock
from hil.rt.loop import GRID_NS

MS = 1_000_000
T0 = 1_700_000_000_000_000_000
PEDAL, WHEEL, DEMAND, BATTERY = 0xA0, 0xC0, 0xA8, 0x120
STIMULUS_ROAD, STIMULUS_ECU, FAULT, TRUTH, ECU_TIMING, PLANT_TIMING = 0x11, 0x12, 0x13, 0x20, 0x30, 0x31


def log(*rows, channel="vehicle"):
    """A recording of (time ns, id[, channel[, data]])."""
    builder = FrameBuilder()
    for time_ns, can_id, *rest in rows:
        name = rest[0] if rest else channel
        data = rest[1] if len(rest) > 1 else bytes(8)
        assert builder.add(T0 + time_ns, name, can_id, can_id > 0x7FF, data, FrameFlag(0), 0)
    return builder.recording(Path("some.log"), "candump")


SELECT = {"channel_map", "databases", "choice", "max_gap_ns"}


class FakeBus:
    """Notes what is sent and when; others' frames are handed in with a time."""

    name = "loopback:fake"

    def __init__(self, clock, incoming=()):
        self.clock, self.incoming = clock, list(incoming)
        self.sent = []

    def receive(self, timeout_s):
        now = self.clock.now_ns()
        got = [item for time_ns, item in self.incoming if time_ns <= now]
        self.incoming = [pair for pair in self.incoming if pair[0] > now]
        return got

    def send(self, frames):
        self.sent += [(self.clock.now_ns(), frame) for frame in frames]


class StallingClock(VirtualClock):
    """Sleeps past ``stall_from_ns`` end only at ``stall_to_ns``."""

    def __init__(self, stall_from_ns, stall_to_ns):
        super().__init__()
        self.window = stall_from_ns, stall_to_ns

    def sleep_until(self, deadline_ns):
        start, end = self.window
        super().sleep_until(end if start <= deadline_ns < end else deadline_ns)


def replay(recording, role="all", speed=1.0, clock=None, incoming=(), **options):
    clock = clock or VirtualClock()
    chosen = select(recording, role, **{k: options.pop(k) for k in SELECT & set(options)})
    named = {*BusName, *(i.bus for i in chosen.identities)}
    buses = {bus: FakeBus(clock, [p for p in incoming if p[1].bus == bus]) for bus in named}
    return Replay(chosen, buses, clock, speed, **options), buses


def ids(buses, bus=BusName.VEHICLE):
    return [frame.can_id for _, frame in buses[bus].sent]


BOTH_SIDES = [
    (0, PEDAL), (0, TRUTH, "bench"), (0, PLANT_TIMING, "bench"), (1, STIMULUS_ECU, "bench"),
    (1, STIMULUS_ROAD, "bench"), (2, FAULT, "bench"), (5 * MS, DEMAND), (5 * MS, ECU_TIMING, "bench"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("role", "vehicle", "bench"),
    [
        ("plant", [PEDAL], [TRUTH, PLANT_TIMING, STIMULUS_ECU]),
        ("ecu", [DEMAND], [STIMULUS_ROAD, FAULT, ECU_TIMING]),
        ("all", [PEDAL, DEMAND], [TRUTH, PLANT_TIMING, STIMULUS_ECU, STIMULUS_ROAD, FAULT, ECU_TIMING]),
    ],
)
def test_a_role_sends_its_own_and_the_stimulus_of_the_other(role, vehicle, bench):
    run, buses = replay(log(*BOTH_SIDES), role)
    run.run()
    assert ids(buses) == vehicle
    assert ids(buses, BusName.BENCH) == bench


def test_every_message_of_the_contract_belongs_to_one_replay_of_a_side():
    specs = [spec for bus in BusName for spec in contract(bus).by_id.values()]
    rows = [(i, spec.can_id, str(spec.bus)) for i, spec in enumerate(specs)]
    sides = [{(i.bus, i.can_id) for i in select(log(*rows), role).identities} for role in ("plant", "ecu")]
    assert sides[0] | sides[1] == {(spec.bus, spec.can_id) for spec in specs}
    both = {contract(bus).by_id[can_id].name for bus, can_id in sides[0] & sides[1]}
    assert both == {"FAULT_PARAMETER", "FAULT_SELECT"}  # each side arms what befalls its own frames


def test_what_is_left_out_is_counted():
    builder = FrameBuilder()
    for time_ns, can_id, data, flags in (
        (0, PEDAL, bytes(8), FrameFlag(0)),
        (1, PEDAL, bytes(7), FrameFlag(0)),
        (2, 0x40, bytes(8), FrameFlag.ERROR),
        (3, PEDAL, b"", FrameFlag.REMOTE),
        (4, PEDAL, bytes(8), FrameFlag.FD),
        (5, DEMAND, bytes(8), FrameFlag(0)),
    ):
        assert builder.add(T0 + time_ns, "vehicle", can_id, False, data, flags, 8)
    assert builder.add(T0, "can7", PEDAL, False, bytes(8), FrameFlag(0), 8)
    chosen = select(builder.recording(Path("some.log"), "candump"), "plant")
    assert len(chosen.time_ns) == 1
    assert chosen.left_out == {
        "of another channel": 1,
        "error or remote frames": 2,
        "CAN FD frames": 1,
        "not of the plant": 1,
        "of a length that is not the DBC's": 1,
    }


def test_channels_of_foreign_logs():
    foreign = log((0, 0x123, "can0", b"abc"), (1, 0x18FEF100, "can0"))
    run, buses = replay(foreign)
    run.run()
    assert [frame[:3] + frame[4:] for _, frame in buses[BusName.VEHICLE].sent] == [
        (BusName.VEHICLE, 0x123, b"abc", False),
        (BusName.VEHICLE, 0x18FEF100, bytes(8), True),
    ]
    two = log((0, 0x123, "can0"), (1, 0x124, "can1"))
    with pytest.raises(ReplayError, match="can0, can1; say with --map which one goes where: --map can0=vehicle"):
        select(two)
    assert [i.can_id for i in select(two, channel_map={"can1": "vehicle"}).identities] == [0x124]
    with pytest.raises(ReplayError, match="no channel 'can2'; its channels: can0, can1"):
        select(two, channel_map={"can2": "vehicle"})
    with pytest.raises(ReplayError, match=r"nothing to send as plant \(1 .*not of the plant\); its channels: can0"):
        select(log((0, 0x123, "can0")), "plant")
    with pytest.raises(ReplayError, match="nothing to send as all"):
        select(log())


@pytest.mark.parametrize(("role", "phase_ns"), [("plant", 0), ("ecu", 5 * MS), ("all", 0)])
def test_the_start_is_on_the_grid_at_the_phase_of_the_role(role, phase_ns):
    run, buses = replay(log((0, PEDAL), (0, DEMAND)), role, clock=VirtualClock(123_456_789))
    run.run()
    assert buses[BusName.VEHICLE].sent[0][0] == 2 * GRID_NS + phase_ns


@given(
    st.lists(st.integers(0, 2_000 * MS), min_size=1, max_size=40),
    st.sampled_from([0.25, 1.0, 3.0, 10.0]),
)
def test_in_virtual_time_every_frame_leaves_at_its_deadline_in_order(times, speed):
    recording = log(*((t, 0x100 + i) for i, t in enumerate(times)))
    run, buses = replay(recording, speed=speed)
    run.run()
    sent = buses[BusName.VEHICLE].sent
    start = sent[0][0]
    order = sorted(range(len(times)), key=lambda i: times[i])
    assert [frame.can_id - 0x100 for _, frame in sent] == order
    assert [t - start for t, _ in sent] == [round((times[i] - min(times)) / speed) for i in order]
    assert run.sent == len(times)
    assert run.lateness_ns.tolist() == [0] * len(times)
    assert run.duration_ns == sent[-1][0] - start


def test_no_drift_over_two_minutes():
    run, buses = replay(log(*((i * 10 * MS, PEDAL) for i in range(12_001))))
    run.run()
    assert run.duration_ns == 120_000 * MS
    assert buses[BusName.VEHICLE].sent[-1][0] - buses[BusName.VEHICLE].sent[0][0] == 120_000 * MS


def test_a_short_stall_delays_and_keeps_everything_in_order():
    start = GRID_NS
    rows = [(i * MS, 0x100) for i in range(40)]
    clock = StallingClock(start + 5 * MS, start + 5 * MS + STALL_NS)
    run, buses = replay(log(*rows), clock=clock)
    run.run()
    times = [t - start for t, _ in buses[BusName.VEHICLE].sent]
    assert times == [i * MS if i < 5 or i > 25 else 5 * MS + STALL_NS for i in range(40)]
    assert (run.sent, run.superseded, run.late) == (40, 0, 19)
    assert run.lateness_ns.max() == STALL_NS


def test_after_a_long_stall_only_the_newest_are_sent_and_no_change_is_lost():
    start = GRID_NS
    rows = sorted(
        [(i * 10 * MS, can_id) for i in range(100) for can_id in (PEDAL, WHEEL)]
        + [(i * 100 * MS, BATTERY) for i in range(10)]
        + [(310 * MS, FAULT, "bench", b"on......"), (320 * MS, FAULT, "bench", b"off.....")]
    )
    clock = StallingClock(start + 305 * MS, start + 605 * MS)
    run, buses = replay(log(*rows), clock=clock)
    run.run()
    sent = buses[BusName.VEHICLE].sent
    woken = [frame.can_id for t, frame in sent if t == start + 605 * MS]
    assert woken == [PEDAL, WHEEL, PEDAL, WHEEL, BATTERY]  # of 590 ms and of 600 ms
    changes = [frame.data for t, frame in buses[BusName.BENCH].sent if t == start + 605 * MS]
    assert changes == [b"on......", b"off....."]
    after = [t - start for t, frame in sent if frame.can_id == PEDAL and t > start + 605 * MS]
    assert after == [i * 10 * MS for i in range(61, 100)]
    assert run.superseded == 28 + 28 + 2  # of 30 cycles all but two, of 3 battery frames all but one
    assert run.sent + run.superseded == len(rows)
    assert run.duration_ns == 990 * MS


def test_who_is_live_is_heard_before_the_start():
    clock = VirtualClock()
    live = [(LISTEN_NS - 2 * MS, Frame(BusName.VEHICLE, BATTERY, bytes(8)))]
    run, _ = replay(log((0, PEDAL), (1, BATTERY)), "plant", clock=clock, incoming=live)
    with pytest.raises(ReplayError, match=r"0x120 \(BATTERY_STATUS of BATTERY\) on the vehicle bus"):
        run.listen()


def test_the_listener_is_no_intruder():
    others = [(0, Frame(BusName.VEHICLE, DEMAND, bytes(8))), (0, Frame(BusName.BENCH, PEDAL, bytes(8)))]
    run, buses = replay(log((0, PEDAL), (0, DEMAND)), "plant", incoming=others)
    run.listen()
    run.run()
    assert (ids(buses), run.intruders, run.refused) == ([PEDAL], [], {})


def test_who_comes_in_during_the_replay_gets_all_messages_of_his_node():
    rows = [(i * 10 * MS, can_id) for i in range(10) for can_id in (PEDAL, 0xE0, WHEEL)]  # 0xE0: STEERING of DRIVER
    clock = VirtualClock()
    live = [(GRID_NS + 45 * MS, Frame(BusName.VEHICLE, PEDAL, bytes(8)))]
    run, buses = replay(log(*rows), "plant", clock=clock, incoming=live)
    run.run()
    assert [str(i) for i in run.intruders] == ["0xA0 (BRAKE_PEDAL of DRIVER) on the vehicle bus"]
    assert {i.message: n for i, n in run.refused.items()} == {"BRAKE_PEDAL": 5, "STEERING": 5}
    assert [ids(buses).count(i) for i in (PEDAL, 0xE0, WHEEL)] == [5, 5, 10]


def test_with_everybody_live_it_ends_at_once():
    rows = [(i * 10 * MS, PEDAL) for i in range(1000)]
    live = [(GRID_NS + 45 * MS, Frame(BusName.VEHICLE, PEDAL, bytes(8)))]
    clock = VirtualClock()
    run, _ = replay(log(*rows), clock=clock, incoming=live)
    run.run()
    assert (run.sent, sum(run.refused.values())) == (5, 995)
    assert clock.now_ns() < 2 * GRID_NS


def test_an_unknown_identifier_takes_nobody_else_with_it():
    rows = [(i * 10 * MS, can_id) for i in range(4) for can_id in (0x700, 0x701)]
    live = [(GRID_NS + 15 * MS, Frame(BusName.VEHICLE, 0x700, b""))]
    run, buses = replay(log(*rows), incoming=live)
    run.run()
    assert [ids(buses).count(i) for i in (0x700, 0x701)] == [2, 4]


def test_a_stop_ends_it_within_a_gap_of_the_log():
    clock = VirtualClock()
    recording = log((0, PEDAL), (3_600_000 * MS, PEDAL))
    run, _ = replay(recording, clock=clock, stopped=lambda: clock.now_ns() > GRID_NS + 500 * MS)
    run.run()
    assert run.sent == 1
    assert clock.now_ns() <= GRID_NS + 520 * MS


def test_link_events_are_counted():
    events = [(GRID_NS, LinkEvent(BusName.VEHICLE, LinkState.TX_OVERFLOW, 0, n)) for n in (3, 4)]
    run, _ = replay(log((0, PEDAL), (10 * MS, PEDAL)), incoming=events)
    run.run()
    assert run.link_events == {LinkState.TX_OVERFLOW: 7}


def test_stamps_that_run_backwards_are_put_in_order():
    chosen = select(log((20, 0x1), (10, 0x2), (20, 0x3)))
    assert chosen.time_ns.tolist() == [0, 10, 10]
    assert [chosen.identities[code].can_id for code in chosen.code] == [0x2, 0x1, 0x3]
    assert chosen.time_ns.dtype == np.int64


FOREIGN = parse_database(
    """BU_: ENGINE GEARBOX
BO_ 256 RPM: 8 ENGINE
 SG_ RPM : 0|16@1+ (1,0) [0|0] "" GEARBOX
BO_ 512 GEAR: 2 GEARBOX
 SG_ GEAR : 0|8@1+ (1,0) [0|0] "" ENGINE
"""
)


@pytest.mark.parametrize(
    ("role", "ids"), [("DRIVER", [PEDAL]), ("EHB,DRIVER", [PEDAL, 0xD0]), ("ECU", [DEMAND]), ("EHB", [0xD0])]
)
def test_nodes_of_our_database_are_roles(role, ids):
    rows = [(i, can_id) for i, can_id in enumerate((PEDAL, DEMAND, 0xD0, 0x700))]
    assert [i.can_id for i in select(log(*rows), role).identities] == sorted(ids)


def test_nodes_of_a_foreign_database_are_roles():
    recording = log((0, 0x100, "can0"), (1, 0x200, "can0", b"ab"), (2, 0x200, "can0", b"abc"), (3, 0x300, "can0"))
    chosen = select(recording, "GEARBOX", databases=Databases(FOREIGN))
    assert [str(i) for i in chosen.identities] == ["0x200 (GEAR of GEARBOX) on the vehicle bus"]
    assert chosen.left_out == {"not of GEARBOX": 2, "of a length that is not the DBC's": 1}
    assert not chosen.identities[0].on_change  # the database states no cycle time at all
    with pytest.raises(ReplayError, match=r"no node NOBODY sends anything .*expected all, nodes of ENGINE, GEARBOX"):
        select(recording, "GEARBOX,NOBODY", databases=Databases(FOREIGN))
    with pytest.raises(ReplayError, match=r"no node NOBODY .* expected all, plant, ecu, or nodes of .*DRIVER"):
        select(recording, "NOBODY")


def test_channels_go_where_the_map_says_and_are_kept_apart():
    recording = log((0, 0x100, "can0"), (1, 0x100, "can1"), (2, 0x100, "can2"), (10 * MS, 0x100, "can1"))
    live = [(GRID_NS + 5 * MS, Frame("loopback:b", 0x100, bytes(8)))]  # on one of the two
    run, buses = replay(recording, channel_map={"can0": "vehicle", "can1": "loopback:b"}, incoming=live)
    run.run()
    assert ids(buses) == [0x100]
    assert ids(buses, "loopback:b") == [0x100]
    assert [str(i) for i in run.intruders] == ["0x100 on loopback:b"]
    assert [(i.bus, n) for i, n in run.refused.items()] == [("loopback:b", 1)]


def test_a_span_of_the_log_begins_at_once():
    recording = log(*((i * 10 * MS, PEDAL) for i in range(100)))
    span = Choice(begin=Moment(200 * MS, True), end=Moment(250 * MS, True))
    run, buses = replay(recording, choice=span)
    run.run()
    assert [t - GRID_NS for t, _ in buses[BusName.VEHICLE].sent] == [i * 10 * MS for i in range(6)]
    assert select(recording, choice=span).left_out == {"outside --from and --to": 94}
    with pytest.raises(ReplayError, match=r"nothing to send .*100 outside --from and --to"):
        select(recording, choice=Choice(begin=Moment(5_000 * MS, True)))


def test_long_pauses_are_shortened_and_short_ones_kept():
    recording = log(*((t * MS, PEDAL) for t in (0, 10, 5_010, 5_020, 9_020)))
    chosen = select(recording, max_gap_ns=100 * MS)
    assert chosen.time_ns.tolist() == [t * MS for t in (0, 10, 110, 120, 220)]
    assert (chosen.gaps, chosen.cut_ns) == (2, 8_800 * MS)


def test_a_loop_goes_on_without_drift_at_its_place_between_the_ticks():
    recording = log((0, PEDAL), (3 * MS, WHEEL), (20 * MS, PEDAL))
    clock = VirtualClock()
    run, buses = replay(recording, "plant", clock=clock, loop=True, stopped=lambda: clock.now_ns() > 2 * GRID_NS)
    run.run()
    times = [t - GRID_NS for t, _ in buses[BusName.VEHICLE].sent]
    assert times == [k * 30 * MS + t for k in range(4) for t in (0, 3 * MS, 20 * MS)][: len(times)]
    assert run.rounds == 3
    assert len(run.lateness_ns) == 3  # bounded, however long it runs


def test_rounds_that_a_stall_ate_are_not_caught_up():
    clock = StallingClock(GRID_NS + 35 * MS, GRID_NS + 1_000 * MS)
    run, buses = replay(log((0, PEDAL)), clock=clock, loop=True, stopped=lambda: clock.now_ns() >= GRID_NS + 1_030 * MS)
    run.run()
    times = [(t - GRID_NS) // MS for t, _ in buses[BusName.VEHICLE].sent]
    assert times[:4] == [0, 10, 20, 30]
    assert times[4:] in (
        [1_000, 1_000, 1_010, 1_020, 1_030],
        [1_000, 1_010, 1_020, 1_030],
        [1_000, 1_000, 1_010, 1_020],
    )
    assert run.superseded >= 94


@pytest.mark.parametrize("stamp_ns", [0, 700 * MS])
def test_it_starts_at_the_frame_that_is_waited_for(stamp_ns):
    clock = VirtualClock()
    cues = [(at, Frame(BusName.BENCH, 0x55, b"", stamp_ns and at)) for at in (100 * MS, 700 * MS, 710 * MS)]
    run, buses = replay(log((0, PEDAL), (0, TRUTH, "bench")), clock=clock, incoming=cues, wait_for=0x55)
    run.listen()  # the one at 100 ms came before anybody waited
    run.wait()
    run.run()
    assert [t for t, _ in buses[BusName.VEHICLE].sent] == [700 * MS + AFTER_CUE_NS]


def test_what_the_replay_sends_is_not_waited_for():
    with pytest.raises(ReplayError, match=r"waits for 0xA0 \(BRAKE_PEDAL of DRIVER\).*itself would send"):
        replay(log((0, PEDAL)), wait_for=PEDAL)


def test_somebody_who_comes_while_it_waits_keeps_it_from_starting():
    live = [(500 * MS, Frame(BusName.VEHICLE, PEDAL, bytes(8)))]
    run, buses = replay(log((0, PEDAL)), incoming=live, wait_for=0x55)
    run.listen()
    with pytest.raises(ReplayError, match="somebody already sends 0xA0"):
        run.wait()
    assert ids(buses) == []
