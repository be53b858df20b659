"""A laden van: one motor on the rear axle, electro-mechanical brakes, a 50 Hz log from the bus."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from hil.validation.strangers.brake_by_wire_van.causes import CAUSES, with_hidden
from hil.validation.strangers.brake_by_wire_van.course import GUST_MPS, GUST_S, REST_S, Course, courses, slope_mps2
from hil.validation.strangers.brake_by_wire_van.logger import (
    SLOW,
    STEP,
    WHITE,
    Logger,
    logged,
    sensors_another_day,
    true_logger,
)
from hil.validation.strangers.brake_by_wire_van.motion import FRONT_DEMAND, MOTOR_DEMAND, OMEGA, STATES, VX, run
from hil.validation.strangers.brake_by_wire_van.numbers import (
    FRONT_GAIN_NM_PA,
    RADIUS_M,
    REAR_GAIN_NM_PA,
    WHEELS,
    Numbers,
    true_numbers,
    wheels_another_day,
)
from hil.validation.strangers.brake_by_wire_van.papers import stated, tolerated, with_off
from hil.validation.strangers.car import Cause, Hidden, Noise, Tolerated, Vehicle
from hil.validation.strangers.signals import Vector

_USUAL_MPS = 16.0
CONTROL = np.array([FRONT_GAIN_NM_PA, REAR_GAIN_NM_PA, RADIUS_M])
NONE = np.zeros((0, 3))


class BrakeByWireVan:
    """A stranger's car (`hil.validation.strangers.car.StrangerCar`)."""

    @property
    def name(self) -> str:
        """Short name."""
        return "brake_by_wire_van"

    @property
    def causes(self) -> Mapping[str, Cause]:
        """What can be hidden."""
        return CAUSES

    def stated(self, rng: np.random.Generator) -> dict[str, float | list[float]]:
        """The set that the owner writes."""
        return stated(rng)

    def drive(
        self, seed: int, hidden: Hidden | None = None, noisy: bool = True, off: Tolerated | None = None,
        day: int | None = None,
    ) -> Sequence[dict[str, Vector]]:  # fmt: skip
        """Four to six logs, 90 to 130 s together."""
        car, logger = with_off(with_hidden(truth(seed, day), hidden), off)
        driven_by = seed if day is None else day
        driven = courses(np.random.default_rng([driven_by, 2]))
        if noisy:
            return [
                logged(motion(car, course), course.asked_nm, car, logger, np.random.default_rng([driven_by, 3, k]))
                for k, course in enumerate(driven)
            ]
        # demands of the sound van: the control would answer to another speed, which is no signature
        return [
            logged(motion(car, course, given), course.asked_nm, car, logger, None)
            for course, given in zip(driven, _sound_demands(seed, day), strict=True)
        ]

    def noise(self, seed: int) -> Noise:
        """Noise of what is measured (demands are exact), and what wind and road do."""
        stems = {"wheel_speed_{}_rad_s": "wheel", "pressure_{}_pa": "pressure"}
        kinds = {stem.format(wheel): kind for stem, kind in stems.items() for wheel in WHEELS}
        kinds |= {f"motor_torque_{wheel}_nm": "motor" for wheel in WHEELS[2:]}
        kinds |= {"ax_mps2": "ax", "ay_mps2": "ay", "yaw_rate_rad_s": "yaw", "steer_rad": "steer"}
        car, _ = truth(seed)
        hills = [course.hill for course in courses(np.random.default_rng([seed, 2]))]
        return Noise(
            white={name: float(np.hypot(WHITE[kind], STEP[kind] / 12**0.5)) for name, kind in kinds.items()},
            coloured={name: SLOW[kind] for name, kind in kinds.items() if kind in SLOW},
            gust_mps2=(2.0 * car.drag_kg_m * _USUAL_MPS * GUST_MPS / car.mass_kg, GUST_S),
            slope_mps2=slope_mps2(hills, _USUAL_MPS),
        )

    def tolerated(self, stated: Vehicle) -> Sequence[Tolerated]:
        """Numbers that nobody knows exactly beside that set."""
        return tolerated(stated)


def truth(seed: int, day: int | None = None) -> tuple[Numbers, Logger]:
    """The van and the logger of a seed, with nothing hidden; on another ``day``."""
    rng = np.random.default_rng([seed, 1])
    car, logger = true_numbers(rng), true_logger(rng)
    if day is None:
        return car, logger
    rng = np.random.default_rng([day, 4])
    return wheels_another_day(car, rng), sensors_another_day(logger, rng)


def motion(car: Numbers, course: Course, demands: Vector = NONE) -> Vector:
    """The true motion of one log, lead included, (n, `hil.validation.strangers.brake_by_wire_van.motion.ROW`).

    Parameters
    ----------
    demands : (k, 3) that stand in for the control; (0, 3) none.
    """
    start = np.zeros(STATES)
    start[VX] = course.speed_mps
    start[OMEGA : OMEGA + 4] = course.speed_mps / car.radius_m
    found: Vector = run(
        start, car, course.asked_nm, course.curvature, course.hand_rad, course.wind_mps, course.hill, CONTROL, demands,
        REST_S,
    )  # fmt: skip
    return found


@lru_cache(maxsize=4)
def _sound_demands(seed: int, day: int | None) -> tuple[Vector, ...]:
    car, _ = truth(seed, day)
    driven = courses(np.random.default_rng([seed if day is None else day, 2]))
    return tuple(motion(car, course)[:, FRONT_DEMAND : MOTOR_DEMAND + 1].copy() for course in driven)
