"""What others do with a residual and a list of signatures: nearest signature, least squares on all, sparse regression.

Each names one effect or `NONE` and gives probabilities of every effect and of `NONE`: the softmax of half of what BIC
differs by (Kass and Raftery 1995, Bayes factors), chances of something and nothing even and the former shared out over
all that was looked at (Scott and Berger 2010, on multiplicity).

With as many samples as a drive has, nearly all of that is on one name, right or not. Beside it stand *shares*: where
there is an alarm, what each effect explains as a part of what all do. No rival calls them probabilities, but they may
be read so, and mostly to its advantage.
"""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
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
    """``named``: an effect or `NONE`; ``probability`` of each effect and of `NONE`, sum 1; so ``shares``, if any."""

    named: str
    probability: Mapping[str, float]
    shares: Mapping[str, float] | None = None


def nearest(given: Problem) -> Guess:
    """The signature with the largest cosine to the residual; shares by the squares of cosines.

    Its part of the residual is b^2 / q, with b and q the products of the signature with the residual and itself; more
    than white noise makes in so many looks (chi-squared, Bonferroni) is an alarm.
    """
    gains = []
    for _, members in given.places:
        signature = given.signatures[:, list(members)].sum(axis=1)
        q = float(signature @ signature)
        gains.append(float(signature @ given.residual) ** 2 / q if q > 0.0 else 0.0)
    names = [name for name, _ in given.places]
    best = {name: max(gain for one, gain in zip(names, gains, strict=True) if one == name) for name in names}
    return _guess(names, np.array(gains), given, best)


def least_squares(given: Problem) -> Guess:
    """All signatures at once; the largest of Student's t names the effect; shares by t^2, summed by effect.

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
    t_squared = values**2 / np.maximum(spread, 1e-300)
    return _guess(given.effects, t_squared, given, _summed(given.effects, t_squared))


def sparse(given: Problem) -> Guess:
    """Sparse regression by pysindy's STLSQ (Brunton, Proctor and Kutz 2016), the signatures as its library.

    The library is a present: it holds the plant's own equations, which the method has to guess elsewhere. The threshold
    is the one of the smallest extended BIC (Chen and Chen 2008), n ln(RSS / n) + k (ln n + 2 ln m) for k of m terms;
    criteria choose among STLSQ's models in Mangan et al. 2017. The effect without which most of the residual is left
    over again is named; no term left is no alarm. Shares are by what the criterion loses without an effect: the energy
    of terms is all in pairs that cancel.
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
    named = max(worth, key=lambda name: worth[name], default=NONE)
    return Guess(named, chances, _shares(named, {name: max(gain, 0.0) for name, gain in worth.items()}, given))


def _summed(names: Sequence[str], values: Floats) -> dict[str, float]:
    """Values of one name together."""
    found = dict.fromkeys(names, 0.0)
    for name, value in zip(names, values, strict=True):
        found[name] += float(value)
    return found


def _shares(named: str, explained: Mapping[str, float], given: Problem) -> dict[str, float]:
    """What is ``explained`` by effect, as parts of 1; all on `NONE` where nothing is named."""
    found = dict.fromkeys((NONE, *(name for name, _ in given.places)), 0.0)
    if named == NONE:
        return found | {NONE: 1.0}
    total = sum(explained.values())
    return found | {name: value / total for name, value in explained.items()}


def _guess(names: Iterable[str], gains: Floats, given: Problem, explained: Mapping[str, float]) -> Guess:
    """The largest gain in chi-squared names, if noise does not make it; probabilities from all gains."""
    listed, looks = list(names), len(gains)
    best = int(np.argmax(gains))
    logs = 0.5 * (gains - np.log(given.samples)) - np.log(looks)
    named = listed[best] if gains[best] > chi2_quantile(looks, FALSE_ALARM_PROBABILITY) else NONE
    chances = _softmax([NONE, *listed], np.array([0.0, *logs]), given)
    return Guess(named, chances, _shares(named, explained, given))


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
