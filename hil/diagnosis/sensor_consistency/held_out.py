"""Held-out error of every predicted channel: nominal, extended, and with the best wrong parameter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.result.statistics import FOLDS, bootstrap_interval, pattern, root_mean_square, squares_by_segment
from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.lateral import LateralModel
from hil.diagnosis.sensor_consistency.likelihood import Values, fit
from hil.diagnosis.sensor_consistency.longitudinal import LongitudinalModel
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.selection import SelectionResult
from hil.diagnosis.sensor_consistency.wheel_radius import WheelRadiusModel

Predict = Callable[[Mapping[str, float]], Floats]
"""From parameters to a channel, (cells,)."""


@dataclass(frozen=True, eq=False)
class HeldOutError:
    """One channel, measured and predicted, (cells,) each, and the root mean squares of its residuals, in its unit.

    Attributes
    ----------
    nominal, fitted : predicted with nominal values, and with all that was fitted.
    before, after : root mean squares of their residuals.
    tuned : likewise with the nuisance parameters alone.
    held_out : on segments that no fit saw; ``low`` to ``high`` is its 95 % interval.
    best_wrong : held out, with the best other parameter in place of the first accepted one; None without one.
    pattern : what the nominal residual correlates with.
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
    """Held-out error of every channel that a model predicts.

    Raises
    ------
    TypeError
        A model is of no known class.
    """
    errors = []
    for name, result in models.items():
        model = result.model
        if isinstance(model, LongitudinalModel):
            errors.append(_error(motion, result, "ax_mps2", "m/s2", motion.channels["ax_mps2"], model.predict))
        elif isinstance(model, LateralModel):
            for channel, unit in (("yaw_rate_rad_s", "rad/s"), ("ay_mps2", "m/s2")):
                if motion.has(channel):
                    predict = partial(model.predict, channel)
                    errors.append(_error(motion, result, channel, unit, motion.channels[channel], predict))
        elif isinstance(model, BrakingModel):
            errors.append(_error(motion, result, "speed_in_stops", "m/s", model.speed, model.predict))
        elif isinstance(model, WheelRadiusModel):
            for wheel in [one for one in WHEELS if one in result.final.parameters]:
                measured, predict = motion.channels[f"wheel_{wheel}"], partial(model.predict, wheel)
                errors.append(_error(motion, result, f"wheel_speed_{wheel}", "m/s", measured, predict))
        else:
            raise TypeError(f"{name}: {type(model).__name__} predicts no channel")
    return errors


def _error(
    motion: Motion, result: SelectionResult, channel: str, unit: str, measured: Floats, predict: Predict
) -> HeldOutError:
    nominal, fitted = predict(result.nominal), predict(result.parameters)
    tuned = predict({**result.nominal, **result.base.parameters})
    valid = (motion.moving > 0.5) & np.isfinite(measured) & np.isfinite(nominal)

    def squares(predicted: Floats) -> Floats:
        residual = measured - predicted
        return squares_by_segment(residual, valid & np.isfinite(residual), result.segment_id)

    held_out, wrong = squares(_held_out(result, predict, result.final.parameters)), _best_wrong(result)
    low, high = bootstrap_interval(held_out[held_out[:, 1] > 0])
    return HeldOutError(
        channel, unit, measured, nominal, fitted,
        root_mean_square(squares(nominal)), root_mean_square(squares(fitted)), root_mean_square(squares(tuned)),
        root_mean_square(held_out), low, high,
        None if wrong is None else root_mean_square(squares(_held_out(result, predict, wrong))),
        _pattern(motion, measured - nominal, valid, bool(result.steps)),
    )  # fmt: skip


def _held_out(result: SelectionResult, predict: Predict, parameters: Values) -> Floats:
    """(cells,) predicted by fits of these parameters to the other folds of segments; noise stays."""
    predicted = predict({**result.nominal, **parameters})
    if not parameters:
        return predicted
    for fold in range(min(FOLDS, int(result.segment_id.max()) + 1)):
        test = result.segment_id % FOLDS == fold
        trained = fit(
            result.model, parameters, result.final.noise, fixed=result.nominal, weights=1.0 * ~test, iterations=15,
            fix_noise=True,
        )  # fmt: skip
        predicted[test] = predict({**result.nominal, **trained.parameters})[test]
    return predicted


def _best_wrong(result: SelectionResult) -> Values | None:
    """The best fit with another parameter in place of the first accepted one."""
    if not result.steps or not result.steps[0].others:
        return None
    return min(result.steps[0].others.values(), key=lambda f: f.cost).parameters


def _pattern(motion: Motion, residual: Floats, valid: Floats, explained: bool) -> str:
    """Pattern of a nominal residual; one without is noise if no parameter explains it."""
    variables = {"acceleration of the wheels": motion.accel_mps2, "speed": motion.speed_mps, "time": motion.t_s}
    for channel, name in (
        ("yaw_rate_rad_s", "yaw rate"), ("ay_mps2", "lateral acceleration"), ("throttle", "throttle"),
        ("pressure", "pressure"), ("pressure_demand", "pressure"),
    ):  # fmt: skip
        if motion.has(channel):
            variables[name] = motion.channels[channel]
    stride = max(round(0.2 / motion.cell_s), 1)
    return pattern(residual, valid, variables, stride, "no simple pattern" if explained else "noise")
