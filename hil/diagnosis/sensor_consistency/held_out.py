"""What each channel misses, before and after, on manoeuvres that no fit saw."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.lateral import LateralModel
from hil.diagnosis.sensor_consistency.likelihood import Values, fit
from hil.diagnosis.sensor_consistency.longitudinal import LongitudinalModel
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.selection import SelectionResult
from hil.diagnosis.sensor_consistency.wheel_radius import WheelRadiusModel

FOLDS = 4
_DRAWS = 400
_STRONG = 0.25
Predict = Callable[[Mapping[str, float]], Floats]


@dataclass(frozen=True, eq=False)
class HeldOutError:
    """One channel: measured and foretold, and the root mean squares of what is missed.

    ``before`` as handed in, ``after`` with all that was learnt, ``tuned`` without any cause; ``held_out`` on manoeuvres
    the fit did not see (``low`` and ``high``: 95 % by bootstrap over manoeuvres), ``best_wrong`` likewise with the best
    number of another name.
    """

    channel: str
    unit: str
    measured: Floats
    nominal: Floats
    fitted: Floats
    before: float
    after: float
    tuned: float
    held_out: float
    low: float
    high: float
    best_wrong: float | None
    pattern: str


def held_out_errors(motion: Motion, models: Mapping[str, SelectionResult]) -> list[HeldOutError]:
    """Of every channel that a model foretells."""
    found = []
    for name, of in models.items():
        model = of.model
        if isinstance(model, LongitudinalModel):
            found.append(_miss(motion, of, "ax_mps2", "m/s2", motion.channels["ax_mps2"], model.predicted))
        elif isinstance(model, LateralModel):
            for channel, unit in (("yaw_rate_rad_s", "rad/s"), ("ay_mps2", "m/s2")):
                if motion.has(channel):
                    predict = _turned(model, channel)
                    found.append(_miss(motion, of, channel, unit, motion.channels[channel], predict))
        elif isinstance(model, BrakingModel):
            found.append(_miss(motion, of, "speed_in_stops", "m/s", model.speed, model.free_run))
        elif isinstance(model, WheelRadiusModel):
            for wheel in WHEELS:
                if wheel in of.final.sensor:
                    measured, predict = motion.channels[f"wheel_{wheel}"], _rolled(model, wheel)
                    found.append(_miss(motion, of, f"wheel_speed_{wheel}", "m/s", measured, predict))
        else:
            raise TypeError(f"{name}: no channel is foretold by {type(model).__name__}")
    return found


def _turned(model: LateralModel, channel: str) -> Predict:
    return lambda sensor: model.predicted(channel, sensor)


def _rolled(model: WheelRadiusModel, wheel: str) -> Predict:
    return lambda sensor: model.predicted(wheel, sensor)


def _miss(
    motion: Motion, found: SelectionResult, channel: str, unit: str, measured: Floats, predict: Predict
) -> HeldOutError:
    handed, learnt = predict(found.given), predict(found.parameters)
    tuned = predict({**found.given, **found.base.sensor})
    mask = (motion.moving > 0.5) & np.isfinite(measured) & np.isfinite(handed)
    own = _held_out(found, predict)
    wrong = _wrong(found)
    other = None if wrong is None else _rms(measured - _held_out(found, predict, wrong), mask)
    squares = _by_block(measured - own, mask, found.block)
    low, high = _interval(squares)
    return HeldOutError(
        channel, unit, measured, handed, learnt, _rms(measured - handed, mask), _rms(measured - learnt, mask),
        _rms(measured - tuned, mask),
        _root(squares), low, high, other, _pattern(motion, measured - handed, mask, found),
    )  # fmt: skip


def _held_out(found: SelectionResult, predict: Predict, sensor: Values | None = None) -> Floats:
    """Foretold by fits that did not see the manoeuvre; noise stays as it was found."""
    begin = found.final.sensor if sensor is None else sensor
    out = predict({**found.given, **begin})
    if not begin:
        return out
    for fold in range(min(FOLDS, int(found.block.max()) + 1)):
        test = found.block % FOLDS == fold
        trained = fit(
            found.model, begin, found.final.noise, fixed=found.given, weights=1.0 * ~test, rounds=15, only_sensor=True
        )
        out[test] = predict({**found.given, **trained.sensor})[test]
    return out


def _wrong(found: SelectionResult) -> Values | None:
    """The best single number in the place of the first cause."""
    if not found.steps or not found.steps[0].others:
        return None
    return min(found.steps[0].others.values(), key=lambda f: f.cost).sensor


def _by_block(left: Floats, mask: Floats, block: Floats) -> Floats:
    count = int(block.max()) + 1
    good = mask & np.isfinite(left)
    squares = np.bincount(block[good], left[good] ** 2, count)
    return np.column_stack((squares, np.bincount(block[good], minlength=count)))


def _root(squares: Floats) -> float:
    return float(np.sqrt(squares[:, 0].sum() / max(squares[:, 1].sum(), 1.0)))


def _rms(left: Floats, mask: Floats) -> float:
    good = mask & np.isfinite(left)
    return float(np.sqrt(np.mean(left[good] ** 2))) if good.any() else 0.0


def _interval(squares: Floats) -> tuple[float, float]:
    some = squares[squares[:, 1] > 0]
    drawn = np.random.default_rng(0).integers(0, len(some), (_DRAWS, len(some)))
    total = some[drawn].sum(axis=1)
    low, high = np.quantile(np.sqrt(total[:, 0] / np.maximum(total[:, 1], 1.0)), (0.025, 0.975))
    return float(low), float(high)


def _pattern(motion: Motion, left: Floats, mask: Floats, found: SelectionResult) -> str:
    """What the rest goes with, as rank correlations; it names no cause."""
    variables = {"acceleration of the wheels": motion.accel_mps2, "speed": motion.speed_mps, "time": motion.t_s}
    for name, what in (("yaw_rate_rad_s", "yaw rate"), ("ay_mps2", "lateral acceleration"), ("throttle", "throttle")):
        if motion.has(name):
            variables[what] = motion.channels[name]
    for name in ("pressure", "pressure_demand"):
        if motion.has(name):
            variables["pressure"] = motion.channels[name]
    listed = []
    step = max(round(0.2 / motion.cell_s), 1)
    for what, x in variables.items():
        good = mask & np.isfinite(x) & np.isfinite(left)
        if good[::step].sum() > 40 and np.ptp(x[good]) > 0.0 and np.ptp(left[good]) > 0.0:
            listed.append((float(spearmanr(x[good][::step], left[good][::step])[0]), what))
    listed = sorted((item for item in listed if abs(item[0]) > _STRONG), key=lambda item: -abs(item[0]))[:2]
    if listed:
        return "; ".join(f"{'grows' if r > 0 else 'falls'} with {what} ({r:+.2f})" for r, what in listed)
    offset = float(np.nanmean(left[mask])) / max(float(np.nanstd(left[mask])), 1e-12)
    return "constant offset" if abs(offset) > 0.7 else "no simple pattern" if found.steps else "noise"
