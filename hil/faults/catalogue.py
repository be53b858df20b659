"""All faults by name and number: the closed list that scenarios, tests and the command line arm from."""

from typing import NamedTuple

from hil.faults import bus, clock, disk, link, physical, process, protection, signal
from hil.faults.act import Act
from hil.faults.fault import FROM_THE_FIRST_TICK, FaultError, FaultKind, Injection, nearest


class Entry(NamedTuple):
    """A fault, and what does it between node and bus; None where the plant or the host does."""

    kind: FaultKind
    act: type[Act] | None


ENTRIES: tuple[Entry, ...] = tuple(
    Entry(kind, act)
    for family in (bus, protection, link, signal, physical, process, disk, clock)
    for kind, act in family.FAULTS
)
FAULTS: tuple[FaultKind, ...] = tuple(entry.kind for entry in ENTRIES)
FAMILIES: tuple[str, ...] = tuple(dict.fromkeys(kind.family for kind in FAULTS))
BY_NUMBER: dict[int, Entry] = {entry.kind.number: entry for entry in ENTRIES}
_BY_NAME = {kind.name: kind for kind in FAULTS}

ROWS = (
    "lost frame",
    "silence of one identifier",
    "frozen counter, replay, jump, swap",
    "bit flips, wrong data id, wrong length",
    "not available, out of range",
    "implausible sensor",
    "motor, axle, battery, brake circuit",
    "process killed, stopped, busy",
    "bus-off, queue full, overflow, unplugged",
    "second sender, babble, unknown identifiers",
    "wall clock jumps",
    "recorder killed, disk full",
    "start order, late join",
)
"""The table of faults to be withstood; each has at least one fault here."""


def names(family: str | None = None) -> tuple[str, ...]:
    """Names of all faults, or of a family's: for ``@pytest.mark.parametrize``."""
    if family is not None and family not in FAMILIES:
        raise FaultError(f"no family {family!r} of faults{nearest(family, FAMILIES)}")
    return tuple(kind.name for kind in FAULTS if family is None or kind.family == family)


def fault_named(name: str) -> FaultKind:
    """A fault by name; FaultError with the nearest name where there is none."""
    if name not in _BY_NAME:
        raise FaultError(f"no fault {name!r}{nearest(name, _BY_NAME)}")
    return _BY_NAME[name]


def injection(
    name: str, on: str | None = None, *, at_s: float = FROM_THE_FIRST_TICK, seed: int | None = None, **values: float
) -> Injection:
    """An armed fault: by name, on a target by name, from a time of the manoeuvre on, with parameters by name."""
    return fault_named(name).on(on, at_s=at_s, seed=seed, values=values)
