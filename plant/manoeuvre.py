"""What the driver, the road and the start are like: plain values."""

from bisect import bisect_right
from dataclasses import dataclass, field

from plant.road import DRY, RoadSegment

Trace = tuple[tuple[float, float], ...]  # (time s, value), in order; linear between, held outside


def value_at(trace: Trace, time_s: float) -> float:
    """Value of a trace at a time; 0 for an empty trace."""
    if not trace:
        return 0.0
    after = bisect_right(trace, (time_s, float("inf")))
    if after == 0:
        return trace[0][1]
    if after == len(trace):
        return trace[-1][1]
    (t0, v0), (t1, v1) = trace[after - 1], trace[after]
    return v0 + (v1 - v0) * (time_s - t0) / (t1 - t0)


@dataclass(frozen=True, slots=True)
class SpeedPhase:
    """A time in which the driver holds a speed with the motors, as long as the brake pedal is free."""

    start_s: float
    end_s: float
    speed_mps: float


@dataclass(frozen=True, slots=True)
class DirectDemands:
    """Demands in the controller's place, for identification runs: one trace a wheel (fl, fr, rl, rr).

    An empty trace leaves that wheel's demand to the controller.
    """

    pressure_pa: tuple[Trace, Trace, Trace, Trace] = ((), (), (), ())
    motor_nm: tuple[Trace, Trace, Trace, Trace] = ((), (), (), ())

    @property
    def complete(self) -> bool:
        """Whether no demand is left to a controller."""
        return all(self.pressure_pa) and all(self.motor_nm)


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """One manoeuvre; its clock starts when the controller's demands are valid.

    Attributes
    ----------
    initial_speed_mps, initial_disc_temperature_k, initial_state_of_charge : the start; the speed is held till then.
    initial_pad_friction : None for the rest value at the temperature.
    pedal : brake pedal travel 0..1.  steering_wheel_rad : positive to the left.
    speed_phases : when the driver holds which speed.  direct : demands in the controller's place.
    road : segments in order.  duration_s : when it ends at the latest.
    end_after_standstill_s : ends when the car has stood for so long; None runs to ``duration_s``.
    wait_for_demands : False starts the clock at the first tick, controller or not.
    """

    initial_speed_mps: float
    duration_s: float
    pedal: Trace = ()
    steering_wheel_rad: Trace = ()
    speed_phases: tuple[SpeedPhase, ...] = ()
    road: tuple[RoadSegment, ...] = DRY
    initial_disc_temperature_k: float = 423.15
    initial_pad_friction: float | None = None
    initial_state_of_charge: float = 0.7
    direct: DirectDemands = field(default_factory=DirectDemands)
    end_after_standstill_s: float | None = 1.0
    wait_for_demands: bool = True
