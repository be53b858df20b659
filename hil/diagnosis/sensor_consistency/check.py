"""`explain` for a car whose forces nobody measured: sensors are compared with the car's own motion."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.data.log import (
    MOTOR_DEMAND,
    MOTOR_TORQUE,
    PRESSURE,
    PRESSURE_DEMAND,
    WHEEL_SPEED,
    WHEELS,
    Floats,
    Log,
)
from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.coverage import missing, needs
from hil.diagnosis.sensor_consistency.headline import headline
from hil.diagnosis.sensor_consistency.held_out import HeldOutError, held_out_errors
from hil.diagnosis.sensor_consistency.labels import Cause, causes_of, simulated_effects
from hil.diagnosis.sensor_consistency.lateral import LateralModel
from hil.diagnosis.sensor_consistency.longitudinal import SLIP, LongitudinalModel, slip_prior
from hil.diagnosis.sensor_consistency.motion import Motion, measured_channels, motion_of
from hil.diagnosis.sensor_consistency.selection import Progress, SelectionResult, select_parameters
from hil.diagnosis.sensor_consistency.stops import estimates, fit_stops, nominal_braking, relative_sigma
from hil.diagnosis.sensor_consistency.threshold import DIVE, MIN_STOPS, ROLL, SPREAD, TRACK
from hil.diagnosis.sensor_consistency.wheel_radius import WheelRadiusModel
from hil.diagnosis.vehicle.extension_file import load_channels, write_channels
from hil.diagnosis.vehicle.spec import Vehicle
from plant.injection.theta import THETA

_PROPELLED_MPS2, _PROPELLED_S = 0.7, 5.0
"""Acceleration above which a car counts as propelled, and the time for which an unknown propulsion may last."""
_FLAT_MPS2 = 0.03
"""Slope, m/s2, below which an accelerometer shows no road: roads are 1 to 3 % (effects, 1), 0.1 m/s2 and more."""
_DEAD_GAIN = -0.5
"""Scale error below which a channel would not show the road."""
_LOCKED, _FREE = 0.3, 0.6
"""Correlation with the turn: of a locked axle at most, of the other one at least."""


@dataclass(frozen=True, eq=False)
class Consistency:
    """What `explain` returns without measured forces: the answer as JSON, and what the report is made of."""

    json: dict[str, Any]
    motion: Motion
    models: Mapping[str, SelectionResult]
    causes: Sequence[Cause]
    errors: Sequence[HeldOutError]


def why_not_simulatable(logs: Sequence[Log], radius_m: float) -> str:
    """Why the car cannot be simulated from these logs: forces were not measured, or not those that propel it.

    Empty where it can be simulated, and where there is no motion to compare sensors with. ``radius_m`` is the rolling
    radius.
    """
    measured = measured_channels(logs)
    if {*MOTOR_TORQUE} <= measured or {*MOTOR_DEMAND} <= measured:
        return ""
    if not ({*WHEEL_SPEED} <= measured or {"speed_mps", "ax_mps2"} <= measured):
        return ""
    if not ({*PRESSURE} <= measured or {*PRESSURE_DEMAND} <= measured):
        return (
            "neither brake pressures nor motor torques are measured, so the car cannot be simulated: "
            "sensors are compared with its motion"
        )
    motion = motion_of(logs, radius_m)
    propelled_s = float(((motion.accel_mps2 > _PROPELLED_MPS2) * motion.moving).sum()) * motion.cell_s
    if propelled_s < _PROPELLED_S:
        return ""
    return (
        f"the car gains speed for {propelled_s:.0f} s and the torque that propels it is not measured, so it cannot be "
        "simulated: sensors are compared with its motion, and pressure with deceleration in the stops"
    )


def check(
    logs: Sequence[Log], vehicle: Vehicle, reason: str, extend: Path | None, out: Path | None, progress: Progress
) -> Consistency:
    """Compare all channels with the motion.

    Parameters
    ----------
    reason : why the car is not simulated, the first remark.
    extend, out : as in `hil.diagnosis.explain.explain`.
    """
    motion = motion_of(logs, float(vehicle.parameters.wheel.rolling_radius_m))
    nominal = {} if extend is None else load_channels(Path(extend))
    models = _fit_models(motion, vehicle, nominal, progress)
    causes = [one for name, result in models.items() for one in causes_of(name, result, motion.has("speed_mps"))]
    causes.sort(key=lambda cause: -cause.gain)
    progress("held-out error by cross-validation")
    errors = held_out_errors(motion, models)
    extension = None
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        extension = str(Path(out) / "extension.toml")
        effects, notes = simulated_effects(causes)
        names = ", ".join(cause.labels[0].effect for cause in causes) or "no effect"
        head = (
            f"Estimated by a comparison of sensors: {names}",
            "[effects] for `run --extend`; [channels] for `explain --extend`, which starts from these values.",
        )
        channels = {name: result.parameters for name, result in models.items()}
        write_channels(Path(extension), effects, channels, (*head, *notes))
    named = [cause.as_json() for cause in causes]
    ambiguous = any(cause.is_ambiguous for cause in causes)
    undetectable = needs(motion, {name for cause in causes for name in cause.effects})
    content = {
        "verdict": "cannot_tell_apart" if ambiguous else "named" if causes else "none",
        "headline": headline(causes),
        "causes": named,
        "rivals": _rivals(causes, named),
        "undetectable_effects": sorted(undetectable),
        "discriminating_manoeuvres": _discriminating_manoeuvres(causes),
        "residual_patterns": [
            {"channel": e.channel, "rms": e.before, "noise": e.after, "unit": e.unit, "pattern": e.pattern}
            for e in errors
        ],
        "held_out_error": {
            e.channel: {
                "before": e.before, "after": e.held_out, "ci95": [e.low, e.high], "tuned": e.tuned,
                "best_wrong": e.best_wrong,
            }
            for e in errors
        },
        "extension": extension,
        "missing": missing(motion),
        "remarks": [
            reason, *vehicle.remarks, *_runs_away(motion), *_remarks(models, causes),
            *(f"{log.name}: {text}" for log in logs for text in log.remarks),
        ],
        "estimates": estimates(models.get("braking"), vehicle),
        "needs": undetectable,
        "channels_read": channels_read(logs),
    }  # fmt: skip
    return Consistency(content, motion, models, causes, errors)


def _fit_models(
    motion: Motion, vehicle: Vehicle, nominal: Mapping[str, Mapping[str, float]], progress: Progress
) -> dict[str, SelectionResult]:
    """The models that the channels allow, each fitted; ``nominal`` are values of an earlier extension, by model."""
    results: dict[str, SelectionResult] = {}
    wheels = motion.has(*(f"wheel_{w}" for w in WHEELS))
    tyre = vehicle.parameters.tyre
    slip = slip_prior(tyre.lkx * tyre.pkx1, relative_sigma(vehicle, "tyre_lkx"))
    if motion.has("ax_mps2"):
        progress("accelerometer against the wheels")
        radius = 0.0 if motion.has("speed_mps") else relative_sigma(vehicle, "wheel_rolling_radius_m")
        tolerance = {
            "gain": float(np.hypot(DIVE, radius)),
            "filter_s": 1.0 / (2.0 * np.pi * vehicle.parameters.sensor.imu_cutoff_hz),
        }
        results["along"] = select_parameters(
            LongitudinalModel(motion, slip if wheels else None), motion.segment_id, nominal.get("along", {}), tolerance,
            progress, nuisances=[SLIP] if wheels else (),
        )  # fmt: skip
    track = dict(zip("fr", vehicle.parameters.vehicle.track_m, strict=True))
    yaw_rate: Floats | None = motion.channels.get("yaw_rate_rad_s")
    if wheels and (yaw_rate is not None or motion.has("ay_mps2")):
        progress("yaw rate and lateral acceleration against the wheels")
        lateral = LateralModel(motion, track)
        results["turning"] = select_parameters(
            lateral, motion.segment_id, nominal.get("turning", {}), {"yaw_gain": TRACK, "ay_gain": ROLL}, progress,
            nuisances=lateral.nuisances,
        )  # fmt: skip
        fitted = results["turning"].parameters
        if yaw_rate is not None:
            yaw_rate = (yaw_rate - fitted.get("yaw_bias_rad_s", 0.0)) / (1.0 + fitted.get("yaw_gain", 0.0))
    if wheels:
        progress("wheel against wheel")
        radii = WheelRadiusModel(motion, track, yaw_rate)
        results["wheels"] = select_parameters(
            radii, motion.segment_id, nominal.get("wheels", {}), dict.fromkeys(WHEELS, SPREAD), progress, WHEELS,
            radii.nuisances,
        )  # fmt: skip
    if motion.has("pressure") or motion.has("pressure_demand"):
        fitted = results["along"].parameters if "along" in results else {}
        braking = BrakingModel(motion, fitted.get(SLIP, slip.typical) if wheels else 0.0)
        if len(braking.stops) >= MIN_STOPS:
            progress(f"{len(braking.stops)} stops: pressure against deceleration")
            stated = nominal_braking(vehicle) | dict(nominal.get("braking", {}))
            results["braking"] = fit_stops(braking, vehicle, stated, progress)
    return results


def _rivals(causes: Sequence[Cause], named: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The rivals of all causes, without effects that are ``named`` as a cause in the same channels."""
    known = [(one["effect"], one["channels"]) for one in named]
    return [rival for cause in causes for rival in cause.rivals() if (rival["effect"], rival["channels"]) not in known]


def _runs_away(motion: Motion) -> Iterator[str]:
    if motion.rolling:
        other = "rear" if motion.rolling == "front" else "front"
        yield f"the {other} wheels spin or lock: the car's speed is that of the {motion.rolling} wheels"


def _remarks(models: Mapping[str, SelectionResult], causes: Sequence[Cause]) -> Iterator[str]:
    for cause in causes:
        if cause.database_factor is not None:
            yield (
                f"{cause.channels[0]} reads {1.0 + cause.value:.2f} of the true value; the 95 % interval contains "
                f"{cause.database_factor:.4g}"
            )
        label = cause.labels[0]
        bounds = THETA.effect(label.effect).parameter(label.parameter)
        if not bounds.low <= label.factor * cause.value <= bounds.high:
            yield f"{label.effect}: outside its bounds, {bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()
    along = models.get("along")
    if along is not None and SLIP in along.parameters:
        slip = along.parameters[SLIP]
        yield f"the wheels slip by {slip:.4f} s2/m of the specific force, as tyres do: a nuisance parameter, no cause"
    if along is not None:
        slope = along.final.noise["slope_mps2"]
        if slope < _FLAT_MPS2 and along.parameters.get("gain", 0.0) > _DEAD_GAIN:
            yield (
                f"ax_mps2 feels no road: it shows a slope of at most {slope:.3f} m/s2. An accelerometer feels gravity: "
                "unless the road was flat, this channel is computed from the speed"
            )
    turning = models.get("turning")
    if turning is not None and isinstance(turning.model, LateralModel):
        correlation = turning.model.correlation
        for axle, name in (("f", "front"), ("r", "rear")):
            if abs(correlation[axle]) < _LOCKED and abs(correlation[turning.model.axle]) > _FREE:
                yield f"the {name} wheels turn alike in bends: a locked differential, or one signal for both"


def _discriminating_manoeuvres(causes: Sequence[Cause]) -> list[dict[str, Any]]:
    """Manoeuvres that show the indistinguishable effects, those that show most of them first.

    They are those of the list of effects: no scenario can be simulated for a car without measured forces.
    """
    shown: dict[str, list[str]] = {}
    for name in (name for cause in causes if cause.is_ambiguous for name in cause.indistinguishable):
        shown.setdefault(THETA.effect(name).manoeuvre, []).append(name)
    return [
        {"scenario": manoeuvre, "why": f"shows {', '.join(dict.fromkeys(names))}", "separation": None}
        for manoeuvre, names in sorted(shown.items(), key=lambda item: -len(item[1]))
    ]
