"""What is known of our own ECU by name: its identifiers on the bus, data identifiers, codes, routines."""

from hil.uds.addresses import Identifier
from hil.uds.words import FOREIGN, Names


def own_pairs() -> list[tuple[Identifier, Identifier]]:
    """Connections of our ECU."""
    return []


def names_of(identifier: Identifier) -> Names:
    """Names of the ECU behind an identifier."""
    return FOREIGN
