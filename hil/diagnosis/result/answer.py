"""The answer as one plain object: verdict, causes, rivals, what to drive, what was wrong, what is gained."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.detection.nonparametric import BasisFunction, estimate_curve
from hil.diagnosis.detection.onset import nearest
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_chi2, delta_criterion, rival_hypotheses
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import candidate_key, segment_starts
from hil.diagnosis.detection.shape import ShapedCandidate
from hil.diagnosis.detection.threshold import CERTAIN, INDISTINGUISHABLE, UNDETECTABLE_SHARE
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.information import marginalise
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, variance_inflation_nonparametric
from hil.diagnosis.isolation.experiment import MAX_RECOMMENDATIONS, Recommendation, discriminating_manoeuvres, write
from hil.diagnosis.isolation.groups import IsolabilityGroup, isolability_group
from hil.diagnosis.isolation.intervals import half_width, intervals
from hil.diagnosis.result.cross_validation import HeldOutError, probabilities
from hil.diagnosis.result.residual_patterns import WORDS, ResidualPattern

_MOST_TIED = 5


@dataclass(frozen=True, eq=False)
class Answer:
    """What `explain` returns: ``json`` as printed, and all that the report shows."""

    json: dict[str, Any]
    diagnosis: Diagnosis
    held_out: list[HeldOutError]
    patterns: list[ResidualPattern]


def answer(
    found: Diagnosis, gains: list[HeldOutError], wrongs: list[ResidualPattern], extension: str | None, remarks: list[str],
    out: Path | None = None,
) -> Answer:  # fmt: skip
    """Put the answer together; manoeuvres to drive next are written into ``out``."""
    causes, tied = _causes(found), _tied(found)
    fitted = _rivals(found)
    rivals = [_rival(found, c, p) for c, p in fitted]
    known = {c["effect"] for c in (*causes, *rivals)}
    rivals += [entry for entry in _imitations(found, tied) if entry["effect"] not in known]
    verdict = _verdict(found, causes, tied)
    content = {
        "verdict": verdict,
        "causes": causes,
        "rivals": rivals,
        "undetectable_effects": found.undetectable_effects,
        "discriminating_manoeuvres": _decide_with(found, tied, fitted, out) if verdict == "cannot_tell_apart" else [],
        "residual_patterns": [
            {"channel": w.channel, "rms": w.rms, "noise": w.noise, "unit": w.unit, "pattern": w.pattern} for w in wrongs
        ],
        "held_out_error": {
            WORDS[g.channel]: {
                "before": g.before, "after": g.after, "ci95": [g.low, g.high], "tuned": g.tuned,
                "best_wrong": g.best_wrong,
            }
            for g in gains
        },
        "extension": extension,
        "missing": list(found.dataset.missing_channels),
        "remarks": remarks,
    }  # fmt: skip
    return Answer(content, found, gains, wrongs)


def _verdict(found: Diagnosis, causes: list[dict[str, Any]], tied: IsolabilityGroup | None) -> str:
    if not causes:
        effects = {item.candidate.effect.name for item in found.scores}
        return (
            "not_testable"
            if len(effects.intersection(found.undetectable_effects)) > UNDETECTABLE_SHARE * len(effects)
            else "none"
        )
    if any(isinstance(term.candidate, BasisFunction) for term in found.final.terms):
        return "unlisted"
    named = _named(found)
    if tied is not None and any(found.scores[k].candidate.effect.name not in named for k in tied.indices):
        return "cannot_tell_apart"
    for listed in found.selections:
        best, *others = rival_hypotheses(listed, named)
        for other in others:
            another = other.term.candidate.effect.name != best.term.candidate.effect.name
            if another and delta_criterion(other, best) < CERTAIN:
                return "cannot_tell_apart"
    return "named"


def _named(found: Diagnosis) -> set[str]:
    return {term.candidate.effect.name for term in found.final.terms}


def _causes(found: Diagnosis) -> list[dict[str, Any]]:
    """One entry an effect: its numbers together."""
    merged: dict[str, dict[str, Any]] = {}
    races = [rival_hypotheses(listed, _named(found)) for listed in found.hypotheses]
    for term, interval, listed in zip(found.final.terms, intervals(found), races, strict=True):
        effect, candidate = term.candidate.effect, term.candidate
        if isinstance(candidate, BasisFunction):
            merged.setdefault(effect.name, _unlisted(found, candidate, listed))
            continue
        chances = probabilities(listed)
        own = sum(
            p for c, p in zip(listed, chances, strict=True) if c.term.candidate.effect.name == effect.name
        )  # fmt: skip
        entry = merged.setdefault(
            effect.name,
            {
                "effect": effect.name, "title": effect.title, "injection_point": effect.joints[0] if effect.joints else "",
                "location": candidate.location, "parameters": {}, "probability": own, **_onset(found, term),
                "variables": [], "curve": [],
            },
        )  # fmt: skip
        entry["parameters"][candidate.parameter.name] = {
            "value": term.value, "unit": candidate.parameter.unit, "ci95": list(interval),
        }  # fmt: skip
        if isinstance(candidate, ShapedCandidate):
            entry["parameters"][candidate.shape.name] = {
                "value": candidate.at, "unit": candidate.shape.unit, "ci95": list(candidate.interval()),
            }  # fmt: skip
        entry["probability"] = max(entry["probability"], own)
    return list(merged.values())


def _onset(found: Diagnosis, term: Term) -> dict[str, Any]:
    """Where a cause begins, in its log and in the session: the logs in a row."""
    if term.onset is None:
        return {"onset": None, "onset_s": None}
    number, since_s = term.onset
    logs = [drive.log for drive in found.dataset.recordings]
    before = sum(float(log.t_s[-1] - log.t_s[0]) for log in logs[:number])
    begin = {"log": logs[number].name, "t_s": float(logs[number].t_s[0]) + since_s}
    return {"onset": begin, "onset_s": before + since_s}


def _unlisted(found: Diagnosis, piece: BasisFunction, listed: list[FittedHypothesis]) -> dict[str, Any]:
    """The entry of a law in no list: where, on what, and the curve with its band."""
    terms, covariance = found.final.terms, found.final.covariance
    own = [k for k, term in enumerate(terms) if isinstance(term.candidate, BasisFunction)]
    pieces = [term.candidate for term in terms if isinstance(term.candidate, BasisFunction)]
    error = variance_inflation_nonparametric(piece.term.name, piece.location)
    return {
        "effect": UNLISTED, "title": piece.effect.title, "injection_point": piece.term.injection_point, "location": piece.location,
        "parameters": {}, "probability": probabilities(listed)[0], "onset": None, "onset_s": None,
        "variables": [piece.variable], "adds": piece.term.adds,
        "curve": estimate_curve(pieces, [terms[k].value for k in own], error * covariance[np.ix_(own, own)]),
    }  # fmt: skip


def _rivals(found: Diagnosis) -> list[tuple[FittedHypothesis, float]]:
    """Contenders of other effects that fit nearly as well, with their probability."""
    rivals = []
    named = _named(found)
    for race in found.selections:
        listed = rival_hypotheses(race, named)
        for contender, chance in list(zip(listed, probabilities(listed), strict=True))[1:]:
            near = delta_chi2(contender, listed[0]) < INDISTINGUISHABLE
            if near and contender.term.candidate.effect.name not in named:
                rivals.append((contender, chance))
    return rivals


def _rival(found: Diagnosis, contender: FittedHypothesis, chance: float) -> dict[str, Any]:
    candidate, value = contender.term.candidate, contender.term.value
    half = half_width(candidate, value, max(contender.information, 1e-30) ** -0.5)
    return {
        "effect": candidate.effect.name, "title": candidate.effect.title, "location": candidate.location,
        "injection_point": candidate.effect.joints[0] if candidate.effect.joints else "",
        "parameters": {
            candidate.parameter.name: {
                "value": value, "unit": candidate.parameter.unit, "ci95": [value - half, value + half],
            }
        },
        "probability": chance, **_onset(found, contender.term), "variables": [], "curve": [],
    }  # fmt: skip


def _tied(found: Diagnosis) -> IsolabilityGroup | None:
    """What imitates the first cause within the noise, from the joint information of the data; begun when it is."""
    if not found.final.terms or found.information is None or isinstance(found.final.terms[0].candidate, BasisFunction):
        return None
    term, listed = found.final.terms[0], [score.candidate for score in found.scores]
    total = (
        found.information.total()
        if term.onset is None
        else found.information.since(nearest(segment_starts(found.dataset), term.onset))
    )
    projected = marginalise(total, found.information.nuisances, (), found.base.z, found.fitter.at_bounds(found.base.z))
    named = [candidate_key(candidate) for candidate in listed].index(candidate_key(term.candidate))
    return isolability_group(projected.q, listed, named, term.value)


def _imitations(found: Diagnosis, tied: IsolabilityGroup | None) -> list[dict[str, Any]]:
    """Tied causes as rivals, with the values that imitate, one entry an effect."""
    if tied is None:
        return []
    together = dict(zip(tied.members, tied.values, strict=True))
    apart = {**dict.fromkeys(tied.members, tied.separation), **dict(tied.pairs)}
    entries: dict[str, dict[str, Any]] = {}
    for index in tied.indices:
        score = found.scores[index]
        value = together.get(index, score.value)
        term = Term(score.candidate, value, found.final.terms[0].onset)
        contender = FittedHypothesis(term, found.base, 0.0, 0.0, score.information, found.noise)
        odds_against = float(np.exp(-0.5 * apart[index] ** 2))
        chance = odds_against / (1.0 + odds_against)
        entries.setdefault(score.candidate.effect.name, _rival(found, contender, chance))
    return list(entries.values())


def _decide_with(
    found: Diagnosis, tied: IsolabilityGroup | None, fitted: list[tuple[FittedHypothesis, float]], out: Path | None
) -> list[dict[str, Any]]:
    """Scenarios that tell the tied causes apart, the best first."""
    names = [term.candidate.name for term in found.final.terms[:1]]
    names += [contender.term.candidate.name for contender, _ in fitted]
    names += [found.scores[k].candidate.name for k in (() if tied is None else tied.indices)]
    unique = {name.split("@")[0].split(".")[0]: name for name in reversed(names)}  # the first of each effect
    if len(unique) < 2:
        return []
    advice = _advice(list(unique.values())[::-1][:_MOST_TIED])
    paths = write(advice, out) if out is not None else [None] * len(advice)
    return [one.as_json(path) for one, path in zip(advice, paths, strict=True)]


def _advice(names: list[str]) -> list[Recommendation]:
    """What tells all of a set apart; where no drive does, what tells the first from each of the others it can."""
    advice = discriminating_manoeuvres(names)
    if advice or len(names) == 2:
        return advice
    each = {name: discriminating_manoeuvres((names[0], name), 1) for name in names[1:]}
    told = [name for name in names[1:] if each[name]]
    advice = discriminating_manoeuvres((names[0], *told)) if 1 < len(told) < len(each) else []
    return advice or list({one.scenario: one for name in told for one in each[name]}.values())[:MAX_RECOMMENDATIONS]
