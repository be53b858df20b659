"""The answer as one plain object: verdict, causes, rivals, what to drive next, residual patterns, held-out error."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.detection.nonparametric import BasisFunction, estimate_curve
from hil.diagnosis.detection.onset import nearest
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_chi2, delta_criterion, rival_hypotheses
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import candidate_key, segment_starts
from hil.diagnosis.detection.shape import ShapedCandidate
from hil.diagnosis.detection.threshold import DISTINCT, INDISTINGUISHABLE, UNDETECTABLE_SHARE
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.information import marginalise
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, variance_inflation_nonparametric
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.estimation.uncertainty import half_width, intervals
from hil.diagnosis.isolation.experiment import (
    MAX_RECOMMENDATIONS,
    Recommendation,
    discriminating_manoeuvres,
    write,
)
from hil.diagnosis.isolation.groups import IsolabilityGroup, isolability_group
from hil.diagnosis.result.cross_validation import HeldOutError, probabilities
from hil.diagnosis.result.residual_patterns import WORDS, ResidualPattern

_MAX_COMPARED = 5
"""Effects of an isolability group between which a discriminating manoeuvre is sought, at most."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Result of `explain`: ``json`` as printed, and all that the report shows."""

    json: dict[str, Any]
    diagnosis: Diagnosis
    held_out: list[HeldOutError]
    patterns: list[ResidualPattern]


def answer(
    diagnosis: Diagnosis, held_out: list[HeldOutError], patterns: list[ResidualPattern], extension: str | None,
    remarks: list[str], out: Path | None = None,
) -> Answer:  # fmt: skip
    """Assemble the answer; discriminating manoeuvres are written into ``out``."""
    causes, group = _causes(diagnosis), _isolability_group(diagnosis)
    near = _near_hypotheses(diagnosis)
    rivals = [_rival(diagnosis, hypothesis, probability) for hypothesis, probability in near]
    known = {entry["effect"] for entry in (*causes, *rivals)}
    rivals += [entry for entry in _imitations(diagnosis, group) if entry["effect"] not in known]
    verdict = _verdict(diagnosis, causes, group)
    content = {
        "verdict": verdict,
        "causes": causes,
        "rivals": rivals,
        "undetectable_effects": diagnosis.undetectable_effects,
        "discriminating_manoeuvres": (
            _manoeuvres(diagnosis, group, near, out) if verdict == "cannot_tell_apart" else []
        ),
        "residual_patterns": [
            {"channel": p.channel, "rms": p.rms, "noise": p.noise, "unit": p.unit, "pattern": p.pattern}
            for p in patterns
        ],
        "held_out_error": {
            WORDS[e.channel]: {
                "before": e.before, "after": e.after, "ci95": [e.low, e.high], "tuned": e.tuned,
                "best_wrong": e.best_wrong,
            }
            for e in held_out
        },
        "extension": extension,
        "missing": list(diagnosis.dataset.missing_channels),
        "remarks": remarks,
        "channels_read": channels_read(recording.log for recording in diagnosis.dataset.recordings),
    }  # fmt: skip
    return Answer(content, diagnosis, held_out, patterns)


def _verdict(diagnosis: Diagnosis, causes: list[dict[str, Any]], group: IsolabilityGroup | None) -> str:
    if not causes:
        effects = {score.candidate.effect.name for score in diagnosis.scores}
        undetectable = effects.intersection(diagnosis.undetectable_effects)
        return "not_testable" if len(undetectable) > UNDETECTABLE_SHARE * len(effects) else "none"
    if any(isinstance(term.candidate, BasisFunction) for term in diagnosis.final.terms):
        return "unlisted"
    named = _named(diagnosis)
    if group is not None and any(diagnosis.scores[k].candidate.effect.name not in named for k in group.indices):
        return "cannot_tell_apart"
    for hypotheses in diagnosis.selections:
        best, *others = rival_hypotheses(hypotheses, named)
        for other in others:
            another = other.term.candidate.effect.name != best.term.candidate.effect.name
            if another and delta_criterion(other, best) < DISTINCT:
                return "cannot_tell_apart"
    return "named"


def _named(diagnosis: Diagnosis) -> set[str]:
    return {term.candidate.effect.name for term in diagnosis.final.terms}


def _entry(candidate: Candidate) -> dict[str, Any]:
    """What causes and rivals have in common."""
    effect = candidate.effect
    point = effect.injection_points[0] if effect.injection_points else ""
    return {"effect": effect.name, "title": effect.title, "injection_point": point, "location": candidate.location}


def _value(value: float, unit: str, interval: tuple[float, float]) -> dict[str, Any]:
    return {"value": value, "unit": unit, "ci95": list(interval)}


def _causes(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """One entry an effect, with all its parameters."""
    merged: dict[str, dict[str, Any]] = {}
    selections = [rival_hypotheses(hypotheses, _named(diagnosis)) for hypotheses in diagnosis.hypotheses]
    bounds = intervals(diagnosis.fitter, diagnosis.final, diagnosis.noise)
    for term, interval, hypotheses in zip(diagnosis.final.terms, bounds, selections, strict=True):
        effect, candidate = term.candidate.effect, term.candidate
        if isinstance(candidate, BasisFunction):
            merged.setdefault(effect.name, _nonparametric(diagnosis, candidate, hypotheses))
            continue
        shares = zip(hypotheses, probabilities(hypotheses), strict=True)
        own = sum(share for one, share in shares if one.term.candidate.effect.name == effect.name)
        new = _entry(candidate) | {"parameters": {}, "probability": own, **_onset(diagnosis, term)}
        entry = merged.setdefault(effect.name, new | {"variables": [], "curve": []})
        parameters, parameter = entry["parameters"], candidate.parameter
        parameters[parameter.name] = _value(term.value, parameter.unit, interval)
        if isinstance(candidate, ShapedCandidate):
            parameters[candidate.shape.name] = _value(candidate.at, candidate.shape.unit, candidate.interval())
        entry["probability"] = max(entry["probability"], own)
    return list(merged.values())


def _onset(diagnosis: Diagnosis, term: Term) -> dict[str, Any]:
    """The onset within its log, and within the session, in which the logs follow each other."""
    if term.onset is None:
        return {"onset": None, "onset_s": None}
    number, onset_s = term.onset
    logs = [recording.log for recording in diagnosis.dataset.recordings]
    before = sum(float(log.t_s[-1] - log.t_s[0]) for log in logs[:number])
    in_log = {"log": logs[number].name, "t_s": float(logs[number].t_s[0]) + onset_s}
    return {"onset": in_log, "onset_s": before + onset_s}


def _nonparametric(
    diagnosis: Diagnosis, function: BasisFunction, hypotheses: list[FittedHypothesis]
) -> dict[str, Any]:  # fmt: skip
    """The entry of a nonparametric term: injection point, variable, and the curve with its band."""
    terms, covariance = diagnosis.final.terms, diagnosis.final.covariance
    own = [k for k, term in enumerate(terms) if isinstance(term.candidate, BasisFunction)]
    functions = [term.candidate for term in terms if isinstance(term.candidate, BasisFunction)]
    inflation = variance_inflation_nonparametric(function.term.name, function.location)
    return {
        "effect": UNLISTED, "title": function.effect.title, "injection_point": function.term.injection_point,
        "location": function.location, "parameters": {}, "probability": probabilities(hypotheses)[0],
        "onset": None, "onset_s": None, "variables": [function.variable], "adds": function.term.adds,
        "curve": estimate_curve(functions, [terms[k].value for k in own], inflation * covariance[np.ix_(own, own)]),
    }  # fmt: skip


def _near_hypotheses(diagnosis: Diagnosis) -> list[tuple[FittedHypothesis, float]]:
    """Hypotheses with other effects that fit nearly as well, each with its posterior probability."""
    near = []
    named = _named(diagnosis)
    for selection in diagnosis.selections:
        hypotheses = rival_hypotheses(selection, named)
        for one, probability in list(zip(hypotheses, probabilities(hypotheses), strict=True))[1:]:
            close = delta_chi2(one, hypotheses[0]) < INDISTINGUISHABLE
            if close and one.term.candidate.effect.name not in named:
                near.append((one, probability))
    return near


def _rival(diagnosis: Diagnosis, hypothesis: FittedHypothesis, probability: float) -> dict[str, Any]:
    candidate, value = hypothesis.term.candidate, hypothesis.term.value
    half = half_width(candidate, value, max(hypothesis.information, 1e-30) ** -0.5)
    parameter = candidate.parameter
    return _entry(candidate) | {
        "parameters": {parameter.name: _value(value, parameter.unit, (value - half, value + half))},
        "probability": probability, **_onset(diagnosis, hypothesis.term), "variables": [], "curve": [],
    }  # fmt: skip


def _isolability_group(diagnosis: Diagnosis) -> IsolabilityGroup | None:
    """The isolability group of the first cause, from its onset on; None without a listed cause."""
    terms, information = diagnosis.final.terms, diagnosis.information
    if not terms or information is None or isinstance(terms[0].candidate, BasisFunction):
        return None
    term, candidates = terms[0], [score.candidate for score in diagnosis.scores]
    total = information.total()
    if term.onset is not None:
        total = information.since(nearest(segment_starts(diagnosis.dataset), term.onset))
    z = diagnosis.base.z
    marginal = marginalise(total, information.nuisances, (), z, diagnosis.fitter.at_bounds(z))
    named = [candidate_key(candidate) for candidate in candidates].index(candidate_key(term.candidate))
    return isolability_group(marginal.q, candidates, named, term.value)


def _imitations(diagnosis: Diagnosis, group: IsolabilityGroup | None) -> list[dict[str, Any]]:
    """Members of the isolability group as rivals, with the values that imitate, one entry an effect."""
    if group is None:
        return []
    values = dict(zip(group.members, group.values, strict=True))
    separations = {**dict.fromkeys(group.members, group.separation), **dict(group.pairs)}
    entries: dict[str, dict[str, Any]] = {}
    for index in group.indices:
        score = diagnosis.scores[index]
        term = Term(score.candidate, values.get(index, score.value), diagnosis.final.terms[0].onset)
        hypothesis = FittedHypothesis(term, diagnosis.base, 0.0, 0.0, score.information, diagnosis.noise)
        ratio = float(np.exp(-0.5 * separations[index] ** 2))
        entries.setdefault(score.candidate.effect.name, _rival(diagnosis, hypothesis, ratio / (1.0 + ratio)))
    return list(entries.values())


def _manoeuvres(
    diagnosis: Diagnosis, group: IsolabilityGroup | None, near: list[tuple[FittedHypothesis, float]], out: Path | None
) -> list[dict[str, Any]]:
    """Scenarios that isolate the first cause and its rivals from each other, the best first."""
    names = [term.candidate.name for term in diagnosis.final.terms[:1]]
    names += [hypothesis.term.candidate.name for hypothesis, _ in near]
    names += [diagnosis.scores[k].candidate.name for k in (() if group is None else group.indices)]
    unique = {name.split("@")[0].split(".")[0]: name for name in reversed(names)}  # the first of each effect
    if len(unique) < 2:
        return []
    recommended = _recommended(list(unique.values())[::-1][:_MAX_COMPARED])
    paths = write(recommended, out) if out is not None else [None] * len(recommended)
    return [one.as_json(path) for one, path in zip(recommended, paths, strict=True)]


def _recommended(names: list[str]) -> list[Recommendation]:
    """Manoeuvres that isolate all; where none does, those that isolate the first from as many others as possible."""
    recommended = discriminating_manoeuvres(names)
    if recommended or len(names) == 2:
        return recommended
    each = {name: discriminating_manoeuvres((names[0], name), 1) for name in names[1:]}
    isolable = [name for name in names[1:] if each[name]]
    if 1 < len(isolable) < len(each):
        recommended = discriminating_manoeuvres((names[0], *isolable))
    by_scenario = {one.scenario: one for name in isolable for one in each[name]}
    return recommended or list(by_scenario.values())[:MAX_RECOMMENDATIONS]
