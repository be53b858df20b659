"""Which plant, study and hidden car a trial was run with: digests of their sources."""

import hashlib
from functools import cache
from importlib import resources

STUDIED = ("plant", "plant.parameters", "plant.effects", "plant.effects.sensing", "hil.study")
"""What an answer depends on."""
HIDDEN = ("hil.hide",)
"""What a case depends on."""


def digest(packages: tuple[str, ...]) -> bytes:
    """SHA-256 of the Python and TOML files of packages, their folders alone."""
    found = hashlib.sha256()
    for package in packages:
        for file in sorted(resources.files(package).iterdir(), key=lambda item: item.name):
            if file.name.endswith((".py", ".toml")):
                found.update(file.read_bytes())
    return found.digest()


@cache
def state() -> str:
    """Twelve hexadecimal digits that differ when cases or answers may; as first asked for, whatever is edited since."""
    return digest(STUDIED + HIDDEN).hex()[:12]
