import pytest

from dbc.contract import encode, spec_of
from dbc.e2e import Checker, Status
from dbc.frame import BusName
from dbc.messages import BrakePedal, EhbPressureFront, EhbState
from hil.faults.fault import FaultError
from hil.faults.frames import Sender, protected


def test_a_frame_is_what_its_sender_would_send():
    frame = protected("BRAKE_PEDAL", 7, {"PEDAL_TRAVEL_1": 0.5, "pedal_travel_2": 0.25})
    assert (frame.bus, frame.can_id, frame.data) == (BusName.VEHICLE, 160, encode(BrakePedal(0.5, 0.25), 7))
    frame = protected("EHB_PRESSURE_FRONT", 0, {"PRESSURE_FL": 1e5, "EHB_STATE_FRONT": 1})
    assert frame.data == encode(EhbPressureFront(1e5, None, EhbState.OWN_PEDAL_MAP), 0)
    assert protected("EHB_PRESSURE_FRONT", 0, {}).data == encode(EhbPressureFront(None, None, EhbState.DEMAND), 0)
    assert protected("FAULT_COMMAND", 0, {"FAULT": 1}).bus is BusName.BENCH


def test_a_sender_counts_and_keeps_its_cycle():
    sender = Sender("BATTERY_STATUS", {"STATE_OF_CHARGE": 0.5}, counter=13)
    frames = [(now, f) for now in range(0, 1_000_000_000, 10_000_000) for f in sender.step(now, [])]
    cycle_ns = frames[1][0] - frames[0][0]
    assert [now for now, _ in frames] == list(range(0, 1_000_000_000, cycle_ns))
    assert cycle_ns > 10_000_000
    assert [f.data[1] & 15 for _, f in frames[:4]] == [13, 14, 0, 1]
    pedal = Sender("BRAKE_PEDAL", {"PEDAL_TRAVEL_1": 0.1, "PEDAL_TRAVEL_2": 0.1})
    checker = Checker(spec_of(BrakePedal).data_id, 8)
    found = [checker.check(pedal.next(PEDAL_TRAVEL_1=0.01 * k).data) for k in range(40)]
    assert set(found[1:]) == {Status.OK}
    assert spec_of(BrakePedal).decode(pedal.next().data).pedal_travel_1 == pytest.approx(0.39)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: protected("BRAKE_PEDL", 0, {}), "no message 'BRAKE_PEDL'; did you mean 'BRAKE_PEDAL'"),
        (lambda: protected("BRAKE_PEDAL", 0, {"PEDAL_TRAVEL_3": 1.0}), "did you mean 'PEDAL_TRAVEL_"),
        (lambda: protected("BRAKE_PEDAL", 15, {}), "counter: expected 0 to 14"),
        (lambda: Sender("BRAKE_PEDAL", {"X": 1.0}), "no signal 'X'"),
    ],
)
def test_what_is_not_known_is_refused(make, says):
    with pytest.raises(FaultError, match=says):
        make()
