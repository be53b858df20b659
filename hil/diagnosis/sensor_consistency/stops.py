"""Stops of a car without measured forces: which gain, delay and drag they support, and what stays open."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.likelihood import Fit, Values, fit, standard_deviations, typical_noise
from hil.diagnosis.sensor_consistency.selection import Progress, SelectionResult, SelectionStep
from hil.diagnosis.sensor_consistency.threshold import THRESHOLD
from hil.diagnosis.vehicle.priors import NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle, rest_friction
from plant.vectors import PARAMETER, P

_NUISANCES: Final = ("drive_mps2", "drive_delay_s", "engine_mps2")
_FITTED: Final = ("brake_mps2_pa", "delay_s", "drag_mps2", "drag_1_m")
_DELAY_STARTS_S: Final = (0.05, -0.2, 0.3)
_DEAD_TIME_SIGMA_S: Final = 0.03
_MIN_OFFSET_PA, _MIN_OFFSET_SIGMA_PA, _OFFSET_SIGMAS = 2e4, 5e3, 4.0
"""A zero of the pressure is a cause from so many Pa and standard deviations; the least deviation reported."""
_FURTHER: Final = {"lag_s": "ehb_bandwidth", "by_speed": "mu_speed", "by_pressure": "mu_pressure"}
_ESTIMATES: Final = {
    "brake_mps2_pa": ("deceleration_per_pressure", "m/s2/Pa"), "delay_s": ("pressure_to_deceleration_delay", "s"),
    "drag_mps2": ("drag_constant", "m/s2"), "drag_1_m": ("drag_with_speed_squared", "1/m"),
    "drive_mps2": ("drive_per_throttle", "m/s2"), "drive_delay_s": ("throttle_to_acceleration_delay", "s"),
    "engine_mps2": ("engine_braking", "m/s2"),
}  # fmt: skip


def relative_sigma(vehicle: Vehicle, name: str, member: int = 0) -> float:
    """Standard deviation of one of the vehicle's parameters before data, as a share of its value."""
    at = PARAMETER.slice(name).start + member
    steps = [n.step[n.at.index(at)] for n in vehicle.nuisances if n.kind is NuisanceKind.VEHICLE and at in n.at]
    return float(np.sqrt(np.sum(np.square(steps))) / vehicle.p[at]) if steps else 0.0


def nominal_braking(vehicle: Vehicle) -> Values:
    """Parameters of a `BrakingModel` as the vehicle set states them."""
    car, brake, p = vehicle.parameters.vehicle, vehicle.parameters.friction_brake, vehicle.p
    radius = vehicle.parameters.wheel.rolling_radius_m
    rotating_kg = 2.0 * sum(vehicle.parameters.wheel.inertia_kg_m2) / radius**2
    mu = rest_friction(vehicle.parameters, float(p[P.friction_brake_ambient_k]))
    torque_m3 = [
        2.0 * mu * brake.efficiency * area * r
        for area, r in zip(brake.piston_area_m2, brake.effective_radius_m, strict=True)
    ]
    mass = car.mass_kg + rotating_kg
    return {
        "brake_mps2_pa": 2.0 * sum(torque_m3) / (radius * mass),
        "delay_s": vehicle.parameters.ehb.dead_time_s,
        "lag_s": vehicle.parameters.ehb.damping_ratio / (np.pi * vehicle.parameters.ehb.natural_frequency_hz),
        "drag_mps2": 9.80665 * car.rolling_resistance * car.mass_kg / mass,
        "drag_1_m": 0.5 * car.air_density_kg_m3 * car.drag_coefficient * car.frontal_area_m2 / mass,
    }


def fit_stops(
    model: BrakingModel, vehicle: Vehicle, nominal: Mapping[str, float], progress: Progress
) -> SelectionResult:
    """Fit all parameters that the stops support together; one that lies beyond its tolerance is a cause.

    Parameters
    ----------
    nominal : values as the vehicle set states them (`nominal_braking`), or as an earlier extension does.
    """
    nuisances = dict.fromkeys([n for n in _NUISANCES if n in model.parameters], 0.0)
    base = _converged(model, nuisances, typical_noise(model), nominal)
    fits = []
    for start in _DELAY_STARTS_S:
        parameters = {**base.parameters, **{n: nominal.get(n, 0.0) for n in _FITTED}}
        parameters["delay_s"] += start - 0.05
        fits.append(_converged(model, parameters, base.noise, nominal))
    final = min(fits, key=lambda f: f.cost)
    segment_id = model.motion.segment_id
    deviation = standard_deviations(model, final, segment_id, nominal)
    tolerance = _tolerance(vehicle, nominal)
    result = SelectionResult(model, dict(nominal), base, final, segment_id, deviation, tolerance)
    result.informative_segments = len(model.stops)
    _add_pressure_offset(model, result, progress)
    for name in ("delay_s", "brake_mps2_pa"):
        rest = {n: v for n, v in final.parameters.items() if n != name}
        gain = result.refit(rest, final.noise).cost - final.cost
        if result.is_significant(name, final, deviation) and gain > THRESHOLD:
            result.steps.append(SelectionStep(name, gain, {}))
            progress(f"{name} = {final.parameters[name]:.4g}, gains {gain:.0f}")
    return result


def _add_pressure_offset(model: BrakingModel, result: SelectionResult, progress: Progress) -> None:
    """The pressure's zero, which the model took off before its fit, as a cause if it is significant."""
    offset = abs(model.offset_pa - result.nominal.get("offset_pa", 0.0))
    if offset > max(_MIN_OFFSET_PA, _OFFSET_SIGMAS * model.offset_sigma_pa):
        result.final.parameters["offset_pa"] = model.offset_pa
        result.deviation["offset_pa"] = max(model.offset_sigma_pa, _MIN_OFFSET_SIGMA_PA)
        result.steps.append(SelectionStep("offset_pa", (offset / result.deviation["offset_pa"]) ** 2, {}))
        progress(f"the pressure reads {model.offset_pa:.0f} Pa while the car gains speed")


def _converged(
    model: BrakingModel, parameters: Mapping[str, float], noise: Mapping[str, float], nominal: Mapping[str, float]
) -> Fit:
    """A fit, restarted up to three times while that gains."""
    best = fit(model, parameters, noise, fixed=nominal)
    for _ in range(3):
        again = fit(model, best.parameters, best.noise, fixed=nominal)
        if best.cost - again.cost < 0.5:
            break
        best = again
    return best


def _tolerance(vehicle: Vehicle, nominal: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations that the tolerances of the vehicle set leave."""
    shares = [relative_sigma(vehicle, n) for n in ("vehicle_mass_kg", "wheel_rolling_radius_m")]
    shares += [0.5 * relative_sigma(vehicle, "friction_brake_piston_area_m2", k) for k in (0, 1)]
    return {
        "brake_mps2_pa": abs(nominal["brake_mps2_pa"]) * float(np.sqrt(np.sum(np.square(shares)))),
        "delay_s": _DEAD_TIME_SIGMA_S,
    }


def estimates(result: SelectionResult | None, vehicle: Vehicle) -> dict[str, Any]:
    """Parameters that the stops support, with 95 % intervals, and what each further term would be if it were added."""
    if result is None:
        return {}
    listed: dict[str, Any] = {}
    for parameter, (name, unit) in _ESTIMATES.items():
        if parameter in result.final.parameters:
            value, interval = result.final.parameters[parameter], result.interval(parameter)
            listed[name] = _estimate(value, unit, *interval, result.nominal.get(parameter))
    torque = vehicle.parameters.vehicle.mass_kg * vehicle.parameters.wheel.rolling_radius_m
    low, high = result.interval("brake_mps2_pa")
    value, low, high = result.final.parameters["brake_mps2_pa"] * torque, low * torque, high * torque
    of_mass = 1.96 * relative_sigma(vehicle, "vehicle_mass_kg") * value
    down, up = float(np.hypot(value - low, of_mass)), float(np.hypot(high - value, of_mass))
    listed["brake_torque_per_pressure"] = _estimate(
        value, "N m/Pa", value - down, value + up, result.nominal["brake_mps2_pa"] * torque
    )
    for parameter, effect in _FURTHER.items():
        nominal = result.nominal.get(parameter, 0.0)
        start = {**result.final.parameters, parameter: nominal + (0.03 if parameter == "lag_s" else 0.0)}
        fitted = result.refit(start, result.final.noise)
        value = fitted.parameters[parameter]
        half = result.quantile(0.975) * result.deviations_of(fitted)[parameter]
        unit = "s" if parameter == "lag_s" else ""
        estimate = _estimate(value, unit, value - half, value + half, nominal)
        listed[f"hint_{effect}"] = estimate | {"gain": result.final.cost - fitted.cost}
    return listed


def _estimate(value: float, unit: str, low: float, high: float, nominal: float | None) -> dict[str, Any]:
    return {"value": value, "unit": unit, "ci95": [low, high], "nominal": nominal}
