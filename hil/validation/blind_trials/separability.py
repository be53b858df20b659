"""How far apart causes are: d' of an effect and the listed one that comes nearest, by the reference car's equations.

``separability.toml`` holds d' for one car and drive of the full set (``brakebench trials --apart``), by effect, place,
noise level and signal-to-noise ratio: the distance of two whitened signatures where the other effect, at any place the
plant lists it at, has the size that brings it nearest, no tolerance or latency known better than the car's set states
it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.estimation.terms import LOCATIONS
from hil.validation.reference_car.case import Case, Hidden, as_number, logs, make_case, unknowns
from hil.validation.reference_car.cases import SEPARABLE
from hil.validation.reference_car.catalogue import Hideable, find
from hil.validation.reference_car.noise import LEVELS
from hil.validation.reference_car.snr import WHEELS, difference, signal_to_noise, whitened
from plant.effects.effect import Scope
from plant.injection.theta import THETA

_SIZES = (8.0, 15.0)
"""Signal-to-noise ratios at which the first name counts."""
_NOTHING = 1e-6
_ROUNDS, _NEAR = 6, 0.7
_ALIKE = {"pad_mu_gain": "caliper_asymmetry"}
"""Effects of a wheel, and what the plant lists and the reference car lacks: the same but for the sign of the speed."""
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Signature:
    """What an effect shows at a size it stands out well by: ``bounds`` of its size over this one, and the ``ratio``."""

    effect: str
    place: str
    bounds: tuple[float, float]
    ratio: float


Nearest = tuple[float, str]
"""d', and the effect at its place that comes nearest."""


def measure(seed: int, say: Callable[[str], None]) -> dict[tuple[str, str, str], dict[float, Nearest]]:
    """Nearest to every effect at every place, {(effect, place, noise level): {signal-to-noise ratio: nearest}}."""
    found: dict[tuple[str, str, str], dict[float, Nearest]] = {}
    for level in LEVELS:
        case = make_case((), seed, level)
        signatures, products = _shown(case)
        for k, size in product(range(len(signatures)), _SIZES):
            own = signatures[k]
            if own.effect not in _ALIKE.values() and own.place in find(own.effect).where:
                found.setdefault((own.effect, own.place, level), {})[size] = nearest(k, signatures, products, size)
        say(f"{level} noise")
    return found


def _shown(case: Case) -> tuple[list[Signature], Vector]:
    """Signatures of all effects of the family of single causes, and their products beside what nobody knows better."""
    base, unknown = logs(case, clean=True), unknowns(case)
    inner = unknown.T @ unknown + np.eye(unknown.shape[1])

    def shown(one: Hidden) -> tuple[Signature, Vector]:
        hidden = replace(case, hidden=(one,))
        column = whitened(difference(logs(hidden, clean=True), base), base, case.noise)
        kind, ratio = find(one.effect), min(signal_to_noise(column, unknown)[0], as_number(hidden))
        return Signature(one.effect, one.wheel, _bounds(kind, one.magnitude), ratio), column

    found = [_well_seen(shown, kind, place) for kind in SEPARABLE for place in _places(kind)]
    found += [(replace(own, effect=_ALIKE[own.effect]), column) for own, column in found if _driven_forward(own)]
    columns = np.stack([column for _, column in found], axis=1)
    along = unknown.T @ columns
    return [own for own, _ in found], columns.T @ columns - along.T @ np.linalg.solve(inner, along)


def _well_seen(
    shown: Callable[[Hidden], tuple[Signature, Vector]], kind: Hideable, place: str
) -> tuple[Signature, Vector]:
    """Signature of the size that stands out by the largest ratio, about; what lies behind a limit shows only beyond."""
    size, under, over = kind.typical, 0.0, 0.0
    found = []
    for _ in range(_ROUNDS):
        own, column = shown(Hidden(kind.name, place, size))
        share = max(own.ratio / _SIZES[-1], _NOTHING)
        found.append((abs(float(np.log(share))), own, column))
        if _NEAR < share < 1.0 / _NEAR:
            break
        under, over = (under, size) if share > 1.0 else (size, over)
        size = 0.5 * (under + over) if under and over else float(np.clip(size / share, kind.low, kind.high))
    _, own, column = min(found, key=lambda one: one[0])
    return own, column


def _places(kind: Hideable) -> tuple[str, ...]:
    """Where it may be hidden, and where else the plant lists it: all four radii are the scale of the wheel speeds."""
    scopes = [effect.scope for effect in THETA.effects if effect.name == kind.name and effect.scope is not Scope.NODE]
    return tuple(dict.fromkeys([*kind.where, *(place for scope in scopes for place in LOCATIONS[scope])]))


def _driven_forward(own: Signature) -> bool:
    """Whether the plant lists something that does the same in a car that never drives backward."""
    return own.effect in _ALIKE and own.place in WHEELS


def _bounds(kind: Hideable, magnitude: float) -> tuple[float, float]:
    low, high = sorted((kind.low / magnitude, kind.high / magnitude))
    return low, high


def nearest(k: int, signatures: Sequence[Signature], products: Vector, size: float) -> Nearest:
    """What comes nearest to signature ``k`` when it stands out by ``size``.

    Parameters
    ----------
    products : of the signatures, (n, n).
    """
    own = signatures[k]
    times = size / own.ratio
    found = [(float("inf"), "")]
    for r, rival in enumerate(signatures):
        if rival.effect == own.effect or products[r, r] < _NOTHING:
            continue
        share = np.clip(times * products[k, r] / products[r, r], *rival.bounds)
        apart = times**2 * products[k, k] - 2.0 * times * share * products[k, r] + share**2 * products[r, r]
        found.append((float(max(apart, 0.0)) ** 0.5, f"{rival.effect}@{rival.place}"))
    return min(found)


def as_toml(found: Mapping[tuple[str, str, str], Mapping[float, Nearest]], seed: int) -> str:
    """The file's text."""
    lines = [f"# made by: brakebench trials --apart FILE --seed {seed}"]
    table: dict[tuple[str, str], list[str]] = {}
    for (effect, place, level), by_size in found.items():
        entries = ", ".join(f'at_{size:g} = [{d:.1f}, "{rival}"]' for size, (d, rival) in by_size.items())
        table.setdefault((effect, place), []).append(f"{level} = {{ {entries} }}")
    for (effect, place), rows in table.items():
        lines += [f"[{effect}.{place}]", *rows]
    return "\n".join(lines) + "\n"
