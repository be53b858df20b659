"""Stops of a car whose forces nobody measured: what gain, delay and drag they support, and what stays tied."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from scipy.stats import t as student

from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.likelihood import Fit, Values, fit, standard_deviations, typical_noise
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.selection import ALPHA, THRESHOLD, Progress, SelectionResult, SelectionStep
from hil.diagnosis.vehicle.priors import NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle, rest_friction
from plant.vectors import PARAMETER, P

_UNKNOWN: Final = ("drive_mps2", "drive_delay_s", "engine_mps2")
_FREE: Final = ("brake_mps2_pa", "delay_s", "drag_mps2", "drag_1_m")
_STARTS_S: Final = (0.05, -0.2, 0.3)
_DEAD_TIME_SIGMA_S: Final = 0.03
_LEAST_OFFSET_PA, _OFFSET_SIGMA_PA, _SURE = 2e4, 5e3, 4.0
_HINTS: Final = {"lag_s": "ehb_bandwidth", "by_speed": "mu_speed", "by_pressure": "mu_pressure"}
_UNITS: Final = {
    "brake_mps2_pa": ("deceleration_per_pressure", "m/s2/Pa"), "delay_s": ("pressure_to_deceleration_delay", "s"),
    "drag_mps2": ("drag_constant", "m/s2"), "drag_1_m": ("drag_with_speed_squared", "1/m"),
    "drive_mps2": ("drive_per_throttle", "m/s2"), "drive_delay_s": ("throttle_to_acceleration_delay", "s"),
    "engine_mps2": ("engine_braking", "m/s2"),
}  # fmt: skip


def relative_sigma(vehicle: Vehicle, name: str, member: int = 0) -> float:
    """Standard deviation of one of the vehicle's numbers, as a share of it."""
    at = PARAMETER.slice(name).start + member
    steps = [n.step[n.at.index(at)] for n in vehicle.nuisances if n.kind is NuisanceKind.VEHICLE and at in n.at]
    return float(np.sqrt(np.sum(np.square(steps))) / vehicle.p[at]) if steps else 0.0


def nominal_braking(vehicle: Vehicle) -> Values:
    """The vehicle's own numbers in the model of `BrakingModel`."""
    car, brake, p = vehicle.parameters.vehicle, vehicle.parameters.friction_brake, vehicle.p
    radius = vehicle.parameters.wheel.rolling_radius_m
    turning = 2.0 * sum(vehicle.parameters.wheel.inertia_kg_m2) / radius**2
    mu = rest_friction(vehicle.parameters, float(p[P.friction_brake_ambient_k]))
    gains = [
        2.0 * mu * brake.efficiency * area * r
        for area, r in zip(brake.piston_area_m2, brake.effective_radius_m, strict=True)
    ]
    mass = car.mass_kg + turning
    return {
        "brake_mps2_pa": 2.0 * sum(gains) / (radius * mass),
        "delay_s": vehicle.parameters.ehb.dead_time_s,
        "lag_s": vehicle.parameters.ehb.damping_ratio / (np.pi * vehicle.parameters.ehb.natural_frequency_hz),
        "drag_mps2": 9.80665 * car.rolling_resistance * car.mass_kg / mass,
        "drag_1_m": 0.5 * car.air_density_kg_m3 * car.drag_coefficient * car.frontal_area_m2 / mass,
    }


def stop_search(
    model: BrakingModel, motion: Motion, vehicle: Vehicle, handed: Mapping[str, float], say: Progress
) -> SelectionResult:
    """Fit all that the stops support together; a cause is what lies beyond the vehicle's tolerance."""
    unknown = dict.fromkeys([n for n in _UNKNOWN if n in model.parameters], 0.0)
    base = _settled(model, unknown, typical_noise(model), handed)
    tried = []
    for start in _STARTS_S:
        sensor = {**base.sensor, **{n: handed.get(n, 0.0) for n in _FREE}}
        sensor["delay_s"] += start - 0.05
        tried.append(_settled(model, sensor, base.noise, handed))
    final = min(tried, key=lambda f: f.cost)
    deviation = standard_deviations(model, final, motion.block, handed)
    found = SelectionResult(model, dict(handed), base, final, motion.block, deviation, _tolerance(vehicle, handed))
    found.evidence = len(model.stops)
    _zero_off(model, found, say)
    for number in ("delay_s", "brake_mps2_pa"):
        spread = float(np.hypot(deviation[number], found.tolerance[number]))
        off = abs(final.sensor[number] - handed[number])
        rest = {n: v for n, v in final.sensor.items() if n != number}
        gain = fit(model, rest, final.noise, fixed=handed).cost - final.cost
        if off > student.ppf(1.0 - 0.5 * ALPHA, found.degrees) * spread and gain > THRESHOLD:
            found.steps.append(SelectionStep(number, gain, {}))
            say(f"{number} = {final.sensor[number]:.4g}, gains {gain:.0f}")
    return found


def _zero_off(model: BrakingModel, found: SelectionResult, say: Progress) -> None:
    """The pressure's zero while the car gains speed; it was taken off before all else."""
    off = abs(model.offset_pa - found.given.get("offset_pa", 0.0))
    if off > max(_LEAST_OFFSET_PA, _SURE * model.offset_sigma_pa):
        found.final.sensor["offset_pa"] = model.offset_pa
        found.deviation["offset_pa"] = max(model.offset_sigma_pa, _OFFSET_SIGMA_PA)
        found.steps.append(SelectionStep("offset_pa", (off / found.deviation["offset_pa"]) ** 2, {}))
        say(f"the pressure reads {model.offset_pa:.0f} Pa while the car gains speed")


def _settled(
    model: BrakingModel, sensor: Mapping[str, float], noise: Mapping[str, float], handed: Mapping[str, float]
) -> Fit:
    found = fit(model, sensor, noise, fixed=handed)
    for _ in range(3):
        again = fit(model, found.sensor, found.noise, fixed=handed)
        if found.cost - again.cost < 0.5:
            break
        found = again
    return found


def _tolerance(vehicle: Vehicle, handed: Mapping[str, float]) -> dict[str, float]:
    """What the vehicle set leaves open, one standard deviation."""
    shares = [relative_sigma(vehicle, n) for n in ("vehicle_mass_kg", "wheel_rolling_radius_m")]
    shares += [0.5 * relative_sigma(vehicle, "friction_brake_piston_area_m2", k) for k in (0, 1)]
    return {
        "brake_mps2_pa": abs(handed["brake_mps2_pa"]) * float(np.sqrt(np.sum(np.square(shares)))),
        "delay_s": _DEAD_TIME_SIGMA_S,
    }


def estimates(found: SelectionResult | None, motion: Motion, vehicle: Vehicle) -> dict[str, Any]:
    """Numbers that the stops support, with intervals, and what the same stops say of further terms."""
    if found is None:
        return {}
    listed: dict[str, Any] = {}
    for number, (name, unit) in _UNITS.items():
        if number in found.final.sensor:
            low, high = found.interval(number)
            listed[name] = {
                "value": found.final.sensor[number], "unit": unit, "ci95": [low, high],
                "handed_in": found.given.get(number),
            }  # fmt: skip
    force = vehicle.parameters.vehicle.mass_kg * vehicle.parameters.wheel.rolling_radius_m
    share = relative_sigma(vehicle, "vehicle_mass_kg")
    value, low, high = (
        v * force for v in (found.final.sensor["brake_mps2_pa"], *found.interval("brake_mps2_pa"))
    )  # fmt: skip
    wide = 1.96 * share * value
    down, up = float(np.hypot(value - low, wide)), float(np.hypot(high - value, wide))
    listed["brake_torque_per_pressure"] = {
        "value": value, "unit": "N m/Pa", "ci95": [value - down, value + up],
        "handed_in": found.given["brake_mps2_pa"] * force,
    }  # fmt: skip
    for number, effect in _HINTS.items():
        more = {**found.final.sensor, number: found.given.get(number, 0.0) + (0.03 if number == "lag_s" else 0.0)}
        tried = fit(found.model, more, found.final.noise, fixed=found.given)
        spread = standard_deviations(found.model, tried, found.block, found.given)[number]
        half = float(student.ppf(0.975, found.degrees)) * spread
        listed[f"hint_{effect}"] = {
            "value": tried.sensor[number], "unit": "s" if number == "lag_s" else "",
            "ci95": [tried.sensor[number] - half, tried.sensor[number] + half],
            "handed_in": found.given.get(number, 0.0), "gain": found.final.cost - tried.cost,
        }  # fmt: skip
    return listed
