"""What others do with a residual and a list of signatures: nearest signature, least squares on all, sparse regression.

Each names one effect or `NONE` and gives probabilities of every effect and of `NONE`: the softmax of half of what BIC
differs by (Kass and Raftery 1995, Bayes factors), chances of something and nothing even and the former shared out over
all that was looked at (Scott and Berger 2010, on multiplicity).
"""

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.threshold import FALSE_ALARM_PROBABILITY, chi2_quantile
from hil.validation.perf.signatures import Problem

NONE = "none"
_CONDITION = 1e10
_THRESHOLDS, _LEAST = 12, 2.0


@dataclass(frozen=True)
class Guess:
    """``named``: an effect or `NONE`; ``probability`` of each effect and of `NONE`, sum 1."""

    named: str
    probability: Mapping[str, float]


def nearest(given: Problem) -> Guess:
    """The signature with the largest cosine to the residual.

    Its part of the residual is b^2 / q, with b and q the products of the signature with the residual and itself; more
    than white noise makes in so many looks (chi-squared, Bonferroni) is an alarm.
    """
    gains = []
    for _, members in given.places:
        signature = given.signatures[:, list(members)].sum(axis=1)
        q = float(signature @ signature)
        gains.append(float(signature @ given.residual) ** 2 / q if q > 0.0 else 0.0)
    return _guess([name for name, _ in given.places], np.array(gains), given)


def least_squares(given: Problem) -> Guess:
    """All signatures at once; the largest of Student's t names the effect.

    The ridge keeps the condition of the normal equations at 1e10 and is none where that is so already; the covariance
    is the ridge estimate's, s^2 A^-1 G A^-1 with A = G + ridge (Hoerl and Kennard 1970), s^2 from the residual.
    The sample is large, so t^2 is taken as chi-squared.
    """
    scaled = given.signatures / np.linalg.norm(given.signatures, axis=0)
    sizes, modes = np.linalg.eigh(scaled.T @ scaled)
    ridge = max(0.0, (sizes[-1] - _CONDITION * sizes[0]) / (_CONDITION - 1.0))
    within = modes / (sizes + ridge)
    values = within @ (modes.T @ (scaled.T @ given.residual))
    left = given.residual - scaled @ values
    variance = float(left @ left) / max(given.samples - len(values), 1)
    spread = variance * np.einsum("ij,j,ij->i", within, np.maximum(sizes, 0.0), within)
    return _guess(given.effects, values**2 / np.maximum(spread, 1e-300), given)


def sparse(given: Problem) -> Guess:
    """Sparse regression by pysindy's STLSQ (Brunton, Proctor and Kutz 2016), the signatures as its library.

    The library is a present: it holds the plant's own equations, which the method has to guess elsewhere. The threshold
    is the one of the smallest extended BIC (Chen and Chen 2008), n ln(RSS / n) + k (ln n + 2 ln m) for k of m terms;
    criteria choose among STLSQ's models in Mangan et al. 2017. The effect without which most of the residual is left
    over again is named; no term left is no alarm.
    """
    from pysindy.optimizers import STLSQ

    length = np.linalg.norm(given.signatures, axis=0)
    scaled, terms = given.signatures / length, len(length)
    floor = 1e-12 * float(given.residual @ given.residual) + 1e-300

    def criterion(support: Iterable[int]) -> float:
        kept = list(support)
        fitted = np.linalg.lstsq(scaled[:, kept], given.residual)[0] if kept else np.zeros(0)
        left = given.residual - scaled[:, kept] @ fitted
        rss = max(float(left @ left), floor)
        fit = given.samples * np.log(rss / given.samples)
        return float(fit + len(kept) * (np.log(given.samples) + 2.0 * np.log(terms)))

    supports: set[tuple[int, ...]] = {()}
    for least in np.geomspace(_LEAST, max(2.0 * float(np.linalg.norm(given.residual)), 2.0 * _LEAST), _THRESHOLDS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a threshold that leaves nothing is an answer, not a mishap
            fitted = STLSQ(threshold=float(least), unbias=False).fit(scaled, given.residual)
        supports.add(tuple(np.flatnonzero(fitted.coef_[0]).tolist()))
    best = min(supports, key=criterion)
    worth = {
        name: criterion(k for k in best if given.effects[k] != name) - criterion(best)
        for name in dict.fromkeys(given.effects[k] for k in best)
    }
    chances = _softmax([NONE, *worth], np.array([0.0, *(0.5 * gain for gain in worth.values())]), given)
    return Guess(max(worth, key=lambda name: worth[name], default=NONE), chances)


def _guess(names: Iterable[str], gains: Floats, given: Problem) -> Guess:
    """The largest gain in chi-squared names, if noise does not make it; probabilities from all gains."""
    listed, looks = list(names), len(gains)
    best = int(np.argmax(gains))
    logs = 0.5 * (gains - np.log(given.samples)) - np.log(looks)
    named = listed[best] if gains[best] > chi2_quantile(looks, FALSE_ALARM_PROBABILITY) else NONE
    return Guess(named, _softmax([NONE, *listed], np.array([0.0, *logs]), given))


def _softmax(names: Iterable[str], logs: Floats, given: Problem) -> dict[str, float]:
    """Probabilities by name, those of one name together; 0 for effects that are not among them."""
    weights = np.exp(logs - logs.max())
    found = dict.fromkeys((NONE, *(name for name, _ in given.places)), 0.0)
    for name, share in zip(names, weights / weights.sum(), strict=True):
        found[name] += float(share)
    return found


RIVALS: Mapping[str, Callable[[Problem], Guess]] = {
    "pysindy STLSQ, our signatures as its library": sparse,
    "nearest signature": nearest,
    "least squares on all effects": least_squares,
}
"""Rivals by what they are."""
