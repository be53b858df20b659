"""Candidates that begin in the middle of the logs, screened by manoeuvre.

The signature of a cause that was not always there is little of the one that was: from half of the data on it explains
half of what it could, and numbers of the vehicle take their part of that as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.onset import MIN_SNR_BEFORE_ONSET, OnsetTime
from hil.diagnosis.detection.score_test import ScoreTest, rescored, score
from hil.diagnosis.estimation.information import InformationBlocks, marginalise_from_onset


def scan_onset_by_segment(
    listed: Sequence[ScoreTest], found: InformationBlocks, accepted: int, z: Floats, held: Sequence[int], begins: Sequence[OnsetTime],
    price: float,
) -> list[ScoreTest]:  # fmt: skip
    """Each candidate with the manoeuvre from which on it explains more, less the price, than as always there.

    Parameters
    ----------
    accepted : causes in the model, whose columns come first among those of ``found``.
    z : the vehicle's numbers now, in standard deviations; those that are ``held`` take no part.
    begins : of each manoeuvre, drive and s in it.  price : what the choice of one takes off the gain.
    """
    columns = [[accepted + k for k in item.candidate.columns] for item in listed]
    b, q = marginalise_from_onset(found, columns, range(accepted), z, held)
    return [_later(item, b[:, k], q[:, k], begins, price) for k, item in enumerate(listed)]


def _later(item: ScoreTest, b: Floats, q: Floats, begins: Sequence[OnsetTime], price: float) -> ScoreTest:
    if item.replayed:
        return item
    block = 1 + int(np.argmax(b[1:] ** 2 / np.maximum(q[1:], 1e-30))) if len(b) > 1 else 0
    from_there = score(item.candidate, float(b[block]), float(q[block]))
    before = max(float(q[0] - q[block]), 0.0)
    if block == 0 or abs(from_there.value) * before**0.5 < MIN_SNR_BEFORE_ONSET:
        return item
    drives = [drive for drive, _ in begins]
    logs = drives if len(set(drives)) > 1 else range(len(drives))
    if _beside_the_best_log(from_there.value * -np.diff(b, append=0.0)[block:], logs[block:]) < MIN_SNR_BEFORE_ONSET**2:
        return item  # what a model gets wrong in one manoeuvre is no beginning
    begun = replace(item, onset=begins[block], onset_penalty=price)
    begun = rescored(begun, from_there.value, from_there.raw_gain, from_there.information)
    return begun if begun.gain > item.gain and begun.log_bayes_factor > item.log_bayes_factor else item


def _beside_the_best_log(gains: Floats, drives: Sequence[int]) -> float:
    """Gain of manoeuvres in all logs but the one that gains most; of a single log, in all but that manoeuvre."""
    logs = np.array(drives)
    return float(gains.sum()) - max(float(gains[logs == log].sum()) for log in set(logs.tolist()))
