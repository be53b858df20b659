"""The controller's demands as the actuators see them: checked, timed out, replaced by what is safe."""

from math import isnan

from dbc.exchange import Receiver
from dbc.intake import LAST_VALID_NS, RECEIVED
from dbc.messages import EhbDemandFront, EhbDemandRear, EhbState, MotorDemandFront, MotorDemandRear
from plant.hydraulics import pedal_map_pa
from plant.parameters.brakes import EhbParameters

DEMAND_TIMEOUT_NS = 40_000_000  # since the last valid frame
SEQUENCE = 10  # valid demands in a row before an actuator follows, and before the manoeuvre starts
EHB_DEMANDS = (EhbDemandFront, EhbDemandRear)
MOTOR_DEMANDS = (MotorDemandFront, MotorDemandRear)
DEMANDS = (*EHB_DEMANDS, *MOTOR_DEMANDS)
_NONE = (0.0, 0.0)
_DEMAND = EhbState.DEMAND  # asked for every tick: an enum's attributes are slow
Demand = EhbDemandFront | EhbDemandRear | MotorDemandFront | MotorDemandRear


class DemandStream:
    """Whether the demands of one message may be followed.

    A demand is valid when its frame is, and both its values are available. An actuator follows after `SEQUENCE` valid
    demands in a row, until one is not available or none has come for `DEMAND_TIMEOUT_NS`.
    """

    def __init__(self, kind: type[Demand], receiver: Receiver) -> None:
        self._reception, self._memory = receiver.receptions[kind], receiver.receptions[kind].memory
        self._valid_in_row = 0
        self.followed: tuple[float, float] | None = None

    def update(self, now_ns: int, left: float, right: float) -> tuple[float, float] | None:
        """Take the last values that came and whether they did now; the values (left, right) to follow, or None."""
        memory = self._memory
        if not memory[RECEIVED] or now_ns - memory[LAST_VALID_NS] >= DEMAND_TIMEOUT_NS or isnan(left + right):
            self._valid_in_row = 0
            self.followed = None
            return None
        if self.followed is None:
            if self._reception.fresh:
                self._valid_in_row = min(self._valid_in_row + 1, self._reception.valid_in_row)
            if self._valid_in_row < SEQUENCE:
                return None
        self.followed = left, right
        return self.followed


class PressureDemand:
    """What the pressure control of one axle follows.

    The demand while it may be followed. Without it the brake's own pedal map, and never less for having lost the
    demand: at the moment of loss the map is scaled up to the last demand, so that only the driver's foot releases the
    brake.
    """

    def __init__(
        self, kind: type[EhbDemandFront] | type[EhbDemandRear], receiver: Receiver, parameters: EhbParameters
    ) -> None:
        self._stream = DemandStream(kind, receiver)
        self._p = parameters
        self._last = (0.0, 0.0)
        self._scale = (1.0, 1.0)
        self.state = EhbState.OWN_PEDAL_MAP

    def _map_pa(self, travel: float) -> float:
        p = self._p
        return pedal_map_pa(
            travel, p.pedal_free_travel, p.pedal_map_linear_pa, p.pedal_map_square_pa, p.pedal_map_cubic_pa
        )

    def update(self, now_ns: int, left: float, right: float, travel: float) -> tuple[float, float]:
        """Pressures to follow from this tick on, Pa (left, right), out of the last demands."""
        demand = self._stream.update(now_ns, left, right)
        if demand is not None:
            self.state = _DEMAND
            self._last = demand
            return demand
        own = self._map_pa(travel)
        if self.state is _DEMAND:
            self.state = EhbState.OWN_PEDAL_MAP
            scale_left, scale_right = (max(1.0, last / own) if own > 0.0 else 1.0 for last in self._last)
            self._scale = scale_left, scale_right
        return own * self._scale[0], own * self._scale[1]


class Demands:
    """All four demand messages of the controller: `DEMANDS`, the first that the receiver reads."""

    def __init__(self, receiver: Receiver, parameters: EhbParameters) -> None:
        self.pressure = [PressureDemand(kind, receiver, parameters) for kind in EHB_DEMANDS]
        self._motor = [DemandStream(kind, receiver) for kind in MOTOR_DEMANDS]
        self._values = receiver.values[: 2 * len(DEMANDS)]  # the receiver's first messages

    def update(self, now_ns: int, travel: float) -> tuple[list[float], list[float]]:
        """Pressures, Pa, and motor torques, N m, to follow from this tick on; a lost motor demand is none."""
        a, b, c, d, e, f, g, h = self._values.tolist()
        (front, rear), (motor_front, motor_rear) = self.pressure, self._motor
        pressure = [*front.update(now_ns, a, b, travel), *rear.update(now_ns, c, d, travel)]
        torque = [*(motor_front.update(now_ns, e, f) or _NONE), *(motor_rear.update(now_ns, g, h) or _NONE)]
        return pressure, torque

    @property
    def followed(self) -> bool:
        """Whether every actuator follows the controller."""
        pressed = all(demand.state is _DEMAND for demand in self.pressure)
        return pressed and all(stream.followed is not None for stream in self._motor)
