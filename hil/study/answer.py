"""The answer as one plain object: verdict, causes, rivals, what to drive, what was wrong, what is gained."""

from dataclasses import dataclass
from typing import Any

from hil.study.diagnose import TIED, Contender, Diagnosis, odds
from hil.study.measure import Gain, intervals, probabilities
from hil.study.patterns import WORDS, Wrong
from plant.effects.theta import THETA

_CERTAIN = 4.6
"""Difference in chi2 (ten to one) below which a cause of another name is not told apart."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What `explain` returns: ``json`` as printed, and all that the report shows."""

    json: dict[str, Any]
    found: Diagnosis
    gains: list[Gain]
    wrongs: list[Wrong]


def answer(
    found: Diagnosis, gains: list[Gain], wrongs: list[Wrong], extension: str | None, remarks: list[str]
) -> Answer:
    """Put the answer together."""
    causes = _causes(found)
    rivals = [_rival(c, p) for _, c, p in _rivals(found)]
    verdict = _verdict(found, causes)
    tied = [c["effect"] for c in (*causes, *rivals)]
    content = {
        "verdict": verdict,
        "causes": causes,
        "rivals": rivals,
        "not_testable": found.untestable,
        "decide_with": _decide_with(tied) if verdict == "cannot_tell_apart" else [],
        "wrong": [
            {"channel": w.channel, "rms": w.rms, "noise": w.noise, "unit": w.unit, "pattern": w.pattern} for w in wrongs
        ],
        "gain": {
            WORDS[g.channel]: {
                "before": g.before, "after": g.after, "ci95": [g.low, g.high], "tuned": g.tuned,
                "best_wrong": g.best_wrong,
            }
            for g in gains
        },
        "extension": extension,
        "missing": list(found.case.missing),
        "remarks": remarks,
    }  # fmt: skip
    return Answer(content, found, gains, wrongs)


def _verdict(found: Diagnosis, causes: list[dict[str, Any]]) -> str:
    if not causes:
        return "none"
    for listed in found.contenders:
        best = listed[0]
        for other in listed[1:]:
            another = other.term.candidate.effect.name != best.term.candidate.effect.name
            if another and odds(other) - odds(best) < _CERTAIN:
                return "cannot_tell_apart"
    return "named"


def _causes(found: Diagnosis) -> list[dict[str, Any]]:
    """One entry an effect: its numbers together."""
    merged: dict[str, dict[str, Any]] = {}
    for term, interval, listed in zip(found.final.terms, intervals(found), found.contenders, strict=True):
        effect, candidate = term.candidate.effect, term.candidate
        chances = probabilities(listed)
        own = sum(
            p for c, p in zip(listed, chances, strict=True) if c.term.candidate.effect.name == effect.name
        )  # fmt: skip
        entry = merged.setdefault(
            effect.name,
            {
                "effect": effect.name, "title": effect.title, "joint": effect.joints[0] if effect.joints else "",
                "wheel": candidate.place, "parameters": {}, "probability": own, "onset": None, "onset_s": None,
                "variables": [], "curve": [],
            },
        )  # fmt: skip
        entry["parameters"][candidate.parameter.name] = {
            "value": term.value, "unit": candidate.parameter.unit, "ci95": list(interval),
        }  # fmt: skip
        entry["probability"] = max(entry["probability"], own)
    return list(merged.values())


def _rivals(found: Diagnosis) -> list[tuple[int, Contender, float]]:
    rivals = []
    for k, listed in enumerate(found.contenders):
        chances = probabilities(listed)
        named = {term.candidate.effect.name for term in found.final.terms}
        for contender, chance in list(zip(listed, chances, strict=True))[1:]:
            near = contender.cost - listed[0].cost < TIED
            if near and contender.term.candidate.effect.name not in named:
                rivals.append((k, contender, chance))
    return rivals


def _rival(contender: Contender, chance: float) -> dict[str, Any]:
    candidate, value = contender.term.candidate, contender.term.value
    half = 1.96 / max(contender.information, 1e-30) ** 0.5
    return {
        "effect": candidate.effect.name, "title": candidate.effect.title, "wheel": candidate.place,
        "joint": candidate.effect.joints[0] if candidate.effect.joints else "",
        "parameters": {
            candidate.parameter.name: {
                "value": value, "unit": candidate.parameter.unit, "ci95": [value - half, value + half],
            }
        },
        "probability": chance, "onset": None, "onset_s": None, "variables": [], "curve": [],
    }  # fmt: skip


def _decide_with(tied: list[str]) -> list[str]:
    """Manoeuvres that show the tied effects, most wanted first."""
    wanted = [THETA.effect(name).manoeuvre for name in dict.fromkeys(tied)]
    return sorted(dict.fromkeys(wanted), key=lambda m: -wanted.count(m))
