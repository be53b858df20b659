"""What is driven: which faults, on what, when, with which numbers; everything drawn from one seed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from hil.faults.catalogue import FAMILIES, FAULTS, fault_named
from hil.faults.fault import FROM_THE_FIRST_TICK, MOST_SEEDS, FaultKind, Injection

SCENARIO = "stop72_blend70"
"""A stop from 72 km/h with 70 % of the braking asked of the motors: the loss of a motor shows most."""
TWINS = 8  # stops without a fault, one for each seed of the noise
PAIR = "pair"

# spans of the stop, s, and their shares of the instants: the pedal moves from 0.5 to 0.8 s, the car stands at 7.1 s
SPANS = ((0.2, 0.5, 0.1), (0.5, 1.0, 0.2), (1.0, 5.0, 0.4), (5.0, 6.2, 0.2), (6.2, 7.0, 0.1))
SHORT_S = (0.1, 0.6)  # a bounded fault
BOUNDED = 3  # every third instant has one that ends, so that recovery is seen
_TICK_S = 0.01
_TOGETHER_S = 0.2  # a pair: the second fault begins within
_OFFSET = 3  # from target to target in what a fault takes in turn

IN_TURN: dict[str, tuple[dict[str, float], ...]] = {
    "lost": ({"share": 0.01}, {"share": 0.05}, {"share": 0.2}),
    "silent": (*({"for_s": s} for s in (0.03, 0.05, 0.1, 0.2, 0.5)), {}, {}, {}),
    "late": ({"share": 0.2, "ticks": 2.0},),
    "stale": ({"share": 0.2},),
    "replayed": ({"delay_s": 0.5}, {"delay_s": 0.2}, {"delay_s": 0.13}),
    "second_sender": tuple({"offset": float(k)} for k in range(1, 15)),
    "bits_flipped": tuple({"bits": float(k)} for k in range(1, 17)),
    "counter_value": ({"value": 15.0}, {"value": 0.0}, {"value": 7.0}),
    "counter_offset": tuple({"offset": float(k)} for k in range(1, 15)),
    "counter_jump": tuple({"step": float(k)} for k in range(2, 15)),
    "pad_friction": ({"factor": 0.5}, {"factor": 0.25}, {"factor": 1.5}),
    "length_wrong": tuple({"length": float(k)} for k in range(8)),
    "bus_off": ({"for_s": 0.3}, {"for_s": 0.05}, {}),
    "unplugged": ({"for_s": 0.3}, {"for_s": 0.05}, {}),
    "queue_full": ({"for_s": 0.05}, {"for_s": 0.02}, {"for_s": 0.2}),
    "rx_overflow": ({"for_s": 0.05}, {"for_s": 0.02}, {"for_s": 0.2}),
    "process_stopped": ({"for_s": 0.02}, {"for_s": 0.05}, {"for_s": 0.2}),
    "process_busy": ({"for_s": 0.02}, {"for_s": 0.05}, {"for_s": 0.2}),
    "process_late": ({"for_s": 0.1}, {"for_s": 0.5}, {"for_s": 1.5}),
}
"""Numbers that a fault takes in turn: the shares, times and bits of the table of faults to be withstood.

The delays of a replay are no multiples of 15 frames: such a shift cannot be seen by a counter 0 to 14.
"""
OF_TIME: dict[str, dict[str, float]] = {"silent": {}, "lost": {"share": 0.2}}
_NEVER_BOUNDED = frozenset({"process_killed"})
_FROM_THE_START = frozenset({"process_late"})


@dataclass(frozen=True, slots=True)
class Case:
    """One run.

    Attributes
    ----------
    row : names of what is looked at together: fault and target, or a pair of families.
    seed : of the noise; the twin without a fault has the same.
    faults : one, or two of a pair.
    timeout_s : the controller's time-out; None: its own.
    """

    row: tuple[str, str]
    seed: int
    faults: tuple["Armed", ...]
    timeout_s: float | None = None


@dataclass(frozen=True, slots=True)
class Armed:
    """A fault in plain values, as worker processes take them."""

    name: str
    target: str
    at_s: float
    seed: int
    values: dict[str, float] = field(default_factory=dict)

    def injection(self) -> Injection:
        """For the bench."""
        return fault_named(self.name).on(self.target, at_s=self.at_s, seed=self.seed, values=self.values)

    def __str__(self) -> str:
        values = "".join(f" {name}={value:g}" for name, value in self.values.items())
        when = "from the first tick" if math.isinf(self.at_s) else f"at {self.at_s:.2f} s"
        return f"{self.name} on {self.target} {when}, seed {self.seed}{values}"


def virtual_faults() -> tuple[FaultKind, ...]:
    """Faults that exist in virtual time."""
    return tuple(kind for kind in FAULTS if kind.in_virtual_time)


def cases(kinds: Sequence[FaultKind], instants: int, seed: int, timeout_s: float | None = None) -> list[Case]:
    """Cases of single faults, at so many instants each or more: as many on each of its usual targets."""
    found = []
    for kind in kinds:
        each = -(-instants // len(kind.usual))
        for place, target in enumerate(kind.usual):
            for i in range(each):
                armed = _armed(kind, target, i, (i + (place + 0.5) / len(kind.usual)) / each, seed)
                found.append(Case((kind.name, target), _noise_seed(seed, i + place), (armed,), timeout_s))
    return found


def cases_of_time(instants: int, seed: int, timeout_s: float | None) -> list[Case]:
    """Cases whose finding depends on the time-out: messages silent for good, and one frame in five lost."""
    found = []
    for name, values in OF_TIME.items():
        for case in cases([fault_named(name)], instants, seed, timeout_s):
            (armed,) = case.faults
            found.append(replace(case, faults=(replace(armed, values=values),)))
    return found


def pairs(instants: int, seed: int) -> list[Case]:
    """Cases of two faults of different families at once, fault and target drawn anew at each instant."""
    found = []
    by_family = {family: [k for k in virtual_faults() if k.family == family] for family in FAMILIES}
    families = [family for family, kinds in by_family.items() if kinds]
    for number, two in enumerate(combinations(families, 2)):
        for i in range(instants):
            dice = np.random.default_rng([seed, 7, number, i])
            kinds, targets = _two(by_family, two, dice)
            place = (i + float(dice.random())) / instants
            first, second = (_armed(k, t, i, place, seed) for k, t in zip(kinds, targets, strict=True))
            if math.isfinite(first.at_s) and math.isfinite(second.at_s):
                at_s = first.at_s + float(dice.uniform(0.0, _TOGETHER_S))
                second = replace(second, at_s=_on_a_tick(at_s))
            found.append(Case((PAIR, " + ".join(two)), _noise_seed(seed, i), (first, second)))
    return found


def _two(
    by_family: dict[str, list[FaultKind]], families: tuple[str, str], dice: np.random.Generator
) -> tuple[list[FaultKind], list[str]]:
    """Two faults and their targets; not the same message, where the second could undo the first."""
    while True:
        kinds = [by_family[family][int(dice.integers(len(by_family[family])))] for family in families]
        targets = [kind.usual[int(dice.integers(len(kind.usual)))] for kind in kinds]
        ids = [kind.on(target).target.can_ids for kind, target in zip(kinds, targets, strict=True)]
        if ids[0].isdisjoint(ids[1]) or max(map(len, ids)) > 1:
            return kinds, targets


def _noise_seed(seed: int, i: int) -> int:
    return seed + i % TWINS


def _armed(kind: FaultKind, target: str, i: int, place: float, seed: int) -> Armed:
    """The i-th run on a target, at a place (0 to 1) among the instants of the stop."""
    number = kind.usual.index(target)
    dice = np.random.default_rng([seed, kind.number, number, i])
    values = dict(kind.usual_values)
    values.pop("for_s", None)  # how long it acts is the campaign's
    in_turn = IN_TURN.get(kind.name, ({},))
    values |= in_turn[(i + _OFFSET * number) % len(in_turn)]
    bounded = (i // len(in_turn) + number) % BOUNDED == BOUNDED - 1
    if bounded and not any("for_s" in one for one in in_turn) and kind.name not in _NEVER_BOUNDED:
        values["for_s"] = round(float(dice.uniform(*SHORT_S)), 2)
    at_s = FROM_THE_FIRST_TICK if kind.name in _FROM_THE_START else _instant(place)
    return Armed(kind.name, target, at_s, int(dice.integers(MOST_SEEDS)), values)


def _instant(place: float) -> float:
    """Manoeuvre time, s, of a place among the instants: evenly within each span."""
    for begin_s, end_s, share in SPANS:
        if place < share:
            return _on_a_tick(begin_s + (end_s - begin_s) * place / share)
        place -= share
    return SPANS[-1][1]


def _on_a_tick(time_s: float) -> float:
    return round(round(time_s / _TICK_S) * _TICK_S, 2)
