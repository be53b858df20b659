"""Blind trials: which case of a family comes when (`draw`), writing it (`write`), opening it (`read_answer`)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hil.errors import BrakebenchError
from hil.validation.reference_car.case import Case, Hidden, make_case, measured_case, scaled_case
from hil.validation.reference_car.catalogue import LISTED, TWINS, UNLISTED, Hideable, find
from hil.validation.reference_car.files import answer, read_answer, write
from hil.validation.reference_car.noise import LEVELS

__all__ = ["FAMILIES", "Case", "answer", "draw", "followed_by", "read_answer", "write"]

SNRS = (3.0, 5.0, 8.0, 15.0)
CONFOUNDED = ("mass_offset", "pad_mu_gain", "headwind", "rolling_resistance")
OUTSIDE = ("pad_temp_fade", "iwm_gain", "motor_tau", "mu_road", "hot_spot", "battery_soc", "regen_fadeout")
SEPARABLE = tuple(kind for kind in LISTED if kind.shows and kind.scales)
"""Effects of the single family: those the full manoeuvre set excites and that have a signature in time."""
Rng = np.random.Generator


def draw(family: str, index: int, seed: int, snr: float | None = None) -> Case:
    """Case ``index`` of a family; the same arguments give the same case.

    Parameters
    ----------
    snr : what the magnitude is scaled for; None takes the family's own (single: 3, 5, 8, 15 in turn).

    Raises
    ------
    BrakebenchError
        There is no such family.
    """
    if family not in FAMILIES:
        raise BrakebenchError(f"family {family!r}: expected one of {', '.join(FAMILIES)}")
    own = int(np.random.default_rng([seed, index, sum(family.encode())]).integers(2**31))
    case = FAMILIES[family](index, own, np.random.default_rng([own, 9]), snr)
    return replace(case, family=family, index=index)


def followed_by(case: Case) -> Case:
    """The same car with the same thing hidden on the manoeuvres that decide, where straight stops leave it tied."""
    return replace(case, manoeuvres="decide", variant=0, snr=None, snr_alone=None)


def _level(index: int) -> str:
    return list(LEVELS)[index % len(LEVELS)]


def _one(kind: Hideable, rng: Rng, onset_s: float | None = None) -> Hidden:
    """Something hidden in its usual size and sense, somewhere it may act."""
    wheel = kind.where[int(rng.integers(len(kind.where)))]
    sign = (
        -1.0
        if kind.low < 0.0 < kind.high and min(-kind.low, kind.high) > abs(kind.typical) and rng.random() < 0.3
        else 1.0
    )
    return Hidden(kind.name, wheel, sign * kind.typical, onset_s)


def _null(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    return make_case((), seed, _level(index), variant=1000 + int(rng.integers(100000)))


def _single(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    kind = SEPARABLE[index % len(SEPARABLE)] if snr else SEPARABLE[index // len(SNRS) % len(SEPARABLE)]
    case = make_case((_one(kind, rng),), seed, _level(int(rng.integers(3))))
    return scaled_case(case, snr or SNRS[index % len(SNRS)])


def _onset(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    kind = SEPARABLE[int(rng.integers(len(SEPARABLE)))]
    case = make_case((_one(kind, rng, float(rng.uniform(50.0, 130.0))),), seed, _level(index))
    return scaled_case(case, snr or 15.0)


def _several(count: int) -> Callable[[int, int, Rng, float | None], Case]:
    def several(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
        """Each scaled by itself; then hidden together."""
        found: list[Hidden] = []
        for k in rng.choice(len(SEPARABLE), count, replace=False):
            alone = make_case((_one(SEPARABLE[int(k)], rng),), seed, _level(index))
            found.extend(scaled_case(alone, snr or 10.0).hidden)
        return measured_case(make_case(found, seed, _level(index)))

    return several


def _unlisted(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    case = make_case((_one(UNLISTED[index % len(UNLISTED)], rng),), seed, _level(int(rng.integers(3))))
    return scaled_case(case, snr or 20.0)


def _confounded(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    kind = find(CONFOUNDED[index % len(CONFOUNDED)])
    return scaled_case(make_case((_one(kind, rng),), seed, "medium", "stops"), snr or 8.0)


def _twin(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    """Physical effect and sensor effect of a pair in turn; both act alike on car or wheel."""
    pair = TWINS[index // 2 % len(TWINS)]
    kind = find(pair[index % 2])
    case = make_case((_one(kind, rng),), seed, _level(int(rng.integers(3))))
    return scaled_case(case, snr or 15.0)


def _not_testable(index: int, seed: int, rng: Rng, snr: float | None) -> Case:
    kind = find(OUTSIDE[index % len(OUTSIDE)])
    return measured_case(make_case((_one(kind, rng),), seed, _level(index), "cold"))


FAMILIES: dict[str, Callable[[int, int, Rng, float | None], Case]] = {
    "null": _null, "single": _single, "onset": _onset, "two": _several(2), "three": _several(3), "unlisted": _unlisted,
    "confounded": _confounded, "twin": _twin, "not_testable": _not_testable,
}  # fmt: skip
"""Family of trials -> how its cases are drawn."""
