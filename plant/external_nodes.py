"""Real nodes beside the plant: the frames of a node that it does not play enter at that node's cut point."""

from collections.abc import Sequence

from dbc.contract import Message
from dbc.exchange import Receiver
from dbc.frame import Received
from dbc.messages import BrakePedal, EhbPressureFront, EhbPressureRear, MotorStatusFront, MotorStatusRear, Steering
from plant.demands import DEMAND_TIMEOUT_NS
from plant.layout import Vector
from plant.vectors import CUT, C, U

FRAMES_OF: dict[str, tuple[type[Message], ...]] = {
    "EHB": (EhbPressureFront, EhbPressureRear),
    "IWM": (MotorStatusFront, MotorStatusRear),
    "DRIVER": (BrakePedal, Steering),
}


class ExternalNodes:
    """What the nodes say that the plant does not play.

    Measured pressures and motor currents replace the simulated ones; the last pressure holds when its frames stop (a
    silent brake has not let go), the motor torque is then zero.
    """

    def __init__(self, play: frozenset[str], torque_constant_nm_a: float) -> None:
        self._away = [node for node in FRAMES_OF if node not in play]
        self._torque_constant = torque_constant_nm_a
        self._receiver = Receiver([kind for node in self._away for kind in FRAMES_OF[node]])

    def cut(self) -> Vector:
        """Cut points of the model (``CUT``)."""
        cut = CUT.zeros()
        for node, part in (("EHB", C.pressure), ("IWM", C.motor_torque)):
            if node in self._away:
                cut[part : part + 4] = 1.0
        return cut

    def accept(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take the inbox of a tick."""
        if self._away:
            self._receiver.accept(now_ns, inbox)

    def enter(self, now_ns: int, u: Vector) -> None:
        """Write the measured values into the inputs (``INPUT``)."""
        if "EHB" in self._away:
            for axle, kind in enumerate((EhbPressureFront, EhbPressureRear)):
                measured = self._receiver.latest(kind)
                for side in (0, 1):
                    if measured is not None and measured[side] is not None:
                        u[U.pressure_pa + 2 * axle + side] = max(float(measured[side] or 0.0), 0.0)
        if "IWM" in self._away:
            for axle, status in enumerate((MotorStatusFront, MotorStatusRear)):
                age = self._receiver.age_ns(status, now_ns)
                message = self._receiver.latest(status) if age is not None and age < DEMAND_TIMEOUT_NS else None
                for side in (0, 1):
                    current = None if message is None else message[3 * side]
                    u[U.motor_torque_nm + 2 * axle + side] = self._torque_constant * float(current or 0.0)

    def pedal_travel(self) -> float | None:
        """Travel a real driver node reports (the mean of its channels), None where the plant plays the driver."""
        if "DRIVER" not in self._away:
            return None
        pedal = self._receiver.latest(BrakePedal)
        channels = [] if pedal is None else [value for value in pedal if value is not None]
        return sum(channels) / len(channels) if channels else 0.0

    def steering_wheel_rad(self) -> float | None:
        """Angle a real driver node reports, None where the plant plays the driver."""
        if "DRIVER" not in self._away:
            return None
        steering = self._receiver.latest(Steering)
        return 0.0 if steering is None else steering.steering_wheel_angle_rad or 0.0
