"""The plant behind its buses: waits for demands, brakes, survives their loss."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from dbc.bench_messages import (
    FaultCommand,
    FaultParameter,
    ManoeuvreState,
    PhysicalFault,
    PlantReception,
    StimulusDriver,
    StimulusRoad,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    TruthMotion,
    TruthPadFriction,
    TruthWheelTorque,
)
from dbc.contract import contract
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbDemandFront,
    EhbDemandRear,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorDemandFront,
    MotorDemandRear,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    WheelSpeedFront,
)
from plant.manoeuvre import DirectDemands, Manoeuvre, SpeedPhase
from plant.node import SENDERS, PlantNode

TICK_NS = 10_000_000
READ = (
    BrakePedal,
    BatteryStatus,
    BodyMotion,
    WheelSpeedFront,
    EhbPressureFront,
    EhbPressureRear,
    MotorStatusFront,
    MotorStatusRear,
    TruthMotion,
    TruthWheelTorque,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    PlantReception,
    TruthPadFriction,
)
STOP = Manoeuvre(20.0, 20.0, pedal=((0.0, 0.0), (0.2, 0.6)))


class Rig:
    """A plant and a controller that asks for constants once the manoeuvre runs."""

    def __init__(self, node: PlantNode, pressure_pa: float = 0.0, motor_nm: float = 0.0) -> None:
        self.node, self.pressure_pa, self.motor_nm = node, pressure_pa, motor_nm
        self.read = Receiver(READ)
        self.send = Transmitter()
        self.now_ns = -TICK_NS
        self.silent = False
        self.extra: list = []
        self._inbox: list[Frame] = []

    def tick(self) -> None:
        self.now_ns += TICK_NS
        frames = self.node.step(self.now_ns, self._inbox)
        self.read.accept(self.now_ns, frames)
        running = self.node.manoeuvre_start_ns is not None
        p, t = (self.pressure_pa, self.motor_nm) if running else (0.0, 0.0)
        demands = [EhbDemandFront(p, p), EhbDemandRear(p, p), MotorDemandFront(t, t), MotorDemandRear(t, t)]
        self._inbox = self.send.frames(self.now_ns, self.extra if self.silent else demands + self.extra)

    def run(self, seconds: float) -> Iterator["Rig"]:
        for _ in range(round(seconds * 1e9 / TICK_NS)):
            self.tick()
            yield self

    def for_seconds(self, seconds: float) -> None:
        for _ in self.run(seconds):
            pass

    def until(self, condition: Callable[[], bool], limit_s: float = 30.0) -> None:
        for _ in self.run(limit_s):
            if condition():
                return
        pytest.fail(f"did not happen within {limit_s} s")

    def __getitem__(self, kind: type):
        return self.read.latest(kind)


@pytest.fixture
def make(paper_car):
    def build(manoeuvre: Manoeuvre = STOP, pressure_pa: float = 0.0, motor_nm: float = 0.0, **more) -> Rig:
        return Rig(PlantNode(paper_car, manoeuvre, 1, **more), pressure_pa, motor_nm)

    return build


def test_stop_from_72_km_h(make):
    rig = make(pressure_pa=34e5)
    rig.until(lambda: rig.node.state is ManoeuvreState.FINISHED)
    truth = rig[TruthMotion]
    assert abs(truth.speed_mps) < 0.02
    # v0^2 / 2a = 46 m at 4.35 m/s2 and 0.15 s to build the pressure
    assert 45.0 < truth.distance_m < 52.0
    assert truth.manoeuvre is ManoeuvreState.FINISHED


def test_holds_the_speed_until_ten_valid_demands(make):
    rig = make(STOP)
    rig.silent = True
    rig.for_seconds(1.0)
    assert rig.node.manoeuvre_start_ns is None
    assert rig[TruthMotion].speed_mps == pytest.approx(20.0, abs=0.02)
    assert rig[TruthMotion].manoeuvre is ManoeuvreState.HOLDING
    rig.silent = False
    rig.for_seconds(0.09)
    assert rig.node.manoeuvre_start_ns is None
    # the first frame establishes the sequence, the next ten are valid
    rig.for_seconds(0.05)
    assert rig.node.manoeuvre_start_ns == 1_110_000_000
    assert rig[TruthMotion].distance_m < 0.6


def test_starts_at_once_when_told(make):
    rig = make(replace(STOP, wait_for_demands=False))
    rig.tick()
    assert rig.node.manoeuvre_start_ns == 0


def test_lost_demand_never_releases_the_brake(make):
    rig = make(pressure_pa=50e5)
    rig.for_seconds(1.5)
    before = rig[EhbPressureFront].pressure_fl_pa
    rig.silent = True
    for _ in rig.run(0.5):
        assert rig[EhbPressureFront].pressure_fl_pa > before - 1e5
    assert rig[EhbPressureFront].ehb_state_front is EhbState.OWN_PEDAL_MAP
    assert rig[PlantReception].frames_lost == 0


def test_foot_off_releases_in_the_own_map(make):
    rig = make(replace(STOP, pedal=((0.0, 0.6), (1.5, 0.6), (1.6, 0.0))), pressure_pa=50e5)
    rig.for_seconds(1.0)
    rig.silent = True
    rig.for_seconds(1.5)
    assert rig[EhbPressureFront].pressure_fl_pa < 1e5


def test_motors_give_nothing_40_ms_after_the_last_demand(make):
    rig = make(motor_nm=-200.0)
    rig.for_seconds(1.0)
    assert rig[MotorStatusFront].current_fl_a < -100.0
    rig.silent = True
    rig.for_seconds(0.15)
    assert abs(rig[MotorStatusFront].current_fl_a) < 3.0


def test_dead_motor(make):
    rig = make(motor_nm=-200.0)
    rig.for_seconds(1.0)
    rig.extra = [FaultCommand(PhysicalFault.MOTOR_DEAD, 1, 0b0001)]
    rig.for_seconds(0.15)
    status = rig[MotorStatusFront]
    assert status.fault_fl is MotorState.FAILED
    assert status.torque_available_fl_nm == 0.0
    assert abs(status.current_fl_a) < 3.0
    assert status.fault_fr is MotorState.OK
    assert status.current_fr_a < -100.0
    rig.extra = [FaultCommand(PhysicalFault.MOTOR_DEAD, 0, 0b0001)]
    rig.for_seconds(0.15)
    assert rig[MotorStatusFront].current_fl_a < -100.0


def test_pads_have_the_share_of_their_friction_that_is_asked_for_or_half(make):
    rig = make(pressure_pa=20e5)
    rig.for_seconds(1.0)
    well, beside = rig[TruthPadFriction].pad_friction_fl, rig[TruthPadFriction].pad_friction_fr
    torque_nm = rig[TruthFrictionTorque].friction_torque_fl_nm
    for numbers, share in (([], 0.5), ([FaultParameter(77, 4, 25, -2)], 0.25), ([], 0.5)):
        rig.extra = [*numbers, FaultCommand(PhysicalFault.PAD_FRICTION, 1, 0b0001)]
        rig.for_seconds(0.01)
        rig.extra = []
        rig.for_seconds(0.05)
        assert rig[TruthPadFriction].pad_friction_fl == pytest.approx(share * well, rel=0.02)
        assert rig[TruthPadFriction].pad_friction_fr == pytest.approx(beside, rel=0.02)
        assert rig[TruthFrictionTorque].friction_torque_fl_nm == pytest.approx(share * torque_nm, rel=0.03)
    rig.extra = [FaultCommand(PhysicalFault.PAD_FRICTION, 0, 0b0001)]
    rig.for_seconds(0.05)
    assert rig[TruthFrictionTorque].friction_torque_fl_nm == pytest.approx(torque_nm, rel=0.03)


def test_a_battery_announces_before_it_refuses(make):
    rig = make(motor_nm=-200.0)
    rig.for_seconds(1.0)
    rig.extra = [FaultCommand(PhysicalFault.BATTERY_REFUSES_CHARGE, 1, 0)]
    rig.for_seconds(0.25)
    assert rig[BatteryStatus].charge_power_limit_w == 0.0
    assert rig[MotorStatusFront].current_fl_a < -100.0
    assert rig[MotorStatusFront].torque_available_fl_nm > 200.0
    rig.for_seconds(0.2)
    assert abs(rig[MotorStatusFront].current_fl_a) < 3.0
    assert rig[MotorStatusFront].torque_available_fl_nm == 0.0
    rig.extra = [FaultCommand(PhysicalFault.BATTERY_REFUSES_CHARGE, 0, 0)]
    rig.for_seconds(0.15)
    assert rig[BatteryStatus].charge_power_limit_w > 0.0
    assert rig[MotorStatusFront].current_fl_a < -100.0


def test_live_stimulus_overrides_pedal_and_road(make):
    rig = make(Manoeuvre(20.0, 20.0), pressure_pa=0.0)
    rig.for_seconds(0.5)
    assert rig[BrakePedal].pedal_travel_1 == pytest.approx(0.0, abs=0.005)
    rig.extra = [StimulusDriver(0.4, None, None), StimulusRoad(0.2, 0.2, None)]
    rig.pressure_pa = 100e5
    rig.for_seconds(1.0)
    assert rig[BrakePedal].pedal_travel_1 == pytest.approx(0.4, abs=0.005)
    assert -rig[TruthMotion].acceleration_mps2 < 2.5  # 0.2 of the dry friction
    rig.extra = []
    rig.for_seconds(1.0)
    assert rig[BrakePedal].pedal_travel_1 == pytest.approx(0.0, abs=0.005)


def test_speed_hold_drives_with_the_motors(make):
    rig = make(Manoeuvre(5.0, 20.0, speed_phases=(SpeedPhase(0.0, 20.0, 15.0),)))
    rig.for_seconds(8.0)
    assert rig[TruthMotion].speed_mps == pytest.approx(15.0, abs=0.05)


def test_direct_demands_need_no_controller(make):
    step = ((0.0, 0.0), (0.5, 0.0), (0.5, 20e5))
    none = ((0.0, 0.0),)
    direct = DirectDemands(pressure_pa=(step, step, none, none), motor_nm=(none,) * 4)
    rig = make(Manoeuvre(20.0, 20.0, direct=direct))
    rig.silent = True
    rig.for_seconds(1.5)
    assert rig[EhbPressureFront].pressure_fl_pa == pytest.approx(20e5, abs=0.5e5)


def test_plays_only_what_it_is_asked_to(make, paper_car):
    node = PlantNode(paper_car, STOP, 1, play=frozenset({"IWM", "SENSORS"}))
    sent = {frame.can_id for frame in node.step(0, []) if frame.bus is BusName.VEHICLE}
    assert sent == {spec.can_id for spec in contract(BusName.VEHICLE).sent_by("IWM", "SENSORS")}


def test_sends_every_message_of_its_senders_in_time(make):
    rig = make()
    sent: dict[int, int] = {}
    for k in range(100):
        for frame in rig.node.step(k * TICK_NS, []):
            if frame.bus is BusName.VEHICLE:
                sent[frame.can_id] = sent.get(frame.can_id, 0) + 1
    specs = contract(BusName.VEHICLE).sent_by(*SENDERS)
    assert sent == {spec.can_id: 1_000_000_000 // spec.cycle_ns for spec in specs}


def test_same_seed_same_frames_other_seed_other_noise(paper_car):
    def frames(seed: int) -> list[Frame]:
        node = PlantNode(paper_car, STOP, seed)
        return [frame for k in range(20) for frame in node.step(k * TICK_NS, [])]

    assert frames(1) == frames(1)
    assert frames(1) != frames(2)


def test_wheel_speed_is_zero_at_standstill(make):
    rig = make(pressure_pa=60e5)
    rig.until(lambda: rig.node.state is ManoeuvreState.FINISHED)
    assert rig[WheelSpeedFront].wheel_speed_fl_rad_s == 0.0


def test_demands_not_available_do_not_start_the_manoeuvre(make):
    rig = make()
    rig.silent = True
    rig.extra = [
        EhbDemandFront(None, None),
        EhbDemandRear(None, None),
        MotorDemandFront(None, None),
        MotorDemandRear(None, None),
    ]
    rig.for_seconds(0.5)
    assert rig.node.manoeuvre_start_ns is None
    assert rig[EhbPressureFront].ehb_state_front is EhbState.OWN_PEDAL_MAP
    rig.silent, rig.extra = False, []
    rig.for_seconds(0.12)
    assert rig.node.manoeuvre_start_ns is not None


def test_the_brake_comes_back_after_ten_demands_in_a_row(make):
    rig = make(pressure_pa=20e5)
    rig.for_seconds(1.0)
    rig.silent = True
    rig.for_seconds(0.2)
    rig.silent = False
    states = [rig[EhbPressureFront].ehb_state_front for _ in rig.run(0.12)]
    assert states.index(EhbState.DEMAND) in (10, 11)


def test_real_brakes_beside_the_plant(paper_car):
    """With the EHB elsewhere, its measured pressure brakes the car."""
    node = PlantNode(paper_car, replace(STOP, wait_for_demands=False), 1, play=SENDERS - {"EHB"})
    rig = Rig(node)
    rig.silent = True
    rig.extra = [EhbPressureFront(40e5, 40e5, EhbState.DEMAND), EhbPressureRear(40e5, 40e5, EhbState.DEMAND)]
    rig.for_seconds(1.0)
    assert rig[TruthMotion].acceleration_mps2 == pytest.approx(-5.2, abs=0.3)


def test_real_motors_beside_the_plant(paper_car):
    node = PlantNode(paper_car, replace(STOP, wait_for_demands=False, pedal=()), 1, play=SENDERS - {"IWM"})
    rig = Rig(node)
    rig.silent = True
    one = (-100.0, 500.0, MotorState.OK)
    rig.extra = [MotorStatusFront(*one, *one), MotorStatusRear(*one, *one)]
    rig.for_seconds(1.0)
    expected = -100.0 * paper_car.motor.torque_constant_nm_a
    assert rig[TruthWheelTorque].wheel_torque_fl_nm == pytest.approx(expected, abs=1.0)
    rig.extra = []
    rig.for_seconds(0.1)
    assert rig[TruthWheelTorque].wheel_torque_fl_nm == pytest.approx(0.0, abs=1.0)


def test_a_real_driver_beside_the_plant(paper_car):
    node = PlantNode(paper_car, STOP, 1, play=SENDERS - {"DRIVER"})
    rig = Rig(node)
    rig.silent = True
    rig.extra = [BrakePedal(0.5, 0.5)]
    rig.for_seconds(0.5)
    assert rig[EhbPressureFront].pressure_fl_pa > 5e5  # its own pedal map


@pytest.mark.parametrize(
    ("argument", "message"), [({"play": frozenset({"RADIO"})}, "RADIO"), ({"period_ns": 1}, "multiple")]
)
def test_refuses_what_it_cannot_be(paper_car, argument, message):
    with pytest.raises(ValueError, match=message):
        PlantNode(paper_car, STOP, 1, **argument)
