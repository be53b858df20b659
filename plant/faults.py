"""Physical faults of the car that fault commands switch: what they make of the demands, and what the car says of it."""

from collections.abc import Sequence

from dbc.bench_messages import PAD_FACTOR, FaultCommand, FaultParameter, PhysicalFault
from dbc.messages import EhbState
from plant.layout import Vector
from plant.vectors import STATE, S

WEAK_SHARE = 0.5  # torque of a weak motor over what it is asked: a choice, half a machine's windings
PAD_SHARE = 0.5  # friction of weak pads over that of pads that are well, where no command says it: a choice
MOST_PAD_SHARE = 2.0
_MOTOR = (PhysicalFault.MOTOR_DEAF, PhysicalFault.MOTOR_WEAK, PhysicalFault.MOTOR_STUCK_ON)
_TORQUE, _PRESSURE = STATE.slice("motor_torque_nm"), STATE.slice("pressure_pa")
_AXLES = (0b0011, 0b1100)


class PhysicalFaults:
    """The faults of one car.

    Parameters
    ----------
    switch : switches of the model (`plant.vectors.SWITCH`), which it moves.
    battery_notice_s : time from the battery's refusal to its enforcement.

    Attributes
    ----------
    alters : whether `act` changes any demand.
    """

    def __init__(self, switch: Vector, battery_notice_s: float) -> None:
        self.alters = False
        self._switch = switch
        self._notice_ns = round(battery_notice_s * 1e9)
        self._notice_ends_ns = 0
        self._announced = False  # and not yet enforced
        self._wheels = dict.fromkeys(PhysicalFault, 0)
        self._stuck_nm = [0.0] * 4
        self._pad_factor = PAD_SHARE

    def note(self, parameter: FaultParameter) -> None:
        """Take a number of the fault that the next command switches on; what is no factor of pads is passed over."""
        fault, index, mantissa, exponent = parameter
        if (fault, index) == PAD_FACTOR and mantissa is not None and exponent is not None:
            self._pad_factor = min(max(float(f"{mantissa}e{exponent}"), 0.0), MOST_PAD_SHARE)

    def take(self, now_ns: int, command: FaultCommand, x: Vector) -> None:
        """Switch one fault on or off; a motor that sticks keeps the torque in ``x`` (``STATE``)."""
        fault, wheels, well = command.fault, command.wheels or 0, 0.0 if command.active else 1.0
        if fault is None or fault is PhysicalFault.NONE:
            return
        if fault is PhysicalFault.MOTOR_DEAD:
            for i in range(4):
                if wheels >> i & 1:
                    self._switch[S.motor_alive + i] = well
        elif fault is PhysicalFault.PAD_FRICTION:
            for i in range(4):
                if wheels >> i & 1:
                    self._switch[S.pad_friction + i] = self._pad_factor if command.active else 1.0
            self._pad_factor = PAD_SHARE
        elif fault is PhysicalFault.BATTERY_REFUSES_CHARGE:
            if self._switch[S.battery_announces] != well:
                self._switch[S.battery_announces] = well
                self._notice_ends_ns = now_ns + (self._notice_ns if command.active else 0)
                self._announced = True
        else:
            new = wheels & ~self._wheels[fault]
            self._wheels[fault] = self._wheels[fault] | wheels if command.active else self._wheels[fault] & ~wheels
            if fault is PhysicalFault.MOTOR_STUCK_ON and command.active:
                torque = x[_TORQUE].tolist()
                self._stuck_nm = [torque[i] if new >> i & 1 else self._stuck_nm[i] for i in range(4)]
            self.alters = any(self._wheels.values())

    def keep_time(self, now_ns: int) -> None:
        """Let the battery enforce what it has announced."""
        if self._announced and now_ns >= self._notice_ends_ns:
            self._announced = False
            self._switch[S.battery_accepts] = self._switch[S.battery_announces]

    def act(self, pressure_pa: list[float], motor_nm: list[float], x: Vector) -> tuple[list[float], list[float]]:
        """Demands (Pa, N m) as faulty actuators follow them, in a car in the state ``x``."""
        deaf, weak, stuck = (self._wheels[fault] for fault in _MOTOR)
        failed = self._wheels[PhysicalFault.EHB_CIRCUIT_FAILED]
        empty = self._wheels[PhysicalFault.ACCUMULATOR_EMPTY]
        now_pa: list[float] = x[_PRESSURE].tolist()
        for i in range(4):
            bit = 1 << i
            motor_nm[i] *= WEAK_SHARE if weak & bit else 1.0
            motor_nm[i] = 0.0 if deaf & bit else motor_nm[i]
            motor_nm[i] = self._stuck_nm[i] if stuck & bit else motor_nm[i]
            pressure_pa[i] = min(pressure_pa[i], now_pa[i]) if empty & bit else pressure_pa[i]
            pressure_pa[i] = 0.0 if failed & bit else pressure_pa[i]
        return pressure_pa, motor_nm

    def told(self, states: Sequence[EhbState]) -> list[EhbState]:
        """What the brake says of its axles: that one with a failed circuit has failed."""
        if not self.alters:
            return list(states)
        failed = self._wheels[PhysicalFault.EHB_CIRCUIT_FAILED]
        return [EhbState.FAILED if failed & axle else state for state, axle in zip(states, _AXLES, strict=True)]
