"""Causes and rivals as entries of the JSON, each with parameters, onset, and probability within its step."""

from typing import Any

import numpy as np

from hil.diagnosis.detection.candidates import inseparable_forward
from hil.diagnosis.detection.nonparametric import BasisFunction, estimate_curve
from hil.diagnosis.detection.onset import nearest
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_chi2, rival_hypotheses
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import candidate_key, segment_starts
from hil.diagnosis.detection.shape import ShapedCandidate
from hil.diagnosis.detection.threshold import INDISTINGUISHABLE
from hil.diagnosis.estimation.information import marginalise
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, variance_inflation_nonparametric
from hil.diagnosis.estimation.terms import PRIOR_SD_IN_TYPICAL_SIZES, Candidate, log_prior
from hil.diagnosis.estimation.uncertainty import half_width, intervals
from hil.diagnosis.isolation.groups import IsolabilityGroup, isolability_group
from hil.diagnosis.result.cross_validation import probabilities
from hil.diagnosis.result.phrases import sentence
from hil.diagnosis.result.probabilities import by_effect, with_imitations
from plant.injection.theta import THETA

Entry = dict[str, Any]


def named_effects(diagnosis: Diagnosis) -> set[str]:
    """Names of the effects of the final model."""
    return {term.candidate.effect.name for term in diagnosis.final.terms}


def candidate_name(entry: Entry) -> str:
    """Name of the candidate of an entry (`hil.diagnosis.estimation.terms.Candidate.name`)."""
    strengths = THETA.effect(entry["effect"]).strengths
    parameter = next(name for name in entry["parameters"] if name in {one.name for one in strengths})
    extra = "" if len(strengths) == 1 else f".{parameter}"
    return f"{entry['effect']}{extra}@{entry['location']}"


def causes_and_rivals(diagnosis: Diagnosis, group: IsolabilityGroup | None) -> tuple[list[Entry], list[Entry]]:
    """Entries of the accepted causes and of their rivals; the probabilities of one step add up to 1 at most."""
    steps = _probabilities(diagnosis, group)
    causes = _causes(diagnosis, steps)
    rivals = _near_hypotheses(diagnosis, steps)
    known = {entry["effect"] for entry in (*causes, *rivals)}
    rivals += [entry for entry in _imitations(diagnosis, group, steps) if entry["effect"] not in known]
    rivals += _inseparable(diagnosis, causes, rivals)
    for entry in (*causes, *rivals):
        entry["text"] = sentence(entry)
    return causes, rivals


def first_isolability_group(diagnosis: Diagnosis) -> IsolabilityGroup | None:
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


def _probabilities(diagnosis: Diagnosis, group: IsolabilityGroup | None) -> list[dict[str, float]]:
    """Probability of each effect in each step of the selection."""
    named = named_effects(diagnosis)
    steps = [by_effect(rival_hypotheses(hypotheses, named)) for hypotheses in diagnosis.selections]
    if group is not None:
        cause = diagnosis.final.terms[0].candidate.effect.name
        candidates = [score.candidate for score in diagnosis.scores]
        steps[0] = with_imitations(steps[0], cause, group, candidates)
    return steps


def _entry(candidate: Candidate) -> Entry:
    """What causes and rivals have in common."""
    effect = candidate.effect
    point = effect.injection_points[0] if effect.injection_points else ""
    return {"effect": effect.name, "title": effect.title, "injection_point": point, "location": candidate.location}


def _value(value: float, unit: str, interval: tuple[float, float]) -> Entry:
    return {"value": value, "unit": unit, "ci95": list(interval)}


def _causes(diagnosis: Diagnosis, steps: list[dict[str, float]]) -> list[Entry]:
    """One entry an effect, with all its parameters."""
    merged: dict[str, Entry] = {}
    numbers = {id(hypotheses): k for k, hypotheses in enumerate(diagnosis.selections)}
    bounds = intervals(diagnosis.fitter, diagnosis.final, diagnosis.noise)
    for term, interval, hypotheses in zip(diagnosis.final.terms, bounds, diagnosis.hypotheses, strict=True):
        effect, candidate, step = term.candidate.effect, term.candidate, numbers[id(hypotheses)]
        if isinstance(candidate, BasisFunction):
            merged.setdefault(effect.name, _nonparametric(diagnosis, candidate, hypotheses) | {"step": step + 1})
            continue
        own = steps[step].get(effect.name, 0.0)
        new = _entry(candidate) | {"parameters": {}, "probability": own, "step": step + 1, **_onset(diagnosis, term)}
        entry = merged.setdefault(effect.name, new | {"variables": [], "curve": []})
        parameters, parameter = entry["parameters"], candidate.parameter
        parameters[parameter.name] = _value(term.value, parameter.unit, interval)
        if isinstance(candidate, ShapedCandidate):
            parameters[candidate.shape.name] = _value(candidate.at, candidate.shape.unit, candidate.interval())
        if own > entry["probability"]:
            entry |= {"probability": own, "step": step + 1}
    return list(merged.values())


def _onset(diagnosis: Diagnosis, term: Term) -> Entry:
    """The onset within its log, and within the session, in which the logs follow each other."""
    if term.onset is None:
        return {"onset": None, "onset_s": None}
    number, onset_s = term.onset
    logs = [recording.log for recording in diagnosis.dataset.recordings]
    before = sum(float(log.t_s[-1] - log.t_s[0]) for log in logs[:number])
    in_log = {"log": logs[number].name, "t_s": float(logs[number].t_s[0]) + onset_s}
    return {"onset": in_log, "onset_s": before + onset_s}


def _nonparametric(diagnosis: Diagnosis, function: BasisFunction, hypotheses: list[FittedHypothesis]) -> Entry:
    """The entry of a nonparametric term: injection point, variable, and the curve with its band."""
    terms, covariance = diagnosis.final.terms, diagnosis.final.covariance
    own = [k for k, term in enumerate(terms) if isinstance(term.candidate, BasisFunction)]
    functions = [term.candidate for term in terms if isinstance(term.candidate, BasisFunction)]
    inflation = variance_inflation_nonparametric(function.term.name, function.location)
    fitted = rival_hypotheses(hypotheses, named_effects(diagnosis))
    return {
        "effect": UNLISTED, "title": function.effect.title, "injection_point": function.term.injection_point,
        "location": function.location, "parameters": {}, "probability": probabilities(fitted)[0],
        "onset": None, "onset_s": None, "variables": [function.variable], "adds": function.term.adds,
        "curve": estimate_curve(functions, [terms[k].value for k in own], inflation * covariance[np.ix_(own, own)]),
    }  # fmt: skip


def _near_hypotheses(diagnosis: Diagnosis, steps: list[dict[str, float]]) -> list[Entry]:
    """Hypotheses with other effects that fit nearly as well; those of one effect share its probability."""
    near, named = [], named_effects(diagnosis)
    for number, (selection, effects) in enumerate(zip(diagnosis.selections, steps, strict=True)):
        hypotheses = rival_hypotheses(selection, named)
        fitted = by_effect(hypotheses)
        for one, share in list(zip(hypotheses, probabilities(hypotheses), strict=True))[1:]:
            name = one.term.candidate.effect.name
            if delta_chi2(one, hypotheses[0]) < INDISTINGUISHABLE and name not in named:
                probability = share * effects[name] / fitted[name]
                near.append(_rival(diagnosis, one.term, one.information, probability, number + 1))
    return near


def _rival(diagnosis: Diagnosis, term: Term, information: float, probability: float, step: int) -> Entry:
    candidate, value = term.candidate, term.value
    half = half_width(candidate, value, max(information, 1e-30) ** -0.5)
    parameter = candidate.parameter
    return _entry(candidate) | {
        "parameters": {parameter.name: _value(value, parameter.unit, (value - half, value + half))},
        "probability": probability, "step": step, **_onset(diagnosis, term), "variables": [], "curve": [],
    }  # fmt: skip


def _imitations(diagnosis: Diagnosis, group: IsolabilityGroup | None, steps: list[dict[str, float]]) -> list[Entry]:
    """Members of the isolability group as rivals, with the values that imitate, one entry an effect."""
    if group is None:
        return []
    values = dict(zip(group.members, group.values, strict=True))
    entries: dict[str, Entry] = {}
    for index in group.indices:
        test = diagnosis.scores[index]
        name = test.candidate.effect.name
        term = Term(test.candidate, values.get(index, test.value), diagnosis.final.terms[0].onset)
        if name not in entries:
            entries[name] = _rival(diagnosis, term, test.information, steps[0][name], 1)
    return list(entries.values())


def _inseparable(diagnosis: Diagnosis, causes: list[Entry], rivals: list[Entry]) -> list[Entry]:
    """Rivals that are a cause or rival by another name in these logs: they share its value, and by their priors its
    probability."""
    added = []
    for name, other in inseparable_forward(diagnosis.dataset).items():
        same = next((entry for entry in (*causes, *rivals) if entry["effect"] == other), None)
        if same is None or name in diagnosis.vehicle.undiagnosable_effects:
            continue
        effect, known = THETA.effect(name), THETA.effect(other)
        (parameter,), (its,) = effect.strengths, known.strengths
        value = float(same["parameters"][its.name]["value"])
        if not parameter.low <= value <= parameter.high:
            continue
        ratio = _density(value, parameter.typical) / _density(value, its.typical)
        share = same["probability"] * ratio / (1.0 + ratio)
        same["probability"] -= share
        parameters = {parameter.name: same["parameters"][its.name] | {"unit": parameter.unit}}
        point = effect.injection_points[0]
        own = {"effect": name, "title": effect.title, "injection_point": point, "parameters": parameters}
        added.append(same | own | {"probability": share})
    return added


def _density(value: float, typical: float) -> float:
    """Prior density of a value, without what is common to all."""
    sd = PRIOR_SD_IN_TYPICAL_SIZES * abs(typical)
    return float(np.exp(log_prior(value, sd)) / sd)
