"""Receiving and sending as every node does it."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.contract import encode, spec_of
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BatteryStatus, BrakeMode, BrakePedal, BrakeStatus, EhbDemandFront

MS = 1_000_000
PEDAL = BrakePedal(0.6, 0.6)


def pedal_frame(counter, travel=0.6):
    return Frame(BusName.VEHICLE, spec_of(BrakePedal).can_id, encode(BrakePedal(travel, travel), counter))


def test_first_usable_frame_is_the_second():
    receiver = Receiver([BrakePedal])
    receiver.accept(0, [pedal_frame(4)])
    assert receiver.latest(BrakePedal) is None
    receiver.accept(10 * MS, [pedal_frame(5)])
    assert receiver.latest(BrakePedal) == PEDAL
    assert receiver.age_ns(BrakePedal, 30 * MS) == 20 * MS
    assert receiver.counter(BrakePedal) == 5


def test_corrupt_and_foreign_frames_never_replace_a_message():
    receiver = Receiver([BrakePedal])
    receiver.accept(0, [pedal_frame(0), pedal_frame(1)])
    bad = pedal_frame(2, 0.1)
    others = [
        bad._replace(data=bytes([bad.data[0] ^ 1]) + bad.data[1:]),
        bad._replace(bus=BusName.BENCH),
        bad._replace(extended=True),
        bad._replace(data=b""),
        Frame(BusName.VEHICLE, 0x7FF, b"\x01"),
    ]
    receiver.accept(10 * MS, others)
    assert receiver.latest(BrakePedal) == PEDAL
    reception = receiver.receptions[BrakePedal]
    assert (reception.fresh, reception.bad_in_row, reception.valid_in_row) == (False, 2, 0)
    assert (receiver.corrupt, receiver.lost) == (2, 0)


def test_link_events_are_handed_on_for_one_tick():
    receiver = Receiver([BrakePedal])
    event = LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF)
    receiver.accept(0, [event, pedal_frame(0)])
    assert receiver.link_events == [event]
    receiver.accept(10 * MS, [])
    assert receiver.link_events == []


@pytest.mark.parametrize("period_ms", [1, 2, 5, 10, 20])
def test_cycle_times_hold_at_any_task_rate(period_ms):
    transmitter = Transmitter()
    status = BrakeStatus(BrakeMode.NORMAL, 0, 0.0, 0.0)
    sent = {}
    for tick in range(0, 1000, period_ms):
        outgoing = [EhbDemandFront(0.0, 0.0), status, BatteryStatus(0.5, 0.0)]
        for frame in transmitter.frames(tick * MS + 3 * MS, outgoing):
            sent.setdefault(frame.can_id, []).append(tick)
    for kind, cycle_ms in ((EhbDemandFront, 10), (BrakeStatus, 20), (BatteryStatus, 100)):
        ticks = sent[spec_of(kind).can_id]
        gaps = {b - a for a, b in itertools.pairwise(ticks[1:])}
        assert gaps == {max(cycle_ms, period_ms)}


def test_no_burst_after_a_late_tick():
    transmitter = Transmitter()
    counts = [len(transmitter.frames(t * MS, [EhbDemandFront(0.0, 0.0)])) for t in (0, 10, 75, 80, 90)]
    assert counts == [1, 1, 1, 1, 1]
    assert transmitter.frames(95 * MS, [EhbDemandFront(0.0, 0.0)]) == []


@given(st.lists(st.booleans(), min_size=20, max_size=80))
def test_a_receiver_follows_a_transmitter_through_losses(kept):
    transmitter, receiver = Transmitter(), Receiver([EhbDemandFront])
    in_row_lost = 0
    for tick, keep in enumerate([True, True, *kept]):
        frames = transmitter.frames(tick * 10 * MS, [EhbDemandFront(tick * 1e3, 0.0)])
        receiver.accept(tick * 10 * MS, frames if keep else [])
        if keep and tick >= 1 and in_row_lost <= 2 and receiver.receptions[EhbDemandFront].fresh:
            assert receiver.latest(EhbDemandFront).pressure_demand_fl_pa == pytest.approx(tick * 1e3)
        in_row_lost = 0 if keep else in_row_lost + 1
    assert receiver.corrupt == 0
