"""Manoeuvres that show effects: demands given directly, so that no controller stands between effect and signal."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from plant.layout import Vector
from plant.manoeuvre import DirectDemands, Manoeuvre, Trace, value_at
from plant.model import initial_state, pack
from plant.parameters.plant import PlantParameters
from plant.vectors import INPUT, STATE

ROW_S = 0.01
BAR = 1e5


def _pulses(times: Sequence[float], height: float, long_s: float, ramp_s: float = 0.05) -> Trace:
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    for start in times:
        points += [(start, 0.0), (start + ramp_s, height), (start + long_s, height), (start + long_s + ramp_s, 0.0)]
    return tuple(points)


def _direct(pressure: Trace = ((0.0, 0.0),), motor: Trace = ((0.0, 0.0),)) -> DirectDemands:
    return DirectDemands((pressure, pressure, pressure, pressure), (motor, motor, motor, motor))


def _manoeuvre(speed_mps: float, duration_s: float, direct: DirectDemands, **more: object) -> Manoeuvre:
    base = Manoeuvre(initial_speed_mps=speed_mps, duration_s=duration_s, direct=direct, wait_for_demands=False)
    return replace(base, **more)  # type: ignore[arg-type]  # fields by name, each of its own type


@dataclass(frozen=True, slots=True)
class Show:
    """A manoeuvre, and the temperature of the windings at its start."""

    what: str
    manoeuvre: Manoeuvre
    winding_k: float | None = None


_STEPS: Trace = (
    (0.3, 0.0), (0.3, 5 * BAR), (1.1, 5 * BAR), (1.1, 0.0), (1.6, 0.0), (1.6, 20 * BAR), (2.4, 20 * BAR), (2.4, 0.0),
    (3.0, 0.0), (3.0, 60 * BAR), (3.8, 60 * BAR), (3.8, 0.0),
)  # fmt: skip
_TRIANGLE: Trace = tuple((0.5 + k, 30 * BAR * (k % 2)) for k in range(9))
_REGENERATION: Trace = (
    (0.3, 0.0), (0.3, -150.0), (1.0, -150.0), (1.0, 0.0), (1.5, 0.0), (1.5, -300.0), (2.2, -300.0), (2.2, 200.0),
    (2.9, 200.0), (2.9, 0.0), (3.4, 0.0), (3.4, -250.0), (4.2, -250.0), (4.2, 0.0),
)  # fmt: skip

MANOEUVRES: dict[str, Show] = {
    "coast_down": Show("130 km/h, nothing pressed, 12 s", _manoeuvre(36.0, 12.0, _direct())),
    "straight_stop": Show(
        "72 km/h, 30 bar, friction only, to standstill",
        _manoeuvre(20.0, 7.0, _direct(((0.3, 0.0), (0.5, 30 * BAR))), pedal=((0.3, 0.0), (0.5, 0.55))),
    ),
    "fast_stop": Show(
        "130 km/h, 30 bar, to standstill", _manoeuvre(36.0, 12.0, _direct(((0.3, 0.0), (0.5, 30 * BAR))))
    ),
    "hard_stop": Show("108 km/h, 75 bar", _manoeuvre(30.0, 3.5, _direct(((0.3, 0.0), (0.6, 75 * BAR))))),
    "hot_stop": Show(
        "130 km/h, 40 bar, discs at 330 degC",
        _manoeuvre(36.0, 7.0, _direct(((0.3, 0.0), (0.5, 40 * BAR))), initial_disc_temperature_k=603.15),
    ),
    "hot_coast": Show(
        "130 km/h, nothing pressed, discs at 330 degC",
        _manoeuvre(36.0, 8.0, _direct(), initial_disc_temperature_k=603.15),
    ),
    "cold_stops": Show(
        "130 km/h, four applications of 1.2 s at 25 bar, discs at 30 degC",
        _manoeuvre(36.0, 9.0, _direct(_pulses((0.5, 2.5, 4.5, 6.5), 25 * BAR, 1.2)), initial_disc_temperature_k=303.15),
    ),
    "pressure_steps": Show("108 km/h, steps of 5, 20 and 60 bar", _manoeuvre(30.0, 4.5, _direct(_STEPS))),
    "pressure_triangle": Show("108 km/h, 0 to 30 bar and back at 0.5 Hz", _manoeuvre(30.0, 9.0, _direct(_TRIANGLE))),
    "regenerative_pulses": Show(
        "72 km/h, motors alone: -150, -300, +200, -250 N m", _manoeuvre(20.0, 5.0, _direct(motor=_REGENERATION))
    ),
    "full_regeneration": Show(
        "130 km/h, -600 N m demanded: the battery limits",
        _manoeuvre(36.0, 5.0, _direct(motor=_pulses((0.5,), -600.0, 4.0))),
    ),
    "hot_motors": Show(
        "43 km/h, -500 N m, windings at 115 degC",
        _manoeuvre(12.0, 2.5, _direct(motor=_pulses((0.3,), -500.0, 1.8))),
        388.15,
    ),
    "blending_steps": Show(
        "108 km/h, torque handed from motors to friction and back",
        _manoeuvre(
            30.0,
            6.0,
            _direct(
                ((0.5, 5 * BAR), (1.5, 5 * BAR), (1.6, 20 * BAR), (3.0, 20 * BAR), (3.1, 5 * BAR), (4.5, 5 * BAR)),
                ((0.5, 0.0), (0.6, -250.0), (1.5, -250.0), (1.6, 0.0), (3.0, 0.0), (3.1, -250.0)),
            ),
        ),
    ),
    "brake_in_turn": Show(
        "72 km/h, 0.8 rad at the steering wheel, 15 bar",
        _manoeuvre(
            20.0,
            5.0,
            _direct(((2.0, 0.0), (2.2, 15 * BAR))),
            steering_wheel_rad=((0.5, 0.0), (1.0, 0.8)),
        ),
    ),
    "creep": Show("11 km/h, nothing pressed", _manoeuvre(3.0, 6.0, _direct())),
    "creep_stop": Show(
        "14 km/h, 2 bar and regeneration, to standstill",
        _manoeuvre(4.0, 5.0, _direct(((0.3, 0.0), (0.4, 2 * BAR)), ((0.3, 0.0), (0.4, -60.0)))),
    ),
    "abrupt_stop": Show("11 km/h, 40 bar at once", _manoeuvre(3.0, 2.5, _direct(((0.3, 0.0), (0.3, 40 * BAR))))),
    "reverse_stop": Show(
        "backward at 22 km/h, 10 bar, to standstill", _manoeuvre(-6.0, 5.0, _direct(((0.3, 0.0), (0.5, 10 * BAR))))
    ),
}


@dataclass(frozen=True, slots=True)
class Drive:
    """What a replay starts with and is driven with.

    Attributes
    ----------
    start : ``STATE``.  rows : one ``INPUT`` a row.  parameters : ``PARAMETER``.  pedal : travel in each row.
    road : rows of `plant.road.road_table`, dry where None.
    """

    start: Vector
    rows: Vector
    parameters: Vector
    pedal: Vector
    row_s: float = ROW_S
    road: Vector | None = None


def drive(show: Show, parameters: PlantParameters, row_s: float = ROW_S) -> Drive:
    """A manoeuvre as a start and rows of inputs."""
    plan = show.manoeuvre
    start = initial_state(
        parameters, plan.initial_speed_mps, plan.initial_disc_temperature_k, plan.initial_state_of_charge
    )
    if show.winding_k is not None:
        start[STATE.slice("winding_temperature_k")] = show.winding_k
    times = np.arange(round(plan.duration_s / row_s)) * row_s
    rows = np.zeros((len(times), INPUT.size))

    def course(trace: Trace) -> list[float]:
        return [value_at(trace, t) for t in times]

    for part, traces in (("pressure_demand_pa", plan.direct.pressure_pa), ("motor_demand_nm", plan.direct.motor_nm)):
        rows[:, INPUT.slice(part)] = np.column_stack([course(trace) for trace in traces])
    rows[:, INPUT.slice("steering_wheel_rad")] = np.array(course(plan.steering_wheel_rad))[:, None]
    return Drive(start, rows, pack(parameters), np.array(course(plan.pedal)), row_s)
