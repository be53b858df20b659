"""The second way of `explain`: no force was measured, so the sensors are held against the car's own motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
from hil.diagnosis.sensor_consistency.braking import LEAST_STOPS, BrakingModel
from hil.diagnosis.sensor_consistency.coverage import missing, needs
from hil.diagnosis.sensor_consistency.held_out import HeldOutError, held_out_errors
from hil.diagnosis.sensor_consistency.labels import Cause, causes_of
from hil.diagnosis.sensor_consistency.lateral import LateralModel
from hil.diagnosis.sensor_consistency.longitudinal import SLIP, LongitudinalModel, known_slip
from hil.diagnosis.sensor_consistency.memory import load_channels, write_channels
from hil.diagnosis.sensor_consistency.motion import Motion, motion_of
from hil.diagnosis.sensor_consistency.selection import Progress, SelectionResult, select_parameters
from hil.diagnosis.sensor_consistency.stops import estimates, nominal_braking, relative_sigma, stop_search
from hil.diagnosis.sensor_consistency.wheel_radius import SPREAD, WheelRadiusModel
from hil.diagnosis.vehicle.spec import Vehicle
from plant.injection.theta import THETA

_ROLL = 0.15  # the body rolls, and its accelerometer with it (effects, 56)
_DIVE = 0.02  # its nose goes down by 1 to 1.5 deg/g, and the accelerometer with it (effects, 8)
_TRACK = 0.03
_PULLED_MPS2, _PULLED_S = 0.7, 5.0
_NO_ROAD = 0.03
"""Slope, m/s2, below which an accelerometer feels no road: roads are 1 to 3 % (effects, 1), 0.1 m/s2 and more."""
_DEAD = -0.5
"""Scale, of 1, off by which a channel would not show a road it felt."""


@dataclass(frozen=True, eq=False)
class Consistency:
    """What `explain` returns where no force was measured: ``json`` as printed, and what the report shows."""

    json: dict[str, Any]
    motion: Motion
    models: Mapping[str, SelectionResult]
    causes: Sequence[Cause]
    misses: Sequence[HeldOutError]


def why_not_simulatable(logs: Sequence[Log], radius_m: float) -> str:
    """Why the logs cannot be replayed, empty where they can: no torque is measured, or none that pulls the car."""
    there = set.intersection(*(set(log.channels) for log in logs))
    if {*MOTOR_TORQUE} <= there or {*MOTOR_DEMAND} <= there:
        return ""
    if not ({*WHEEL_SPEED} <= there or {"speed_mps", "ax_mps2"} <= there):
        return ""  # nothing to compare
    if not ({*PRESSURE} <= there or {*PRESSURE_DEMAND} <= there):
        return "neither pressures nor motor torques are measured: forces cannot be replayed, sensors are compared"
    motion = motion_of(logs, radius_m)
    pulled = float(((motion.accel_mps2 > _PULLED_MPS2) * motion.moving).sum()) * motion.cell_s
    if pulled < _PULLED_S:
        return ""
    return (
        f"the car gains speed for {pulled:.0f} s and no channel says what pulls it: not replayed; "
        "sensors are compared, and the stops by themselves"
    )


def check(
    logs: Sequence[Log], vehicle: Vehicle, why: str, extend: Path | None, out: Path | None, say: Progress
) -> Consistency:
    """Compare all channels with the motion; see `hil.diagnosis.explain.explain`."""
    motion = motion_of(logs, float(vehicle.parameters.wheel.rolling_radius_m))
    handed = {} if extend is None else load_channels(Path(extend))
    say("noise, and the accelerometer against the wheels")
    models = _models(motion, vehicle, handed, say)
    causes = [cause for name, found in models.items() for cause in causes_of(name, found, motion.has("speed_mps"))]
    causes.sort(key=lambda c: -c.gain)
    say("measuring the gain on held-out manoeuvres")
    missed = held_out_errors(motion, models)
    written = None
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        written = str(Path(out) / "extension.toml")
        write_channels(Path(written), models, causes)
    listed = [c.as_json() for c in causes]
    rivals = _rivals(causes, listed)
    tied = any(c.is_ambiguous for c in causes)
    told = needs(motion, {name for c in causes for name in c.alternatives})
    content = {
        "verdict": "cannot_tell_apart" if tied else "named" if causes else "none",
        "causes": listed,
        "rivals": rivals,
        "undetectable_effects": sorted(told),
        "discriminating_manoeuvres": _decide_with(causes),
        "residual_patterns": [
            {"channel": m.channel, "rms": m.before, "noise": m.after, "unit": m.unit, "pattern": m.pattern}
            for m in missed
        ],
        "held_out_error": {
            m.channel: {
                "before": m.before, "after": m.held_out, "ci95": [m.low, m.high], "tuned": m.tuned,
                "best_wrong": m.best_wrong,
            }
            for m in missed
        },
        "extension": written,
        "missing": missing(motion),
        "remarks": [
            why, *vehicle.remarks, *_remarks(models, causes), *(f"{g.name}: {t}" for g in logs for t in g.remarks)
        ],
        "estimates": estimates(models.get("braking"), motion, vehicle),
        "needs": told,
    }  # fmt: skip
    return Consistency(content, motion, models, causes, missed)


def _models(
    motion: Motion, vehicle: Vehicle, handed: Mapping[str, Mapping[str, float]], say: Progress
) -> dict[str, SelectionResult]:
    found: dict[str, SelectionResult] = {}
    radius = relative_sigma(vehicle, "wheel_rolling_radius_m")
    wheels = motion.has(*(f"wheel_{w}" for w in ("fl", "fr", "rl", "rr")))
    tyre = vehicle.parameters.tyre
    slip = known_slip(tyre.lkx * tyre.pkx1, relative_sigma(vehicle, "tyre_lkx"))
    if motion.has("ax_mps2"):
        tolerance = {
            "gain": float(np.hypot(_DIVE, 0.0 if motion.has("speed_mps") else radius)),
            "filter_s": 1.0 / (2.0 * np.pi * vehicle.parameters.sensor.imu_cutoff_hz),
        }
        along = LongitudinalModel(motion, slip if wheels else None)
        known = handed.get("along", {})
        found["along"] = select_parameters(along, motion.block, known, tolerance, say, always=[SLIP] if wheels else ())
    track = dict(zip("fr", vehicle.parameters.vehicle.track_m, strict=True))
    turn: Floats | None = motion.channels.get("yaw_rate_rad_s")
    if wheels and (turn is not None or motion.has("ay_mps2")):
        say("yaw rate and lateral acceleration against the wheels")
        model, known = LateralModel(motion, track), handed.get("turning", {})
        tolerance = {"yaw_gain": _TRACK, "ay_gain": _ROLL}
        found["turning"] = select_parameters(model, motion.block, known, tolerance, say, always=model.unknown)
        numbers = found["turning"].parameters
        if turn is not None:
            turn = (turn - numbers.get("yaw_bias_rad_s", 0.0)) / (1.0 + numbers.get("yaw_gain", 0.0))
    if wheels:
        say("wheel against wheel")
        found["wheels"] = _wheel_scales(motion, track, turn, handed.get("wheels", {}), say)
    if motion.has("pressure") or motion.has("pressure_demand"):
        known = found["along"].parameters if "along" in found else {}
        braking = BrakingModel(motion, known.get(SLIP, slip.usual) if wheels else 0.0)
        if len(braking.stops) >= LEAST_STOPS:
            say(f"{len(braking.stops)} stops: pressure against deceleration")
            nominal = nominal_braking(vehicle) | dict(handed.get("braking", {}))
            found["braking"] = stop_search(braking, motion, vehicle, nominal, say)
    return found


def _wheel_scales(
    motion: Motion, track: Mapping[str, float], turn: Floats | None, handed: Mapping[str, float], say: Progress
) -> SelectionResult:
    """One wheel unlike the others: the mean of all is the vehicle's radius, which is known to its tolerance only."""
    model = WheelRadiusModel(motion, track, turn)
    return select_parameters(model, motion.block, handed, dict.fromkeys(WHEELS, SPREAD), say, WHEELS, model.unknown)


def _rivals(causes: Sequence[Cause], listed: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """All that the causes may be besides, but for what is ``listed`` of the same channels already."""
    told = [(one["effect"], one["channels"]) for one in listed]
    return [rival for cause in causes for rival in cause.rivals() if (rival["effect"], rival["channels"]) not in told]


def _remarks(models: Mapping[str, SelectionResult], causes: Sequence[Cause]) -> list[str]:
    said = []
    for c in causes:
        if c.exact is not None:
            said.append(f"{c.channels[0]} reads {1.0 + c.value:.2f} of the truth; {c.exact:.4g} lies in the interval")
        limit = THETA.effect(c.labels[0].effect).parameter(c.labels[0].parameter)
        if not limit.low <= c.labels[0].factor * c.value <= limit.high:
            said.append(
                f"{c.labels[0].effect}: larger than any sensor's ({limit.low:g} to {limit.high:g} {limit.unit})"
            )
    along = models.get("along")
    if along is not None and SLIP in along.parameters:
        said.append(f"the wheels slip by {along.parameters[SLIP]:.4f} s2/m of the specific force: the tyres, no cause")
    if along is not None and along.final.noise["slope_mps2"] < _NO_ROAD and along.parameters.get("gain", 0.0) > _DEAD:
        said.append(
            f"ax_mps2 feels no road: a slope of {along.final.noise['slope_mps2']:.3f} m/s2 at most goes with it. "
            "An accelerometer feels gravity: unless the road was flat, this channel is computed from the speed"
        )
    turning = models.get("turning")
    if turning is not None and isinstance(turning.model, LateralModel):
        for axle, follows in turning.model.follows.items():
            if abs(follows) < 0.3 and abs(turning.model.follows[turning.model.axle]) > 0.6:
                name = {"f": "front", "r": "rear"}[axle]
                said.append(f"the {name} wheels turn alike in bends: a locked differential, or one signal for both")
    return said


def _decide_with(causes: Sequence[Cause]) -> list[dict[str, Any]]:
    """Standard manoeuvres that show the tied effects; no scenario drives a car whose forces nobody measures."""
    shown: dict[str, list[str]] = {}
    for name in (name for c in causes if c.is_ambiguous for name in c.as_likely):
        shown.setdefault(THETA.effect(name).manoeuvre, []).append(name)
    return [
        {"scenario": manoeuvre, "why": f"shows {', '.join(dict.fromkeys(names))}", "separation": None}
        for manoeuvre, names in sorted(shown.items(), key=lambda item: -len(item[1]))
    ]
