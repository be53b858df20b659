"""Which plant, diagnosis and reference car a trial was run with: digests of their sources."""

from collections.abc import Iterator
from functools import cache
from importlib import resources

from plant.compiled import PACKAGES, digest


def _rooms(package: str) -> Iterator[str]:
    """A package and all packages in it."""
    yield package
    for item in sorted(resources.files(package).iterdir(), key=lambda item: item.name):
        if item.joinpath("__init__.py").is_file():
            yield from _rooms(f"{package}.{item.name}")


STUDIED = (*PACKAGES, *_rooms("hil.diagnosis"))
"""What an answer depends on."""
HIDDEN = ("hil.validation.reference_car",)
"""What a case depends on."""
SOURCES = (".py", ".toml")


@cache
def state() -> str:
    """Twelve hexadecimal digits that differ when cases or answers may; as first asked for, whatever is edited since."""
    return digest(STUDIED + HIDDEN, SOURCES)[:12]
