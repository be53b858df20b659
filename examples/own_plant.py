"""A vehicle of your own: a point mass on four wheels takes the plant's place.

    python examples/own_plant.py    # in virtual time
    brakebench run --without plant --bus loopback:demo & python examples/own_plant.py loopback:demo    # as a process

It sends what sensors, actuators, battery and driver of the car send. TRUTH_MOTION on the bench bus is what the bench
follows: manoeuvre holding, running, finished.
"""

import sys

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.exchange import Receiver, Transmitter
from dbc.frame import Frame, Received
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbDemandFront,
    EhbDemandRear,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from hil.bench.node_process import PLANT, serve
from hil.bench.result import measure
from hil.bench.virtual import simulate
from hil.scenario.scenario import load_scenario

MASS_KG, RADIUS_M, STEP_S = 1500.0, 0.32, 0.01
TORQUE_PER_PRESSURE = {"front": 2.0e-4, "rear": 0.85e-4}  # N m/Pa, one wheel
LAG_S = 0.05


class PointMass:
    """Speed from brake torque; pressures follow their demands with a lag; the pedal is pressed after half a second."""

    def __init__(self) -> None:
        self._receiver = Receiver((EhbDemandFront, EhbDemandRear))
        self._transmitter = Transmitter()
        self._speed_mps, self._distance_m, self._front_pa, self._rear_pa = 20.0, 0.0, 0.0, 0.0
        self._since_start_s = 0.0
        self._state = ManoeuvreState.HOLDING

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Every 10 ms: take the demands, move the car, send what its sensors see."""
        self._receiver.accept(now_ns, inbox)
        front, rear = self._receiver.latest(EhbDemandFront), self._receiver.latest(EhbDemandRear)
        if self._state is ManoeuvreState.HOLDING and front is not None and front.pressure_demand_fl_pa is not None:
            self._state = ManoeuvreState.RUNNING
        acceleration = self._move(front, rear) if self._state is not ManoeuvreState.HOLDING else 0.0
        pedal = min(max((self._since_start_s - 0.5) / 0.3, 0.0), 1.0) * 0.6
        wheel = self._speed_mps / RADIUS_M
        ok, follows = MotorState.OK, EhbState.DEMAND
        return self._transmitter.frames(
            now_ns,
            [
                BrakePedal(pedal, pedal),
                Steering(0.0),
                WheelSpeedFront(wheel, wheel),
                WheelSpeedRear(wheel, wheel),
                BodyMotion(acceleration, 0.0, 0.0),
                EhbPressureFront(self._front_pa, self._front_pa, follows),
                EhbPressureRear(self._rear_pa, self._rear_pa, follows),
                MotorStatusFront(0.0, 700.0, ok, 0.0, 700.0, ok),
                MotorStatusRear(0.0, 700.0, ok, 0.0, 700.0, ok),
                BatteryStatus(0.7, 80e3),
                TruthMotion(self._speed_mps, acceleration, self._distance_m, self._state),
            ],
        )

    def _move(self, front: EhbDemandFront | None, rear: EhbDemandRear | None) -> float:
        """One step of 10 ms; the acceleration, m/s2."""
        self._since_start_s += STEP_S
        front_pa = 0.0 if front is None else front.pressure_demand_fl_pa or 0.0
        rear_pa = 0.0 if rear is None else rear.pressure_demand_rl_pa or 0.0
        self._front_pa += (front_pa - self._front_pa) * STEP_S / LAG_S
        self._rear_pa += (rear_pa - self._rear_pa) * STEP_S / LAG_S
        torque = 2.0 * (TORQUE_PER_PRESSURE["front"] * self._front_pa + TORQUE_PER_PRESSURE["rear"] * self._rear_pa)
        moving = self._speed_mps > 0.0
        acceleration = -torque / RADIUS_M / MASS_KG if moving else 0.0
        self._distance_m += self._speed_mps * STEP_S
        self._speed_mps = max(self._speed_mps + acceleration * STEP_S, 0.0)
        if not moving:
            self._state = ManoeuvreState.FINISHED
        return acceleration


if __name__ == "__main__":
    if len(sys.argv) > 1:
        serve(PLANT, PointMass, sys.argv[1], say=print)
    else:
        result = measure(simulate(load_scenario("stop72"), plant=PointMass()))
        print(f"stopped within {result.stop_distance_m:.1f} m")
