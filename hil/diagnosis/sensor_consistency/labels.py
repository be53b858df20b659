"""What the numbers of the models are called in the list of effects, and which other effects would look the same."""

from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.sensor_consistency.selection import RARE, SelectionResult
from plant.injection.theta import THETA

GRAVITY_MPS2 = 9.80665
INDISTINGUISHABLE = 4.6
"""Twice the log of the odds (ten to one) below which two names are not told apart."""
MISTAKES = (-1.0, 3.6, 1.0 / 3.6, GRAVITY_MPS2, 1.0 / GRAVITY_MPS2, -GRAVITY_MPS2, 0.1, 10.0, 256.0, 1.0 / 256.0)
"""Factors that a database, not a sensor, is wrong by: sign, km/h, g, a decimal, a byte (effects, 69)."""
_IMU_SCALE, _OF_A_SENSOR = 0.04, 0.2


@dataclass(frozen=True)
class Label:
    """An effect that a number may be: value = factor * change, ``usual`` size in the number's own unit."""

    effect: str
    parameter: str
    location: str
    factor: float
    usual: float


@dataclass(frozen=True, eq=False)
class Cause:
    """A number with its names, most likely first; ``value``, ``low`` and ``high`` are what it has
    changed by since it was handed in.

    ``number`` is of ``model``; ``channels`` say where it shows; ``exact`` is the mistake that it equals. ``instead``
    are other numbers that fit nearly as well in its place, each ``behind`` by what it has more of -2 log L.
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
    exact: float | None = None
    substitutes: tuple["Cause", ...] = ()
    delta_criterion: float = 0.0

    @property
    def is_ambiguous(self) -> bool:
        """Whether another effect does as well."""
        return len(self._near) > 1 or any(other.delta_criterion < INDISTINGUISHABLE for other in self.substitutes)

    @property
    def as_likely(self) -> tuple[str, ...]:
        """The effects that are not told apart, its first name first."""
        near = [
            name
            for cause in (self, *self.substitutes)
            if cause.delta_criterion < INDISTINGUISHABLE
            for name in cause._near
        ]
        return tuple(dict.fromkeys(name.effect for name in near))

    @property
    def _near(self) -> tuple[Label, ...]:
        """Names of the number itself that its size does not tell from the first."""
        least = self.log_density[0] * np.exp(-0.5 * INDISTINGUISHABLE)
        return tuple(name for k, name in enumerate(self.labels) if k == 0 or self.log_density[k] > least)

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Every effect it may be."""
        return tuple(dict.fromkeys(n.effect for cause in (self, *self.substitutes) for n in cause.labels))

    def rivals(self) -> list[dict[str, object]]:
        """All that it may be besides, but for what is a hundred times less likely."""
        own = [self.as_json(k) for k in range(1, len(self.labels)) if self.log_density[k] > RARE * self.log_density[0]]
        share = self._share
        return own + [
            other.as_json(k, share * float(np.exp(-0.5 * other.delta_criterion)))
            for other in self.substitutes
            for k in range(len(other.labels))
            if other.log_density[k] > RARE * other.log_density[0]
        ]

    @property
    def _share(self) -> float:
        """How likely it is this number and none of those that fit in its place."""
        return 1.0 / (1.0 + float(sum(np.exp(-0.5 * other.delta_criterion) for other in self.substitutes)))

    def as_json(self, at: int = 0, share: float | None = None) -> dict[str, object]:
        """As a cause (its first name), or a rival; ``share`` as `_share` if None."""
        name = self.labels[at]
        effect = THETA.effect(name.effect)
        joint = next((j for j in effect.injection_points if j == f"sensor.{name.location}"), effect.injection_points[0])
        low, high = sorted((name.factor * self.low, name.factor * self.high))
        parameter = {"value": name.factor * self.value, "unit": effect.parameter(name.parameter).unit}
        probability = (self._share if share is None else share) * self.log_density[at] / sum(self.log_density)
        return {
            "effect": name.effect, "title": effect.title, "injection_point": joint, "location": name.location,
            "parameters": {name.parameter: parameter | {"ci95": [low, high]}},
            "probability": probability, "onset": None, "onset_s": None, "variables": [], "curve": [],
            "channels": list(self.channels),
        }  # fmt: skip


def causes_of(model: str, found: SelectionResult, to_ground: bool) -> list[Cause]:
    """Every number that was taken up, by name."""
    taken = {step.parameter for step in found.steps}
    listed = []
    for step in found.steps:
        instead = tuple(
            replace(_cause(model, other, number, to_ground), delta_criterion=behind)
            for number, (other, behind) in step.substitutes.items()
            if number not in taken
        )
        listed.append(replace(_cause(model, found, step.parameter, to_ground), gain=step.gain, substitutes=instead))
    return listed


def _cause(model: str, found: SelectionResult, number: str, to_ground: bool) -> Cause:
    handed = found.given.get(number, 0.0)
    value, low, high = (_change(number, v, handed) for v in (found.final.sensor[number], *found.interval(number)))
    low, high = sorted((low, high))
    names, channels, exact = _names(model, number, value, (low, high), to_ground)
    odds = _odds(names, value)
    order = sorted(range(len(names)), key=lambda k: -odds[k])
    by_odds = tuple(names[k] for k in order), tuple(odds[k] for k in order)
    return Cause(model, number, *by_odds, value, low, high, 0.0, channels, exact)


def _change(number: str, value: float, handed: float) -> float:
    """What a number has become, beside what was handed in: scales as ratios, all else as differences."""
    if number.endswith("gain"):
        return (1.0 + value) / (1.0 + handed) - 1.0
    return value / handed - 1.0 if number == "brake_mps2_pa" else value - handed


def _odds(names: tuple[Label, ...], value: float) -> list[float]:
    """Density of a number of this size, were it each of these: Gauss, but no name is ever ruled out by size alone."""
    if len(names) == 1:
        return [1.0]
    return [float(np.exp(-0.5 * min((value / n.usual) ** 2, 60.0)) / n.usual) for n in names]


def _names(
    model: str, number: str, value: float, interval: tuple[float, float], to_ground: bool
) -> tuple[tuple[Label, ...], tuple[str, ...], float | None]:
    if number in ("gain", "ay_gain", "yaw_gain"):
        return _scale(number, value, interval, to_ground)
    if model == "wheels":
        return (Label("tyre_radius", "gain", number, -1.0, 0.01),), (f"wheel_speed_{number}_rad_s",), None
    if number == "delay_s":
        pressure = model == "braking"
        late = "pressure" if pressure else ("imu" if value > 0.0 else "wheel")
        channels = ("pressure",) if pressure else ("ax_mps2",) if value > 0.0 else ("wheel_speed",)
        return (Label("timestamp_offset", "delay_s", late, 1.0 if late == "imu" else -1.0, 0.02),), channels, None
    tied: dict[str, tuple[Label, ...]] = {
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
    seen = {"yaw_bias_rad_s": "yaw_rate_rad_s", "brake_mps2_pa": "pressure", "offset_pa": "pressure"}.get(
        number, "ax_mps2"
    )
    return tied[number], (seen,), None


def _scale(
    number: str, value: float, interval: tuple[float, float], to_ground: bool
) -> tuple[tuple[Label, ...], tuple[str, ...], float | None]:
    channel = {"gain": "ax_mps2", "ay_gain": "ay_mps2", "yaw_gain": "yaw_rate_rad_s"}[number]
    exact = next((m for m in MISTAKES if interval[0] <= m - 1.0 <= interval[1]), None)
    if exact is not None or abs(value) > _OF_A_SENSOR or number != "gain":
        return (Label("wrong_scale", "factor", "imu", 1.0, 2.0),), (channel,), exact
    names = [Label("imu_gain", "gain", "imu", 1.0, _IMU_SCALE)]
    if not to_ground:  # nobody measured the ground: the wheels' radius would look the same
        names.append(Label("tyre_radius", "gain", "car", 1.0, 0.015))
    return tuple(names), (channel,), None
