"""The memory of trouble codes as UDS shows it: status byte, snapshot, counters, over restarts of the law.

The law debounces and heals (docs/trouble-codes.md): a code that it finds active has failed its test and is confirmed
in the same tick. An operation cycle lasts from one ECUReset to the next.
"""

from dataclasses import dataclass
from enum import IntFlag

from ecu.law.trouble_codes import BIT, CODES, FreezeFrame, TroubleCode, TroubleMemory

AGED_AFTER = 40  # operation cycles without failure; usual, as the warm-up cycles of ISO 15031-6
MOST = 255  # that a counter of one byte holds


class Status(IntFlag):
    """Bits of a code's status (ISO 14229-1, D.2)."""

    TEST_FAILED = 0x01
    FAILED_THIS_CYCLE = 0x02
    PENDING = 0x04
    CONFIRMED = 0x08
    NOT_COMPLETED_SINCE_CLEAR = 0x10
    FAILED_SINCE_CLEAR = 0x20
    NOT_COMPLETED_THIS_CYCLE = 0x40
    WARNING_INDICATOR = 0x80


_FAILED = (
    Status.TEST_FAILED | Status.FAILED_THIS_CYCLE | Status.PENDING | Status.CONFIRMED | Status.FAILED_SINCE_CLEAR
    | Status.WARNING_INDICATOR
)  # fmt: skip
_NOT_COMPLETED = Status.NOT_COMPLETED_SINCE_CLEAR | Status.NOT_COMPLETED_THIS_CYCLE


def dtc_of(code: TroubleCode) -> int:
    """The code's three bytes: its number, and failure type 0, no further information."""
    return code.number << 8


@dataclass
class Entry:
    """What is remembered of one code; ``snapshot`` with the law's time, s, when the code was confirmed."""

    status: Status = _NOT_COMPLETED
    occurrences: int = 0
    aging: int = 0
    snapshot: tuple[float, FreezeFrame] | None = None


class TroubleCodeMemory:
    """Entries of all codes by their three bytes, in the order of the list."""

    def __init__(self) -> None:
        self.entries = {dtc_of(code): Entry() for code in CODES}
        self.enabled = True
        self._active = 0

    def update(self, troubles: TroubleMemory) -> None:
        """Take what the law holds; nothing happens while the setting of codes is off."""
        changed = self._active ^ troubles.active
        if not self.enabled or not changed:
            return
        self._active = troubles.active
        for code, active, _, first_s, _, freeze_frame in troubles.troubles:
            if changed & BIT[code.name]:
                changed &= ~BIT[code.name]
                self._change(self.entries[dtc_of(code)], active, first_s, freeze_frame)
        for code in CODES:  # forgotten by the law
            if changed & BIT[code.name]:
                self.entries[dtc_of(code)].status &= ~(Status.TEST_FAILED | Status.WARNING_INDICATOR)

    @staticmethod
    def _change(entry: Entry, active: bool, first_s: float, freeze_frame: FreezeFrame) -> None:
        if not active:
            entry.status &= ~(Status.TEST_FAILED | Status.WARNING_INDICATOR)
            return
        entry.status = (entry.status | _FAILED) & ~_NOT_COMPLETED
        entry.occurrences = min(entry.occurrences + 1, MOST)
        entry.aging = 0
        if entry.snapshot is None:
            entry.snapshot = first_s, freeze_frame

    def complete(self) -> None:
        """Every test has run: all of them run at each tick."""
        if self.enabled:
            for entry in self.entries.values():
                entry.status &= ~_NOT_COMPLETED

    def clear(self, dtcs: tuple[int, ...]) -> None:
        """Forget codes; one that is still failed comes again at the law's next tick."""
        for code in CODES:
            if dtc_of(code) in dtcs:
                self.entries[dtc_of(code)] = Entry()
                self._active &= ~BIT[code.name]

    def new_cycle(self) -> None:
        """Begin an operation cycle: codes that did not fail in the last one age."""
        self._active = 0
        for entry in self.entries.values():
            status = entry.status
            if not status & (Status.FAILED_THIS_CYCLE | Status.NOT_COMPLETED_THIS_CYCLE):
                status &= ~Status.PENDING
                if status & Status.CONFIRMED:
                    entry.aging += 1
                    if entry.aging >= AGED_AFTER:
                        status &= ~Status.CONFIRMED
                        entry.snapshot, entry.aging, entry.occurrences = None, 0, 0
            status &= ~(Status.TEST_FAILED | Status.FAILED_THIS_CYCLE | Status.WARNING_INDICATOR)
            entry.status = status | Status.NOT_COMPLETED_THIS_CYCLE
