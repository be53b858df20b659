"""The controller between communication points: the same as the controller's node, on a bus and with signals."""

import numpy as np
import pytest
from ecu_alone import PARAMETERS, Alone, on_bus, values

from dbc.contract import contract
from dbc.frame import BusName, Frame
from ecu.node import SENT
from hil.fmu.ecu_unit import BUS_NOTIFICATIONS, EcuUnit
from hil.fmu.ls_bus import FormatError, Transmit, decode, encode_all
from hil.fmu.plant_unit import StateError
from hil.fmu.variables import BOOLEANS

SPEC = contract(BusName.VEHICLE).by_id


def with_signals(pedal=0.5, one=None):
    if one is None:
        one = EcuUnit(PARAMETERS, on_bus=False)
        one.preview()
        one.initialise()
    for name, value in zip(*values(pedal), strict=True):
        reference = one.table.references[name]
        if reference < one.table.reals.size:
            one.table.reals[reference] = value
        else:
            one.table.integers[one.table.integer_indices([name])] = int(value)
    return one


def outputs(one):
    return {v.name: one.table[v.name] for v in one.table.variables if v.causality == "output"}


def test_with_signals_it_does_what_the_node_does_with_their_frames():
    one, alone = with_signals(), Alone()
    for tick in range(1, 111):  # it asks for something a second after all is well
        alone.now_ns = tick * 10_000_000
        sent = alone.tick(alone.frames())
        one.advance_to(tick * 0.01)
    for frame in sent:
        spec = SPEC.get(frame.can_id)
        if frame.bus is BusName.VEHICLE and spec.type in SENT:
            for field, value in zip(spec.fields, spec.decode(frame.data), strict=True):
                told = one.table[f"{spec.name}.{field.signal}"]
                assert told == value if value is not None else np.isnan(told)
    assert one.table["EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL"] > 1e6


@pytest.mark.parametrize("step_ms", [10, 32])
def test_the_results_do_not_hang_on_the_importers_step(step_ms):
    fine, coarse = with_signals(), with_signals()
    for k in range(1, 641):
        fine.advance_to(k * 1e-3)
    for k in range(1, 640 // step_ms + 1):
        coarse.advance_to(k * step_ms * 1e-3)
    assert outputs(fine) == pytest.approx(outputs(coarse), abs=0.0, nan_ok=True)


def drive_on_bus(one, ticks, first=1):
    """Frames each 10 ms by events; what it says."""
    alone, said = Alone(), []
    for tick in range(1, first + ticks):
        alone.now_ns = tick * 10_000_000 - 5_000_000
        frames = alone.frames()
        if tick < first:
            continue
        one.event(encode_all([Transmit(f.can_id, f.data) for f in frames]))
        one.advance_to(tick * 0.01)
        said.append(one.outgoing)
    return said


def test_on_a_bus_it_sends_the_nodes_frames_byte_for_byte():
    said = drive_on_bus(on_bus(), 110)
    alone = Alone()
    for tick, data in enumerate(said, start=1):
        alone.now_ns = tick * 10_000_000 - 5_000_000
        frames = alone.frames()
        alone.now_ns = tick * 10_000_000
        sent = [f for f in alone.tick(frames) if f.bus is BusName.VEHICLE]
        assert list(decode(data)) == [Transmit(f.can_id, f.data) for f in sent]
    demands = [SPEC[op.can_id].decode(op.data) for op in decode(said[-1]) if op.can_id == 0xA8]
    assert demands[0].pressure_demand_fl_pa > 1e6


def test_nonsense_on_the_bus_is_answered_at_the_same_event():
    one = on_bus()
    one.event(b"\x99" + bytes(9))
    assert list(decode(one.outgoing)) == [FormatError(b"\x99" + bytes(9))]
    one.event(b"")
    assert one.outgoing == b""


@pytest.mark.parametrize("bus", [False, True])
def test_a_step_done_again_gives_the_same_bits_and_a_fresh_instance_goes_on_from_a_state(bus):
    def on(one, ticks, first):
        if bus:
            return drive_on_bus(one, ticks, first)
        with_signals(0.8, one).advance_to((first + ticks - 1) * 0.01)
        return outputs(one)

    one = on_bus() if bus else with_signals()
    if bus:
        one.table.integers[one.table.references[BUS_NOTIFICATIONS] - BOOLEANS] = 0
        drive_on_bus(one, 30)
    else:
        one.advance_to(0.3)
    state = one.state()
    first = on(one, 20, 31)
    after = one.state()
    on(one, 20, 51)
    for each in (one, EcuUnit(PARAMETERS, bus)):
        each.restore(state)
        assert each.state() == state
        again = on(each, 20, 31)
        assert again == first if bus else again == pytest.approx(first, abs=0.0, nan_ok=True)
        assert each.state() == after


def test_its_log_grows_by_what_is_new_alone():
    one = with_signals()
    one.advance_to(1.0)
    size = len(one.state())
    one.advance_to(9.0)
    assert len(one.state()) == size


def test_other_bytes_are_no_state():
    with pytest.raises(StateError, match="expected one of this FMU"):
        on_bus().restore(b"bbecu001" + bytes(8))


def test_frames_with_other_lengths_and_extended_identifiers_come_through():
    one = on_bus()
    one.event(encode_all([Transmit(0xA0, b"\x01"), Transmit(0x1FFFFFFF, b"", extended=True)]))
    one.advance_to(0.01)
    assert Frame(BusName.VEHICLE, 0xA0, b"\x01") not in one._can.inbox(0)  # taken by the tick
    assert one.outgoing
