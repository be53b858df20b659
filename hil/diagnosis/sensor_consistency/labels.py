"""Labels: which effects an accepted parameter may be, how likely each is, and the cause and rivals that follow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.diagnosis.sensor_consistency.selection import SelectionResult
from hil.diagnosis.sensor_consistency.threshold import IMU_SCALE, INDISTINGUISHABLE, MAX_SENSOR_SCALE, RARE
from plant.effects.effect import Scope
from plant.injection.theta import THETA

GRAVITY_MPS2 = 9.80665
DATABASE_FACTORS = (
    -1.0, 3.6, 1.0 / 3.6, GRAVITY_MPS2, 1.0 / GRAVITY_MPS2, -GRAVITY_MPS2, 0.1, 10.0, 256.0, 1.0 / 256.0,
)  # fmt: skip
"""Factors by which a signal database, not a sensor, is wrong: sign, km/h, g, a decimal, a byte (effects, 69)."""


@dataclass(frozen=True)
class Label:
    """An effect that a model's parameter may be.

    Attributes
    ----------
    effect, parameter, location : as in the list of effects.
    factor : the effect's parameter per change of the model's parameter.
    typical : standard deviation of the model's parameter if it is this effect.
    """

    effect: str
    parameter: str
    location: str
    factor: float
    typical: float


@dataclass(frozen=True, eq=False)
class Cause:
    """An accepted parameter with its labels.

    Attributes
    ----------
    model, parameter : the sensor model and its parameter.
    labels : the effects it may be, most likely first.
    log_density : log prior density of the value under each label.
    value, low, high : change from nominal, and its 95 % interval.
    gain : reduction of -2 log likelihood.
    channels : where it shows.
    database_factor : the one of `DATABASE_FACTORS` within the interval.
    substitutes : other parameters that fit nearly as well in its place.
    delta_criterion : of a substitute, its -2 log likelihood less that of the accepted parameter.
    """

    model: str
    parameter: str
    labels: tuple[Label, ...]
    log_density: tuple[float, ...]
    value: float
    low: float
    high: float
    gain: float
    channels: tuple[str, ...]
    database_factor: float | None = None
    substitutes: tuple["Cause", ...] = ()
    delta_criterion: float = 0.0

    @property
    def is_ambiguous(self) -> bool:
        """Whether another label or parameter explains the data as well."""
        others = (other.delta_criterion < INDISTINGUISHABLE for other in self.substitutes)
        return len(self._likely_labels()) > 1 or any(others)

    @property
    def indistinguishable(self) -> tuple[str, ...]:
        """The effects that these data do not distinguish, the most likely first."""
        near = [one for one in (self, *self.substitutes) if one.delta_criterion < INDISTINGUISHABLE]
        return tuple(dict.fromkeys(label.effect for one in near for label in one._likely_labels()))

    @property
    def effects(self) -> tuple[str, ...]:
        """Every effect that it may be."""
        return tuple(dict.fromkeys(label.effect for one in (self, *self.substitutes) for label in one.labels))

    def rivals(self) -> list[dict[str, object]]:
        """As JSON, the other labels and substitutes, but for those that are less likely by `RARE`."""
        return [self.as_json(k) for k in self._reported()[1:]] + [
            other.as_json(k, self._share * float(np.exp(-0.5 * other.delta_criterion)))
            for other in self.substitutes
            for k in other._reported()
        ]

    def as_json(self, at: int = 0, share: float | None = None) -> dict[str, object]:
        """As a cause or a rival, by one of its labels; ``share`` is the probability of this parameter."""
        label = self.labels[at]
        effect = THETA.effect(label.effect)
        points, at_sensor = effect.injection_points, f"sensor.{label.location}"
        injection_point = at_sensor if at_sensor in points else points[0]
        low, high = sorted((label.factor * self.low, label.factor * self.high))
        parameter = {"value": label.factor * self.value, "unit": effect.parameter(label.parameter).unit}
        density = np.exp(self.log_density)
        probability = (self._share if share is None else share) * float(density[at] / density.sum())
        return {
            "effect": label.effect, "title": effect.title, "injection_point": injection_point,
            "location": label.location, "parameters": {label.parameter: parameter | {"ci95": [low, high]}},
            "probability": probability, "onset": None, "onset_s": None, "variables": [], "curve": [],
            "channels": list(self.channels),
        }  # fmt: skip

    @property
    def _share(self) -> float:
        """Probability of this parameter, against its substitutes."""
        return 1.0 / (1.0 + float(sum(np.exp(-0.5 * other.delta_criterion) for other in self.substitutes)))

    def _likely_labels(self) -> list[Label]:
        """The first label, and those that the parameter's size does not distinguish from it."""
        least = self.log_density[0] - 0.5 * INDISTINGUISHABLE
        return [label for k, label in enumerate(self.labels) if k == 0 or self.log_density[k] > least]

    def _reported(self) -> list[int]:
        least = self.log_density[0] + math.log(RARE)
        return [k for k, log_density in enumerate(self.log_density) if log_density > least]


def causes_of(model: str, result: SelectionResult, to_ground: bool) -> list[Cause]:
    """A cause for every accepted parameter of a model; ``to_ground`` says that the ground speed was measured."""
    accepted = {step.parameter for step in result.steps}
    causes = []
    for step in result.steps:
        substitutes = tuple(
            replace(_cause(model, other, parameter, to_ground), delta_criterion=delta)
            for parameter, (other, delta) in step.substitutes.items()
            if parameter not in accepted
        )
        cause = _cause(model, result, step.parameter, to_ground)
        causes.append(replace(cause, gain=step.gain, substitutes=substitutes))
    return causes


def _cause(model: str, result: SelectionResult, parameter: str, to_ground: bool) -> Cause:
    nominal = result.nominal.get(parameter, 0.0)
    estimates = (result.final.parameters[parameter], *result.interval(parameter))
    value, *interval = (_change(parameter, v, nominal) for v in estimates)
    low, high = sorted(interval)
    labels, channel, factor = _labels(model, parameter, value, (low, high), to_ground)
    log_density = _log_density(labels, value)
    order = sorted(range(len(labels)), key=lambda k: -log_density[k])
    ordered = tuple(labels[k] for k in order), tuple(log_density[k] for k in order)
    return Cause(model, parameter, *ordered, value, low, high, 0.0, (channel,), factor)


def _change(parameter: str, value: float, nominal: float) -> float:
    """Change from nominal: of scales as a ratio less 1, of all else as a difference."""
    if parameter.endswith("gain"):
        return (1.0 + value) / (1.0 + nominal) - 1.0
    return value / nominal - 1.0 if parameter == "brake_mps2_pa" else value - nominal


def _log_density(labels: Sequence[Label], value: float) -> list[float]:
    """Normal log density of the value under each label, without constants, cut so that size alone excludes none."""
    return [-0.5 * min((value / label.typical) ** 2, 60.0) - math.log(label.typical) for label in labels]


def _labels(
    model: str, parameter: str, value: float, interval: tuple[float, float], to_ground: bool
) -> tuple[list[Label], str, float | None]:
    """Labels of a parameter, the channel it shows in, and the database's factor if it is one."""
    if parameter in ("gain", "ay_gain", "yaw_gain"):
        return _scale(parameter, value, interval, to_ground)
    if model == "wheels":
        return [Label("tyre_radius", "gain", parameter, -1.0, 0.01)], f"wheel_speed_{parameter}_rad_s", None
    if parameter == "delay_s":
        location = "pressure" if model == "braking" else "imu" if value > 0.0 else "wheel"
        channel = {"pressure": "pressure", "imu": "ax_mps2", "wheel": "wheel_speed"}[location]
        sign = 1.0 if location == "imu" else -1.0
        return [Label("timestamp_offset", "delay_s", location, sign, 0.02)], channel, None
    channels = {"yaw_bias_rad_s": "yaw_rate_rad_s", "brake_mps2_pa": "pressure", "offset_pa": "pressure"}
    return list(_LABELS[parameter]), channels.get(parameter, "ax_mps2"), None


_LABELS: dict[str, tuple[Label, ...]] = {
    "bias_mps2": (
        Label("imu_bias", "ax_mps2", "imu", 1.0, 0.1),
        Label("road_grade", "grade", "car", 1.0 / GRAVITY_MPS2, 0.02 * GRAVITY_MPS2),
        Label("imu_gain", "tilt_rad", "imu", 1.0 / GRAVITY_MPS2, 0.02 * GRAVITY_MPS2),
    ),
    "drift_mps3": (Label("imu_bias", "drift_mps3", "imu", 1.0, 0.002),),
    "filter_s": (Label("imu_filter", "time_s", "imu", 1.0, 0.02),),
    "cross": (Label("imu_gain", "cross", "imu", 1.0, 0.02),),
    "ahead_m": (Label("imu_position", "x_m", "imu", 1.0, 0.3),),
    "beside_m": (Label("imu_position", "y_m", "imu", 1.0, 0.15),),
    "yaw_bias_rad_s": (Label("imu_bias", "yaw_rate_rad_s", "imu", 1.0, 0.005),),
    "offset_pa": (Label("pressure_offset", "offset_pa", "pressure", 1.0, 1e5),),
    "brake_mps2_pa": (
        Label("pad_mu_gain", "gain", "car", 1.0, 0.15),
        Label("pressure_gain", "gain", "car", 1.0, 0.15),
        Label("mass_offset", "mass_kg", "car", -1.0, 0.1),
    ),
}
"""Labels by parameter; twins share a column of the Jacobian."""


def _scale(
    parameter: str, value: float, interval: tuple[float, float], to_ground: bool
) -> tuple[list[Label], str, float | None]:
    channel = {"gain": "ax_mps2", "ay_gain": "ay_mps2", "yaw_gain": "yaw_rate_rad_s"}[parameter]
    factor = next((one for one in DATABASE_FACTORS if interval[0] <= one - 1.0 <= interval[1]), None)
    if factor is not None or abs(value) > MAX_SENSOR_SCALE or parameter != "gain":
        return [Label("wrong_scale", "gain", "imu", 1.0, 2.0)], channel, factor
    labels = [Label("imu_gain", "gain", "imu", 1.0, IMU_SCALE)]
    if not to_ground:  # without a ground speed the wheels' radius looks the same
        labels.append(Label("tyre_radius", "gain", "car", 1.0, 0.015))
    return labels, channel, None


def simulated_effects(causes: Sequence[Cause]) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Effects by name that a simulation can have, as in the extension file, and notes on the causes that it cannot."""
    effects: dict[str, dict[str, Any]] = {}
    notes = []
    for cause in causes:
        name = cause.labels[0]
        effect = THETA.effect(name.effect)
        parameter = effect.parameter(name.parameter)
        value = name.factor * cause.value
        label = f"{name.effect}.{name.parameter} = {value:.6g} ({name.location}, {', '.join(cause.channels)})"
        if name.effect == "wrong_scale":
            notes.append(f"not simulated: {label}: correct the channel map, not the car")
        elif cause.model == "braking" and name.effect != "timestamp_offset":
            notes.append(f"not simulated: {label}: a parameter of that car")
        elif not parameter.low <= value <= parameter.high:
            notes.append(f"not simulated: {label}: outside {parameter.low:g} to {parameter.high:g}")
        else:
            entry = effects.setdefault(name.effect, {})
            if effect.scope in (Scope.WHEEL, Scope.NODE, Scope.AXLE) and name.location in effect.scope.members:
                entry.setdefault(name.parameter, {})[name.location] = value
            else:
                entry[name.parameter] = value
    return effects, notes
