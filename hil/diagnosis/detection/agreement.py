"""Agreement of the manoeuvres: whether all that show a cause agree on its value, and by more than one kind of them.

Takes a fitted hypothesis; says what divides its gain, and whether its signature may be a direction of the model's form.
"""

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.consistency import Consistency, consistencies
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.simulation.excitation import segment_excitations

MODEL_FORM = frozenset({
    "timestamp_offset", "clock_drift", "ehb_dead_time", "ehb_bandwidth", "ehb_rate_limit", "motor_tau", "blend_sync",
    "pressure_location", "imu_filter", "tyre_relaxation", "rotating_inertia", "cog_height", "aero_lift", "pitch_dive",
    "load_sensitivity", "sus_compliance", "low_speed",
})  # fmt: skip
"""Effects that are a direction of the model's form: lateness, lags and load transfer. What the equations get wrong of
these in one kind of manoeuvre is no cause."""
_LEAST_ELSEWHERE = 2.0
"""Standard deviations from zero, on its own side, of such a value by all kinds of manoeuvres but the best."""


def agrees(fitter: Fitter, hypothesis: FittedHypothesis, least: float) -> bool:
    """Whether a cause gains ``least`` with the variance that its manoeuvres show, and more than one kind shows it.

    The gain is divided by the discrepancy of these logs already: the larger of both estimates of one error counts.
    """
    one = consistencies(fitter, hypothesis.model, hypothesis.noise)[-1]
    known = hypothesis.discrepancy_factor if np.isfinite(hypothesis.discrepancy_factor) else 1.0
    if hypothesis.gain < least * max(one.variance_inflation / known, 1.0):
        return False
    candidate = hypothesis.term.candidate
    is_form = candidate.form_sd > 0.0 and candidate.effect.name in MODEL_FORM
    return not is_form or shown_elsewhere(one, hypothesis.term.value, fitter.simulator.dataset)


def shown_elsewhere(one: Consistency, value: float, dataset: Dataset) -> bool:
    """Whether a value is away from zero without the kind of manoeuvre that says most of it.

    Kinds differ by what acts: brakes, motors, steering (`hil.diagnosis.simulation.excitation`).
    """
    kinds = np.array([int(kind) for recording in dataset.recordings for kind in segment_excitations(recording)])
    best = max(set(kinds.tolist()), key=lambda kind: float(one.information[kinds == kind].sum()))
    rest = kinds != best
    information = float(one.information[rest].sum())
    if information <= 0.0:
        return False
    elsewhere = value + float(one.score[rest].sum()) / information
    return bool(elsewhere * np.sign(value) * information**0.5 >= _LEAST_ELSEWHERE)
