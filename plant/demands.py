"""The controller's demands as the actuators see them: checked, timed out, replaced by what is safe."""

from math import isnan

from dbc.exchange import Receiver
from dbc.messages import EhbDemandFront, EhbDemandRear, EhbState, MotorDemandFront, MotorDemandRear
from plant.hydraulics import pedal_map_pa
from plant.parameters.brakes import EhbParameters

DEMAND_TIMEOUT_NS = 40_000_000  # since the last valid frame
SEQUENCE = 10  # valid demands in a row before an actuator follows, and before the manoeuvre starts
EHB_DEMANDS = (EhbDemandFront, EhbDemandRear)
MOTOR_DEMANDS = (MotorDemandFront, MotorDemandRear)
DEMANDS = (*EHB_DEMANDS, *MOTOR_DEMANDS)
Demand = EhbDemandFront | EhbDemandRear | MotorDemandFront | MotorDemandRear


class DemandStream:
    """Whether the demands of one message may be followed.

    A demand is valid when its frame is, and both its values are available. An actuator follows after `SEQUENCE` valid
    demands in a row, until one is not available or none has come for `DEMAND_TIMEOUT_NS`.
    """

    def __init__(self, kind: type[Demand], receiver: Receiver) -> None:
        self._reception, self._values = receiver.receptions[kind], receiver.of(kind)
        self._valid_in_row = 0
        self.followed: tuple[float, float] | None = None

    def update(self, now_ns: int) -> tuple[float, float] | None:
        """Take the tick's frames; the values (left, right) to follow, or None."""
        reception = self._reception
        last_ns = reception.last_valid_ns
        left, right = self._values.tolist()
        if last_ns is None or now_ns - last_ns >= DEMAND_TIMEOUT_NS or isnan(left + right):
            self._valid_in_row = 0
            self.followed = None
            return None
        if self.followed is None and reception.fresh:
            self._valid_in_row = min(self._valid_in_row + 1, reception.valid_in_row)
        if self.followed is not None or self._valid_in_row >= SEQUENCE:
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

    def update(self, now_ns: int, travel: float) -> tuple[float, float]:
        """Pressures to follow from this tick on, Pa (left, right)."""
        demand = self._stream.update(now_ns)
        if demand is not None:
            self.state = EhbState.DEMAND
            self._last = demand
            return demand
        own = self._map_pa(travel)
        if self.state is EhbState.DEMAND:
            self.state = EhbState.OWN_PEDAL_MAP
            left, right = (max(1.0, last / own) if own > 0.0 else 1.0 for last in self._last)
            self._scale = left, right
        return own * self._scale[0], own * self._scale[1]


class Demands:
    """All four demand messages of the controller."""

    def __init__(self, receiver: Receiver, parameters: EhbParameters) -> None:
        self.pressure = [PressureDemand(kind, receiver, parameters) for kind in EHB_DEMANDS]
        self._motor = [DemandStream(kind, receiver) for kind in MOTOR_DEMANDS]

    def update(self, now_ns: int, travel: float) -> tuple[list[float], list[float]]:
        """Pressures, Pa, and motor torques, N m, to follow from this tick on; a lost motor demand is none."""
        pressure = [value for demand in self.pressure for value in demand.update(now_ns, travel)]
        torque = [value for stream in self._motor for value in stream.update(now_ns) or (0.0, 0.0)]
        return pressure, torque

    @property
    def followed(self) -> bool:
        """Whether every actuator follows the controller."""
        pressed = all(demand.state is EhbState.DEMAND for demand in self.pressure)
        return pressed and all(stream.followed is not None for stream in self._motor)
