"""How well a cause is isolated: the probability that an answer puts on it, and whether it ranks first.

These are the measures of the diagnosis competition DX 2025 with the LiU-ICE benchmark (Jung, Frisk and Krysander 2024,
arXiv 2408.13269). Its *fault isolation accuracy* is the mean probability given to the true diagnosis over what is
rightly called faulty; detections and false alarms are counted beside it. There a sample counts, here a drive.
"""

from collections.abc import Iterable, Mapping
from typing import Any

_EQUAL = 1e-9
"""Probabilities so near to each other are tied."""


def probabilities(entries: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Probability of each effect by the causes and rivals of an answer, {effect: probability}, sum 1 at most.

    Several causes, each with the probabilities of its own step, add up to more than 1: they share it in proportion.
    """
    chances: dict[str, float] = {}
    for entry in entries:
        chances[entry["effect"]] = max(chances.get(entry["effect"], 0.0), float(entry["probability"]))
    total = max(sum(chances.values()), 1.0)
    return {name: chance / total for name, chance in chances.items()}


def share_of_first(chances: Mapping[str, float], hidden: str) -> float:
    """1 where ``hidden`` alone has the largest probability, 1 / n where n names are tied for it, else 0."""
    own = chances.get(hidden, 0.0)
    if own <= 0.0 or max(chances.values()) > own + _EQUAL:
        return 0.0
    return 1.0 / sum(chance >= own - _EQUAL for chance in chances.values())
