"""brake.dbc and bench.dbc as a contract: complete, consistent, within the bus load, and agreeing with the types."""

import cantools
import pytest

from dbc import contract as module
from dbc.codec import CodecError
from dbc.contract import contract, database_text, dbc_name, spec_of
from dbc.frame import BusName
from dbc.messages import BRAKE_MESSAGES, Fault

DATABASES = {bus: cantools.database.load_string(database_text(bus), database_format="dbc") for bus in BusName}
VEHICLE = DATABASES[BusName.VEHICLE]
CAR = {"ECU", "EHB", "IWM", "BATTERY", "SENSORS", "DRIVER"}
CYCLES_MS = {
    "BRAKE_PEDAL": 10, "STEERING": 10, "BODY_MOTION": 10, "WHEEL_SPEED_FRONT": 10, "WHEEL_SPEED_REAR": 10,
    "EHB_PRESSURE_FRONT": 10, "EHB_PRESSURE_REAR": 10, "MOTOR_STATUS_FRONT": 10, "MOTOR_STATUS_REAR": 10,
    "BATTERY_STATUS": 100, "EHB_DEMAND_FRONT": 10, "EHB_DEMAND_REAR": 10, "MOTOR_DEMAND_FRONT": 10,
    "MOTOR_DEMAND_REAR": 10, "BRAKE_STATUS": 20, "BRAKE_ESTIMATE_FRONT": 20, "BRAKE_ESTIMATE_REAR": 20,
    "BRAKE_TROUBLE_CODE": 100,
}  # fmt: skip


def test_messages_and_cycle_times():
    assert {m.name: m.cycle_time for m in VEHICLE.messages} == CYCLES_MS
    assert {node.name for node in VEHICLE.nodes} == CAR


@pytest.mark.parametrize("message", [m for d in DATABASES.values() for m in d.messages], ids=lambda m: m.name)
def test_every_message_and_signal_is_described(message):
    assert message.comment
    assert len(message.senders) == 1
    assert message.frame_id < 0x800
    assert not message.is_extended_frame
    assert message.length == 8
    for signal in message.signals:
        assert signal.comment, signal.name
        assert signal.minimum is not None, signal.name
        assert signal.receivers, signal.name


@pytest.mark.parametrize("message", VEHICLE.messages, ids=lambda m: m.name)
def test_every_vehicle_message_is_protected(message):
    names = [s.name for s in message.signals]
    assert names[:2] == ["CRC", "ALIVE_COUNTER"]
    crc, counter = message.signals[:2]
    assert (crc.start, crc.length) == (0, 8)
    assert (counter.start, counter.length) == (8, 4)
    assert message.dbc.attributes["E2EDataID"].value


def test_messages_a_node_acts_on_over_the_bench_bus_are_protected():
    for spec in contract(BusName.BENCH).by_id.values():
        assert (spec.data_id is not None) == bool(spec.receivers & {"PLANT", "ECU"}), spec.name


def test_data_ids_are_unique():
    ids = [s.data_id for bus in BusName for s in contract(bus).by_id.values() if s.data_id is not None]
    assert len(ids) == len(set(ids))


def test_worst_case_load_is_below_half():
    """Stuffed classical 11-bit frame with intermission: 47 + 8 n + floor((34 + 8 n - 1) / 4) bits (Tindell 1994)."""
    spec = contract(BusName.VEHICLE)
    assert spec.bit_rate == 500_000
    bits_per_s = sum(
        (47 + 8 * s.length + (34 + 8 * s.length - 1) // 4) / (s.cycle_ns * 1e-9) for s in spec.by_id.values()
    )
    assert bits_per_s / spec.bit_rate < 0.5


def test_identifiers_order_by_priority():
    """Pedal first, then demands, measurements, and what is only reported."""
    order = [s.name for s in sorted(contract(BusName.VEHICLE).by_id.values(), key=lambda s: s.can_id)]
    groups = ["BRAKE_PEDAL", "EHB_DEMAND", "MOTOR_DEMAND", "WHEEL_SPEED", "BODY_MOTION", "EHB_PRESSURE", "MOTOR_STATUS"]
    positions = [min(i for i, name in enumerate(order) if name.startswith(group)) for group in groups]
    assert positions == sorted(positions)
    assert [name.rpartition("_")[0] for name in order[-3:]] == ["BRAKE_ESTIMATE", "BRAKE_ESTIMATE", "BRAKE_TROUBLE"]


def test_the_ecu_receives_no_truth():
    for spec in contract(BusName.BENCH).by_id.values():
        if spec.name.startswith("TRUTH"):
            assert spec.receivers == {"BENCH"}


def test_fault_bits_agree_with_the_value_table():
    table = VEHICLE.get_message_by_name("BRAKE_STATUS").get_signal_by_name("ACTIVE_FAULTS").choices
    assert {raw: str(name) for raw, name in table.items()} == {f.value: f.name for f in Fault if f}


@pytest.mark.parametrize("bus", list(BusName))
def test_enums_agree_with_value_tables(bus):
    for spec in contract(bus).by_id.values():
        message = DATABASES[bus].get_message_by_name(spec.name)
        for field in spec.fields:
            choices = message.get_signal_by_name(field.signal).choices or {}
            if field.enum is not None:
                assert {raw: str(name) for raw, name in choices.items()} == {e.value: e.name for e in field.enum}


@pytest.fixture
def altered(monkeypatch):
    """Load the vehicle contract from altered text."""

    def load(old, new):
        text = database_text(BusName.VEHICLE)
        assert old in text
        monkeypatch.setattr(module, "database_text", lambda bus: text.replace(old, new))
        return contract.__wrapped__(BusName.VEHICLE)

    return load


def test_a_renamed_signal_is_refused(altered):
    with pytest.raises(CodecError, match=r"WHEEL_SPEED_FRONT.*wheel_speed_fl"):
        altered("WHEEL_SPEED_FL", "WHEEL_VELOCITY_FL")


def test_a_changed_unit_is_refused(altered):
    with pytest.raises(CodecError, match="pressure_demand_fl_w"):
        altered('[0|250] "bar" EHB', '[0|250] "kW" EHB')


def test_a_missing_message_is_refused(altered):
    with pytest.raises(CodecError, match="STEERING"):
        altered("BO_ 224 STEERING:", "BO_ 224 HELM:")


def test_a_changed_factor_is_followed(altered):
    doubled = altered("STEERING_WHEEL_ANGLE : 12|16@1- (0.0005,0)", "STEERING_WHEEL_ANGLE : 12|16@1- (0.001,0)")
    steering = next(s for s in doubled.by_id.values() if s.name == "STEERING")
    payload = steering.encode((1.0,))
    assert steering.decode(payload) == (1.0,)
    assert spec_of(steering.type).decode(bytes(payload))[0] == pytest.approx(0.5)


def test_names_follow_one_rule():
    assert {dbc_name(t) for t in BRAKE_MESSAGES} == {m.name for m in VEHICLE.messages}
