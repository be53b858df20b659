"""What a draft holds: a guess for each channel, with what was measured and what the data cannot tell."""

from dataclasses import dataclass, field
from typing import Any

from hil.diagnosis.draft.compare import Evidence


@dataclass(frozen=True)
class Guess:
    """One channel of the map.

    Attributes
    ----------
    signal, unit, sign, offset : as the map has them; ``offset`` in SI, None where none is needed.
    complete : False where a number is missing that the data do not give: the map then has it as a comment.
    basis : ``name``, ``unit stated``, ``unit guessed`` ... what the guess rests on.
    evidence : comparison of the signal with what it ought to be; None where nothing shows it.
    measured, unknown, check : sentences; what else was seen, what the data cannot tell, what to check.
    others : further signals that could be it.
    """

    channel: str
    signal: str
    unit: str = ""
    sign: int = 1
    offset: float | None = None
    complete: bool = True
    basis: tuple[str, ...] = ()
    evidence: Evidence | None = None
    measured: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    check: tuple[str, ...] = ()
    others: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Entry of ``channels``."""
        return {
            "channel": self.channel, "signal": self.signal, "unit": self.unit or None, "sign": self.sign,
            "offset": self.offset, "complete": self.complete, "basis": list(self.basis),
            "evidence": None if self.evidence is None else self.evidence.as_json(), "measured": list(self.measured),
            "unknown": list(self.unknown), "check": list(self.check), "others": list(self.others),
        }  # fmt: skip


@dataclass(frozen=True)
class SetNumber:
    """One number of the vehicle set: measured in the logs with its interval, or a product that they give.

    ``value`` and ``half_width`` are None where the logs do not give the number itself; ``text`` says what was measured.
    """

    key: str
    text: str
    value: float | None = None
    half_width: float | None = None

    def as_json(self) -> dict[str, Any]:
        """Entry of ``set``."""
        return {"key": self.key, "value": self.value, "half_width": self.half_width, "measured": self.text}


@dataclass(frozen=True)
class Draft:
    """A channel map and a vehicle set, drafted.

    Attributes
    ----------
    files : the logs.  time : time column to name in the map; None for a usual one.
    guesses : channels.  numbers : of the vehicle set.  required : keys that the set must have before it is used.
    remarks : of the whole.  left_out : signal -> why it is no measured quantity, of those whose names say otherwise.
    unused : names of signals that no channel takes.
    """

    files: tuple[str, ...]
    time: str | None
    guesses: tuple[Guess, ...]
    numbers: tuple[SetNumber, ...]
    required: tuple[str, ...]
    remarks: tuple[str, ...] = ()
    left_out: dict[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """Required keys that the logs do not give."""
        given = {one.key for one in self.numbers if one.value is not None}
        return tuple(key for key in self.required if key not in given)

    def as_json(self) -> dict[str, Any]:
        """What ``brakebench prepare --json`` prints, without the files written."""
        return {
            "logs": list(self.files), "time": self.time, "channels": [one.as_json() for one in self.guesses],
            "set": [one.as_json() for one in self.numbers], "missing": list(self.missing),
            "remarks": list(self.remarks), "left_out": self.left_out, "unused": list(self.unused),
        }  # fmt: skip
