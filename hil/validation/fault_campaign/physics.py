"""What the friction brake can do at best: bounds that no controller beats."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from hil.validation.fault_campaign.drive import scenario_of
from plant.hydraulics import pressure_jerk

_STEP_S = 1e-3
_ON_THE_WAY_S = 0.01  # from the controller's tick to the brake's next one and its effect on the car's


@cache
def nm_per_pa() -> float:
    """Braking torque of all four wheels over the pressure in them, N m/Pa, with nominal pads."""
    brake = scenario_of().ecu.friction_brake
    return sum(
        4.0 * brake.pad_friction * brake.efficiency * area * radius
        for area, radius in zip(brake.cylinder_area_m2, brake.effective_radius_m, strict=True)
    )


def follows_s(asked_nm: NDArray[np.float64], row_s: float, share: float, from_nm: float) -> float:
    """Time after which a brake that is asked for exactly a course of torque gives a share of it, s; infinite: never.

    Dead time, second order and limited rates of the brake. It could be asked for more than is lost, which would brake
    too much afterwards.

    Parameters
    ----------
    asked_nm : a row every ``row_s``, from when the controller knows.
    from_nm : what is less is not looked at.
    """
    ehb = scenario_of().plant.ehb
    late = round((ehb.dead_time_s + _ON_THE_WAY_S) / _STEP_S)
    course = np.repeat(asked_nm / nm_per_pa(), round(row_s / _STEP_S))
    pressure = rate = 0.0
    for k, wanted in enumerate(course.tolist()):
        if wanted * nm_per_pa() >= from_nm and pressure >= share * wanted:
            return k * _STEP_S
        demand = course[k - late] if k >= late else 0.0
        jerk = pressure_jerk(
            float(demand), pressure, rate, ehb.natural_frequency_hz, ehb.damping_ratio, ehb.build_rate_pa_s,
            ehb.release_rate_pa_s,
        )  # fmt: skip
        rate = min(max(rate + jerk * _STEP_S, -ehb.release_rate_pa_s), ehb.build_rate_pa_s)
        pressure += rate * _STEP_S
    return float("inf")
