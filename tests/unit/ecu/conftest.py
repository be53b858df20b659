import math
from importlib import resources

import pytest

from dbc.bench_messages import StimulusEcu
from dbc.contract import spec_of
from dbc.exchange import Transmitter
from dbc.frame import Frame
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorDemandFront,
    MotorDemandRear,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from ecu.law.types import Brake, Health, Inputs, Source
from ecu.node import EcuNode
from ecu.parameters.ecu import EcuParameters
from hil.scenario.parameters import load_set

TICK_NS = 10_000_000


@pytest.fixture(scope="session")
def parameters() -> EcuParameters:
    return load_set(resources.files("ecu.parameters") / "paper_ecu.toml", EcuParameters)


@pytest.fixture
def good_inputs() -> Inputs:
    """A healthy car at 20 m/s, 60 % pedal."""
    return Inputs(
        pedal_1=0.6,
        pedal_2=0.6,
        wheel_speed_rad_s=(65.0, 65.0, 65.0, 65.0),
        acceleration_x_mps2=-0.2,
        acceleration_y_mps2=0.0,
        yaw_rate_rad_s=0.0,
        pressure_pa=(0.0, 0.0, 0.0, 0.0),
        brake=(Brake.DEMAND, Brake.DEMAND),
        motor_current_a=(0.0, 0.0, 0.0, 0.0),
        motor_available_nm=(700.0, 700.0, 700.0, 700.0),
        motor_failed=(False, False, False, False),
        steering_wheel_angle_rad=0.0,
        charge_power_w=200e3,
        blending_factor=math.nan,
        link_down=False,
        another_sends=False,
        health=(Health(0.0, True, 0),) * len(Source),
    )


class Car:
    """Sensor frames of a car whose values a test sets; messages can be silenced by type."""

    def __init__(self) -> None:
        self.pedal: tuple[float | None, float | None] = (0.6, 0.6)
        self.wheel_speed = 65.0
        self.failed_wheels: set[int] = set()
        self.ehb_state = EhbState.DEMAND
        self.pressure_fl_pa = 0.0
        self.blending: float | None = None
        self.charge_power_w: float | None = 200e3
        self.available_nm = 700.0
        self.current_a = [0.0, 0.0, 0.0, 0.0]  # as demanded, 1.75 Nm/A
        self.silent: set[type] = set()
        self.transmitter = Transmitter()

    def follow(self, sent: list[Frame]) -> None:
        """Give the motor torques that were sent."""
        for frame in sent:
            for axle, kind in enumerate((MotorDemandFront, MotorDemandRear)):
                spec = spec_of(kind)
                if (frame.bus, frame.can_id) == (spec.bus, spec.can_id):
                    self.current_a[2 * axle : 2 * axle + 2] = [(nm or 0.0) / 1.75 for nm in spec.decode(frame.data)]

    def frames(self, now_ns: int) -> list[Frame]:
        w = self.wheel_speed
        i = [0.0 if wheel in self.failed_wheels else current for wheel, current in enumerate(self.current_a)]
        state = [MotorState.FAILED if k in self.failed_wheels else MotorState.OK for k in range(4)]
        messages = [
            BrakePedal(*self.pedal),
            WheelSpeedFront(w, w),
            WheelSpeedRear(w, w),
            BodyMotion(-0.2, 0.0, 0.0),
            EhbPressureFront(self.pressure_fl_pa, 0.0, self.ehb_state),
            EhbPressureRear(0.0, 0.0, self.ehb_state),
            MotorStatusFront(i[0], self.available_nm, state[0], i[1], self.available_nm, state[1]),
            MotorStatusRear(i[2], self.available_nm, state[2], i[3], self.available_nm, state[3]),
            Steering(0.0),
            BatteryStatus(0.5, self.charge_power_w),
            StimulusEcu(self.blending),
        ]
        return self.transmitter.frames(now_ns, [m for m in messages if type(m) not in self.silent])


class Rig:
    """ECU and a `Car`, stepped together; frames arrive one tick after they were sent."""

    def __init__(self, parameters: EcuParameters) -> None:
        self.car, self.node, self.tick, self.waiting = Car(), EcuNode(parameters), 0, []

    def step(self, ticks: int = 1, extra: list | None = None) -> list[Frame]:
        sent: list[Frame] = []
        for _ in range(ticks):
            now = self.tick * TICK_NS
            sent = self.node.step(now, [*self.waiting, *(extra or [])])
            self.waiting = self.car.frames(now)
            self.car.follow(sent)
            self.tick += 1
        return sent


@pytest.fixture
def rig(parameters: EcuParameters) -> Rig:
    return Rig(parameters)


@pytest.fixture
def normal_rig(rig: Rig) -> Rig:
    """Stepped until NORMAL."""
    rig.step(130)
    assert rig.node.memory.modes.mode == 1
    return rig
