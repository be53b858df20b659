"""The controller's demands as the actuators see them: checked, timed out, replaced by what is safe."""

from dbc.exchange import Receiver
from dbc.messages import EhbDemandFront, EhbDemandRear, EhbState, MotorDemandFront, MotorDemandRear
from plant.hydraulics import pedal_map_pa
from plant.parameters.brakes import EhbParameters

DEMAND_TIMEOUT_NS = 40_000_000  # since the last valid frame
READY_FRAMES = 10  # valid frames in a row before the manoeuvre starts
EHB_DEMANDS = (EhbDemandFront, EhbDemandRear)
MOTOR_DEMANDS = (MotorDemandFront, MotorDemandRear)
DEMANDS = (*EHB_DEMANDS, *MOTOR_DEMANDS)


def ready(receiver: Receiver) -> bool:
    """Whether every demand has been valid for `READY_FRAMES` frames in a row, and is available."""
    return all(
        receiver.receptions[kind].valid_in_row >= READY_FRAMES and None not in (receiver.latest(kind) or (None,))
        for kind in DEMANDS
    )


def _alive(receiver: Receiver, kind: type[tuple[float | None, ...]], now_ns: int) -> bool:
    age = receiver.age_ns(kind, now_ns)
    return age is not None and age < DEMAND_TIMEOUT_NS


def motor_demand_nm(receiver: Receiver, now_ns: int) -> list[float]:
    """Torque demand of each motor; none on loss of the demand or where it is not available."""
    demand: list[float] = []
    for kind in MOTOR_DEMANDS:
        message = receiver.latest(kind) if _alive(receiver, kind, now_ns) else None
        demand += [0.0, 0.0] if message is None else [value or 0.0 for value in message]
    return demand


class PressureDemand:
    """What the pressure control of one axle follows.

    The demand while it is valid. Without it the brake's own pedal map, and never less for having lost the demand: at
    the moment of loss the map is scaled up to the last demand, so that only the driver's foot releases the brake.
    """

    def __init__(self, kind: type[EhbDemandFront] | type[EhbDemandRear], parameters: EhbParameters) -> None:
        self._kind = kind
        self._p = parameters
        self._last: list[float] = [0.0, 0.0]
        self._scale: list[float] = [1.0, 1.0]
        self.state = EhbState.OWN_PEDAL_MAP

    def _map_pa(self, travel: float) -> float:
        p = self._p
        return pedal_map_pa(
            travel, p.pedal_free_travel, p.pedal_map_linear_pa, p.pedal_map_square_pa, p.pedal_map_cubic_pa
        )

    def update(self, receiver: Receiver, now_ns: int, travel: float) -> list[float]:
        """Pressures to follow from this tick on, Pa (left, right)."""
        message = receiver.latest(self._kind) if _alive(receiver, self._kind, now_ns) else None
        own = self._map_pa(travel)
        if message is not None and None not in message:
            self.state = EhbState.DEMAND
            self._last = [value or 0.0 for value in message]
            return self._last
        if self.state is EhbState.DEMAND:
            self.state = EhbState.OWN_PEDAL_MAP
            self._scale = [max(1.0, last / own) if own > 0.0 else 1.0 for last in self._last]
        return [own * scale for scale in self._scale]
