"""`explain` of coast-downs by speed alone: rolling resistance and drag against those stated, with 95 % intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.diagnosis.data.log import Floats, Log
from hil.diagnosis.manoeuvres.coasting import GRAVITY_MPS2, RoadLoad, Run, coast_downs, stated_road_load
from hil.diagnosis.manoeuvres.road_load import SLOPE, SLOW, TIME, WIND, A, B, Fit, fit, simulated, with_stated
from hil.diagnosis.manoeuvres.stops import speed_of
from hil.diagnosis.vehicle.extension_file import Extension, load_extension, write_extension
from hil.diagnosis.vehicle.priors import NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle
from plant.injection.theta import THETA
from plant.vectors import PARAMETER, P

METHOD: Final = (
    "f0 + f2 v^2 (SAE J1263) fitted to the speed itself (White and Korst, SAE 720099, 1972), slope and wind by both "
    "directions (ISO 10521-1), a slow disturbance in the likelihood; not corrected to standard conditions"
)
_TWO_SIDED_95 = 1.96
_DIFFERS = 3.0
"""Standard deviations, of found and stated together, from which on a coefficient is not as stated: two are tested, so
noise alone says so in one set of logs of 200."""
_DRAWS = 2000
_SHOWN: Final = {"rolling_resistance", "residual_drag", "road_grade", "headwind"}
"""Effects that slow a coasting car."""


@dataclass(frozen=True, eq=False)
class CoastDown:
    """What `explain` returns for coast-downs: the answer as JSON, and what the report is made of.

    Attributes
    ----------
    runs : the coast-downs.  found, stated : speeds by run, (cells,), open loop from each start.
    fitted : all unknowns.  load, stated_load : road load as found and as stated.
    """

    json: dict[str, Any]
    runs: Sequence[Run]
    found: Sequence[Floats]
    stated: Sequence[Floats]
    fitted: Fit
    load: RoadLoad
    stated_load: RoadLoad


def coast_down(
    logs: Sequence[Log], vehicle: Vehicle, extend: Path | None = None, out: Path | None = None
) -> CoastDown | None:
    """Road load from logs without measured forces; None where they are no coast-downs.

    Parameters
    ----------
    extend, out : as in `hil.diagnosis.explain.explain`.
    """
    runs = coast_downs(logs, vehicle)
    if not runs:
        return None
    vehicle = vehicle if extend is None else _extended(vehicle, load_extension(Path(extend)))
    nominal = stated_road_load(vehicle)
    fitted = fit(runs, nominal)
    load = RoadLoad(float(fitted.x[A]), float(fitted.x[B]), nominal.effective_kg)
    estimates = _estimates(vehicle, nominal, fitted, any(speed_of(log, 1.0)[1] == "wheels" for log in logs))
    differing = [name for name in ("f0", "f2") if abs(estimates[name]["sigmas"]) > _DIFFERS]
    causes, rivals = _causes(estimates, differing, len({run.direction for run in runs}) == 1)
    as_stated = with_stated(fitted, nominal)
    found, stated = ([simulated(run, x) for run in runs] for x in (fitted.x, as_stated))
    content = {
        "verdict": ("cannot_tell_apart" if "f0" in differing else "unlisted") if differing else "none",
        "causes": causes,
        "rivals": rivals,
        "undetectable_effects": sorted({effect.name for effect in THETA.effects} - _SHOWN),
        "discriminating_manoeuvres": [],
        "residual_patterns": [],
        "held_out_error": _held_out(runs, nominal),
        "extension": None if out is None else _write(Path(out), vehicle, estimates, len(runs)),
        "missing": ["without forces: only what slows a car that coasts is estimated, over its mass"],
        "remarks": [
            *_remarks(runs), *vehicle.remarks, *(f"{log.name}: {text}" for log in logs for text in log.remarks)
        ],
        "coast_down": {
            "method": METHOD,
            "estimates": estimates,
            "disturbance": {"sd_mps2": float(np.exp(fitted.x[SLOW])), "time_constant_s": float(np.exp(fitted.x[TIME]))},
            "effective_mass_kg": nominal.effective_kg,
            "runs": [
                {
                    "log": run.log, "t_s": run.begin_s, "direction": run.direction, "length_s": run.length_s,
                    "from_mps": float(run.speed_mps[0]), "to_mps": float(run.speed_mps[np.isfinite(run.speed_mps)][-1]),
                    "error_mps": _rms(run, own), "error_as_stated_mps": _rms(run, other),
                }
                for run, own, other in zip(runs, found, stated, strict=True)
            ],
        },
    }  # fmt: skip
    return CoastDown(content, runs, found, stated, fitted, load, nominal)


def _extended(vehicle: Vehicle, extension: Extension) -> Vehicle:
    """The car with the road load of an earlier extension file."""
    car = vehicle.parameters.vehicle
    rolling = extension.parameters.get("vehicle_rolling_resistance", [car.rolling_resistance])[0]
    drag = extension.parameters.get("vehicle_drag_coefficient", [car.drag_coefficient])[0]
    changed = replace(car, rolling_resistance=rolling, drag_coefficient=drag)
    return replace(vehicle, parameters=replace(vehicle.parameters, vehicle=changed))


def relative_half_width(vehicle: Vehicle, name: str) -> float:
    """Half-width of one of the car's numbers as a share of it; 0 where it is known exactly."""
    at = PARAMETER.slice(name).start
    own = [one.step[one.at.index(at)] for one in vehicle.nuisances if one.kind is NuisanceKind.VEHICLE and at in one.at]
    return 2.0 * abs(own[0] / float(vehicle.p[at])) if own and vehicle.p[at] else 0.0


def _estimates(vehicle: Vehicle, nominal: RoadLoad, fitted: Fit, by_wheels: bool) -> dict[str, dict[str, Any]]:
    """Coefficients with 95 % intervals, each beside what the set states."""
    car, p = vehicle.parameters.vehicle, vehicle.p
    mass, radius = relative_half_width(vehicle, "vehicle_mass_kg"), 0.0
    if by_wheels:
        radius = relative_half_width(vehicle, "wheel_rolling_radius_m")
    half = fitted.quantile * np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    weight, air = car.mass_kg * GRAVITY_MPS2, 0.5 * float(p[P.vehicle_air_density_kg_m3])
    f0, f2 = float(fitted.x[A]) * nominal.effective_kg, float(fitted.x[B]) * nominal.effective_kg
    half_f0 = float(np.hypot(half[A] * nominal.effective_kg, f0 * np.hypot(mass, radius)))
    half_f2 = float(np.hypot(half[B] * nominal.effective_kg, f2 * np.hypot(mass, radius)))
    rolling = relative_half_width(vehicle, "vehicle_rolling_resistance")
    drag = relative_half_width(vehicle, "vehicle_drag_coefficient")
    stated_f0, stated_f2 = nominal.a_mps2 * nominal.effective_kg, nominal.b_1_m * nominal.effective_kg

    def entry(value: float, half: float, unit: str, stated: float, stated_half: float) -> dict[str, Any]:
        both = np.hypot(half, stated_half) / _TWO_SIDED_95
        return {
            "value": value, "unit": unit, "ci95": [value - half, value + half], "stated": stated,
            "stated_ci95": [stated - stated_half, stated + stated_half],
            "sigmas": float((value - stated) / both) if both > 0.0 else 0.0,
        }  # fmt: skip

    # what rises with v^2 beside drag: rolling resistance with speed, less that of the load that lift takes off
    beside = car.rolling_resistance_speed_s2_m2 * weight
    lifted = (f0 / weight) * air * car.frontal_area_m2 * sum(car.lift_coefficient)
    area, area_stated = (f2 - beside + lifted) / air, car.drag_coefficient * car.frontal_area_m2
    slope_percent = 100.0 / GRAVITY_MPS2
    # the mass cancels in the coefficient but for its rotating share
    half_rr = float(np.hypot(half[A] * nominal.effective_kg, f0 * radius)) / weight
    return {
        "f0": entry(f0, half_f0, "N", stated_f0, stated_f0 * float(np.hypot(rolling, mass))),
        "f2": entry(f2, half_f2, "N s2/m2", stated_f2, stated_f2 * drag),
        "rolling_resistance": entry(f0 / weight, half_rr, "", car.rolling_resistance, car.rolling_resistance * rolling),
        "drag_area": entry(area, half_f2 / air, "m2", area_stated, area_stated * drag),
        "slope": entry(slope_percent * float(fitted.x[SLOPE]), slope_percent * float(half[SLOPE]), "%", 0.0, 0.5),
        "wind": entry(float(fitted.x[WIND]), float(half[WIND]), "m/s", 0.0, 16.0 / 3.6),
    }


def _causes(
    estimates: Mapping[str, Mapping[str, Any]], differing: Sequence[str], one_direction: bool
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Causes and rivals of coefficients that are not as stated: speed alone tells no tyre from a dragging pad."""
    causes: list[dict[str, Any]] = []
    rivals: list[dict[str, Any]] = []
    for name in differing:
        one = estimates[name]
        share, bounds = one["value"] / one["stated"] - 1.0, [end / one["stated"] - 1.0 for end in one["ci95"]]
        effect = "rolling_resistance" if name == "f0" else "unlisted"
        title = THETA.effect(effect).title if name == "f0" else "Drag off (coefficient, area or air density)"
        causes.append({
            "effect": effect, "title": title,
            "injection_point": "wheel.rolling_torque" if name == "f0" else "car.body_force", "location": "car",
            "parameters": {"gain": {"value": share, "unit": "", "ci95": bounds}},
            "probability": 0.5 if name == "f0" else 1.0, "onset": None, "onset_s": None, "variables": [], "curve": [],
        })  # fmt: skip
        for rival in ("residual_drag", *(("road_grade",) if one_direction else ())) if name == "f0" else ():
            rivals.append(causes[-1] | {"effect": rival, "title": THETA.effect(rival).title, "parameters": {}})
    return causes, rivals


def _held_out(runs: Sequence[Run], nominal: RoadLoad) -> dict[str, dict[str, Any]]:
    """Open-loop error of each run by a fit of the others, m/s; empty where a run is alone."""
    if len(runs) < 2:
        return {}
    squares: list[list[float]] = []
    for k, run in enumerate(runs):
        others = [one for j, one in enumerate(runs) if j != k]
        own, tuned = fit(others, nominal), fit(others, nominal, fixed=True)
        errors = [_rms(run, simulated(run, x)) for x in (with_stated(own, nominal), own.x, tuned.x)]
        squares.append([error**2 for error in errors])
    before, after, tuned_error = (float(np.sqrt(np.mean(column))) for column in np.array(squares).T)
    drawn = np.random.default_rng(0).integers(0, len(runs), (_DRAWS, len(runs)))
    low, high = np.quantile(np.sqrt(np.array(squares)[drawn, 1].mean(axis=1)), (0.025, 0.975))
    entry = {
        "before": before, "after": after, "ci95": [float(low), float(high)], "tuned": tuned_error, "best_wrong": None
    }  # fmt: skip
    return {"speed_in_coast_downs": entry}


def _rms(run: Run, speed: Floats) -> float:
    return float(np.sqrt(np.nanmean((run.speed_mps - speed) ** 2)))


def _remarks(runs: Sequence[Run]) -> list[str]:
    seconds = sum(run.length_s for run in runs)
    remarks = [
        f"no force is measured: {len(runs)} coast-downs, {seconds:.0f} s, give the road load; the car is taken to roll "
        "freely, with neither engine nor brakes"
    ]
    if len({run.direction for run in runs}) == 1:
        remarks.append(
            "all coast-downs in one direction: slope (within 0.5 %) and wind (within 16 km/h) widen the intervals; "
            "coast the other way, too, and say so by direction = -1 in logs.toml"
        )
    return remarks


def _write(folder: Path, vehicle: Vehicle, estimates: Mapping[str, Mapping[str, Any]], count: int) -> str:
    """Write the road load as ``extension.toml``; its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "extension.toml"
    drag = max(float(estimates["drag_area"]["value"]), 0.0) / vehicle.parameters.vehicle.frontal_area_m2
    rolling = max(float(estimates["rolling_resistance"]["value"]), 0.0)
    parameters = {"vehicle_rolling_resistance": [rolling], "vehicle_drag_coefficient": [drag]}
    write_extension(path, Extension(THETA.neutral(), parameters), f"Estimated from {count} coast-downs")
    return str(path)
