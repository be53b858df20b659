"""What is known of our own ECU by name: its identifiers on the bus, data identifiers, codes, routines."""

from ecu.law.trouble_codes import CODES
from hil.uds.addresses import Identifier
from hil.uds.words import FOREIGN, Names

REQUEST, ANSWER, FUNCTIONAL = Identifier(0x7E0, False), Identifier(0x7E8, False), Identifier(0x7DF, False)
LEVEL = 1
"""Level of security access."""
OWN = Names(dtcs={code.number << 8: code.name for code in CODES})


def key_of(seed: bytes) -> bytes:
    """Key of a seed."""
    return seed


__all__ = ["ANSWER", "FUNCTIONAL", "LEVEL", "OWN", "REQUEST", "key_of", "names_of", "own_pairs"]


def own_pairs() -> list[tuple[Identifier, Identifier]]:
    """Connections of our ECU."""
    return [(REQUEST, ANSWER)]


def names_of(identifier: Identifier) -> Names:
    """Names of the ECU behind an identifier."""
    return OWN if identifier in (REQUEST, ANSWER, FUNCTIONAL) else FOREIGN
