"""Where the right effect must be named first: where it is separable from every other, from a d' of 4 on.

``separability.toml`` says so of every effect, place, noise level and signal-to-noise ratio (`separability` beside it
measures it).
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources

from hil.validation.blind_trials.metrics import Record

SEPARATED = 4.0
"""d' from which on causes are separable."""


@cache
def _table() -> Mapping[str, Mapping[str, Mapping[str, Mapping[str, tuple[float, str]]]]]:
    source = resources.files("hil.validation.blind_trials") / "separability.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def separable(record: Record) -> bool:
    """Whether the one cause a record hides is separable from every other, at the ratio of its family."""
    (hidden,) = record["hidden"]
    return effect_separable(hidden["effect"], hidden["location"], record["noise"], record["size"])


def effect_separable(effect: str, wheel: str, noise_level: str, size: float) -> bool:
    """Whether an effect at a location is separable from every other at a signal-to-noise ratio.

    True where nobody measured it: below a ratio of 8.
    """
    entry = _table().get(effect, {}).get(wheel, {}).get(noise_level, {}).get(f"at_{size:g}")
    return entry is None or entry[0] >= SEPARATED
