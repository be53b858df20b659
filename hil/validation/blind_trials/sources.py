"""Which plant, study and hidden car a trial was run with: digests of their sources."""

from functools import cache

from plant.compiled import PACKAGES, digest

_FLOORS = ("logs", "replay", "likelihood", "fitting", "search", "verdict")
STUDIED = (*PACKAGES, "hil.study", *(f"hil.study.{floor}" for floor in _FLOORS))
"""What an answer depends on."""
HIDDEN = ("hil.validation.reference_car",)
"""What a case depends on."""
SOURCES = (".py", ".toml")


@cache
def state() -> str:
    """Twelve hexadecimal digits that differ when cases or answers may; as first asked for, whatever is edited since."""
    return digest(STUDIED + HIDDEN, SOURCES)[:12]
