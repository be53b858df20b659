"""A saloon without motors at the wheels: hydraulic brakes, drums behind, a logger of mixed ages."""

from collections.abc import Mapping, Sequence

import numpy as np

from hil.validation.strangers.car import Cause, Hidden, Noise, Tolerated, Vehicle
from hil.validation.strangers.hydraulic_saloon.causes import CAUSES, with_hidden
from hil.validation.strangers.hydraulic_saloon.course import GUST_MPS, GUST_S, REST_S, Course, courses, slope_mps2
from hil.validation.strangers.hydraulic_saloon.logger import (
    SLOW,
    STEP,
    WHITE,
    Logger,
    logged,
    sensors_another_day,
    true_logger,
)
from hil.validation.strangers.hydraulic_saloon.motion import OMEGA, STATES, TEMPERATURE, VX, run
from hil.validation.strangers.hydraulic_saloon.numbers import WHEELS, Numbers, true_numbers, wheels_another_day
from hil.validation.strangers.hydraulic_saloon.papers import stated, tolerated, with_off
from hil.validation.strangers.signals import Vector

_USUAL_MPS = 20.0


class HydraulicSaloon:
    """A stranger's car (`hil.validation.strangers.car.StrangerCar`)."""

    @property
    def name(self) -> str:
        """Short name."""
        return "hydraulic_saloon"

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
        sensing = [np.random.default_rng([driven_by, 3, k]) if noisy else None for k in range(len(driven))]
        return [logged(motion(car, course), car, logger, rng) for course, rng in zip(driven, sensing, strict=True)]

    def noise(self, seed: int) -> Noise:
        """Noise of the columns, and what wind and road do."""
        stems = {"wheel_speed_{}_rad_s": "wheel", "pressure_{}_pa": "pressure"}
        kinds = {stem.format(wheel): kind for stem, kind in stems.items() for wheel in WHEELS}
        kinds |= {
            "ax_mps2": "ax", "ay_mps2": "ay", "yaw_rate_rad_s": "yaw", "steer_rad": "steer", "speed_mps": "speed",
        }  # fmt: skip
        car, _ = truth(seed)
        hills = [course.hill for course in courses(np.random.default_rng([seed, 2]))]
        return Noise(
            white={name: float(np.hypot(WHITE[kind], STEP.get(kind, 0.0) / 12**0.5)) for name, kind in kinds.items()},
            coloured={name: SLOW[kind] for name, kind in kinds.items() if kind in SLOW},
            gust_mps2=(2.0 * car.drag_kg_m * _USUAL_MPS * GUST_MPS / car.mass_kg, GUST_S),
            slope_mps2=slope_mps2(hills, _USUAL_MPS),
        )

    def tolerated(self, stated: Vehicle) -> Sequence[Tolerated]:
        """Numbers that nobody knows exactly beside that set."""
        return tolerated(stated)


def truth(seed: int, day: int | None = None) -> tuple[Numbers, Logger]:
    """The car and the logger of a seed, with nothing hidden; on another ``day``."""
    rng = np.random.default_rng([seed, 1])
    car, logger = true_numbers(rng), true_logger(rng, master=bool(rng.random() < 0.5))
    if day is None:
        return car, logger
    rng = np.random.default_rng([day, 4])
    return wheels_another_day(car, rng), sensors_another_day(logger, rng)


def motion(car: Numbers, course: Course) -> Vector:
    """The true motion of one log, lead included, (n, `hil.validation.strangers.hydraulic_saloon.motion.ROW`)."""
    start = np.zeros(STATES)
    start[VX] = course.speed_mps
    start[OMEGA : OMEGA + 4] = course.speed_mps / car.radius_m
    start[TEMPERATURE : TEMPERATURE + 4] = course.discs_k
    found: Vector = run(
        start, car, course.foot_n, course.curvature, course.hand_rad, course.wind_mps, course.hill, REST_S
    )
    return found
