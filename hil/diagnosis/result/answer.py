"""The answer as one plain object: verdict, causes, rivals, what to drive next, residual patterns, held-out error."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.detection.candidates import inseparable_forward
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import delta_criterion, rival_hypotheses
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.threshold import DISTINCT, UNDETECTABLE_SHARE
from hil.diagnosis.isolation.experiment import (
    MAX_RECOMMENDATIONS,
    Recommendation,
    discriminating_manoeuvres,
    write,
)
from hil.diagnosis.isolation.groups import IsolabilityGroup
from hil.diagnosis.result.causes import candidate_name, causes_and_rivals, first_isolability_group, named_effects
from hil.diagnosis.result.cross_validation import HeldOutError
from hil.diagnosis.result.goodness_of_fit import ChannelFit
from hil.diagnosis.result.headline import headline, not_described
from hil.diagnosis.result.moved_numbers import MovedNumber, moved_numbers
from hil.diagnosis.result.reference import reference_as_json
from hil.diagnosis.result.residual_patterns import WORDS, ResidualPattern

NOT_DESCRIBED = "model_does_not_describe"
"""Verdict where a channel's free-run error is more than a model that describes the car makes."""
_MAX_COMPARED = 5
"""Effects of an isolability group between which a discriminating manoeuvre is sought, at most."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Result of `explain`: ``json`` as printed, and all that the report shows."""

    json: dict[str, Any]
    diagnosis: Diagnosis
    held_out: list[HeldOutError]
    patterns: list[ResidualPattern]
    moved: list[MovedNumber]


def answer(
    diagnosis: Diagnosis, held_out: list[HeldOutError], patterns: list[ResidualPattern], fits: list[ChannelFit],
    extension: str | None, remarks: list[str], out: Path | None = None,
) -> Answer:  # fmt: skip
    """Assemble the answer; discriminating manoeuvres are written into ``out``.

    Where the model does not describe the car, what it would name are rivals at most: it errs more than any of them.
    """
    group = first_isolability_group(diagnosis)
    causes, rivals = causes_and_rivals(diagnosis, group)
    verdict = _verdict(diagnosis, causes, rivals, group)
    moved = moved_numbers(diagnosis)
    misfits = [one for one in fits if not one.described]
    if misfits:
        verdict, rivals, causes = NOT_DESCRIBED, [*causes, *rivals], []
    content = {
        "verdict": verdict,
        "headline": (
            not_described(misfits, rivals) if misfits
            else headline(verdict, causes, rivals, moved, diagnosis.reference > 0)
        ),
        "causes": causes,
        "rivals": rivals,
        "moved_numbers": [one.as_json() for one in moved],
        "goodness_of_fit": [one.as_json() for one in fits],
        "undetectable_effects": diagnosis.undetectable_effects,
        "discriminating_manoeuvres": (
            _manoeuvres(diagnosis, rivals, out) if verdict == "cannot_tell_apart" else []
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
        "channels_read": channels_read(one.log for one in diagnosis.dataset.recordings[diagnosis.reference :]),
    }  # fmt: skip
    if diagnosis.reference:
        content |= {"reference": reference_as_json(diagnosis)}
    return Answer(content, diagnosis, held_out, patterns, moved)


def _verdict(
    diagnosis: Diagnosis, causes: list[dict[str, Any]], rivals: list[dict[str, Any]], group: IsolabilityGroup | None
) -> str:
    if not causes:
        effects = {score.candidate.effect.name for score in diagnosis.scores}
        undetectable = effects.intersection(diagnosis.undetectable_effects)
        return "not_testable" if len(undetectable) > UNDETECTABLE_SHARE * len(effects) else "none"
    if any(isinstance(term.candidate, BasisFunction) for term in diagnosis.final.terms):
        return "unlisted"
    named = named_effects(diagnosis)
    if {rival["effect"] for rival in rivals} & inseparable_forward(diagnosis.dataset).keys():
        return "cannot_tell_apart"
    if group is not None and any(diagnosis.scores[k].candidate.effect.name not in named for k in group.indices):
        return "cannot_tell_apart"
    for hypotheses in diagnosis.selections:
        best, *others = rival_hypotheses(hypotheses, named)
        for other in others:
            another = other.term.candidate.effect.name != best.term.candidate.effect.name
            if another and delta_criterion(other, best) < DISTINCT:
                return "cannot_tell_apart"
    return "named"


def _manoeuvres(diagnosis: Diagnosis, rivals: list[dict[str, Any]], out: Path | None) -> list[dict[str, Any]]:
    """Scenarios that isolate the first cause and its rivals from each other, the best first."""
    names = {term.candidate.effect.name: term.candidate.name for term in diagnosis.final.terms[:1]}
    for rival in rivals:
        names.setdefault(rival["effect"], candidate_name(rival))
    if len(names) < 2:
        return []
    recommended = _recommended(list(names.values())[:_MAX_COMPARED])
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
