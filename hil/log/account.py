"""What a reader noticed beside the frames: pieces rejected, passed over, cut off, and what it assumed."""

from collections import Counter
from dataclasses import dataclass, field

from hil.log.frames import Rejected

FIRST_REJECTED = 10  # how many rejected pieces are shown
SHOWN_BYTES = 80  # of each


def printable(text: bytes | str) -> str:
    """Text that is safe on a terminal: bytes that are no visible ASCII, letters that are not printable are escaped."""
    if isinstance(text, bytes):
        text = text.decode("ascii", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


@dataclass(slots=True)
class Account:
    """Kept by a reader while it reads; complete when its last frame has been taken.

    Attributes
    ----------
    rejected : pieces that should be a frame and are none.
    first_rejected : the first `FIRST_REJECTED` of them.
    truncated_at : byte offset from which the log is cut off, None where it is whole.
    passed_over : what is no frame by its nature (status lines, events of other buses), counted by kind.
    start_ns : start time that the log states, ns since 1970; None where it states none.
    local_start : the start time is a wall clock without a zone, read in the zone that was chosen.
    notes : what else the reader should know.
    wanted_frame, wanted_end : number of a frame (from 0), asked for before the reading; the offset behind its line in a
        text log.
    """

    rejected: int = 0
    first_rejected: list[Rejected] = field(default_factory=list)
    truncated_at: int | None = None
    passed_over: Counter[str] = field(default_factory=Counter)
    start_ns: int | None = None
    local_start: bool = False
    notes: list[str] = field(default_factory=list)
    wanted_frame: int | None = None
    wanted_end: int | None = None

    @property
    def whole(self) -> bool:
        """Nothing was rejected or is missing."""
        return not self.rejected and self.truncated_at is None

    def reject(self, offset: int, text: bytes | str) -> None:
        """Count a piece that should be a frame and is none."""
        self.rejected += 1
        if len(self.first_rejected) < FIRST_REJECTED:
            self.first_rejected.append(Rejected(offset, printable(text[:SHOWN_BYTES])))

    def cut_at(self, offset: int) -> None:
        """Note where the log is cut off; the first place counts."""
        if self.truncated_at is None:
            self.truncated_at = offset

    def note(self, text: str) -> None:
        """Note something once."""
        if text not in self.notes:
            self.notes.append(text)
