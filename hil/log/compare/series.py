"""Chosen signals of a log as whole columns."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.frames import FrameTable
from hil.log.signals.decode import Decoder
from hil.log.signals.decoded import Column, Rows, Values


@dataclass(slots=True, eq=False)
class Samples:
    """One signal: ``rows`` index the frames of its message; None where each of them has a value."""

    signal: Signal
    rows: Rows | None
    values: Values


@dataclass(slots=True, eq=False)
class MessageSeries:
    """The frames of one message: their stamps (ns) and its signals by name."""

    time_ns: npt.NDArray[np.int64]
    signals: dict[str, Samples] = field(default_factory=dict)


def collect(tables: Iterable[FrameTable], decoder: Decoder, frames: Mapping[str, int]) -> dict[str, MessageSeries]:
    """Messages by name with their signals, as whole columns: memory grows with what the decoder wants.

    Parameters
    ----------
    frames : how many frames each message has, so that its columns need not be copied as they grow.
    """
    times: dict[str, _Growing] = {}
    signals: dict[str, dict[str, _Signal]] = {}
    for table in tables:
        log = decoder.add(table)
        before: dict[str, int] = {}
        for full, column in log.columns.items():
            name, _, signal = full.rpartition(".")
            if name not in before:
                stamps = times.setdefault(name, _Growing(np.dtype(np.int64), frames.get(name, 0)))
                before[name] = stamps.n
                stamps.add(table.time_ns[log.rows[name]])
            of_message = signals.setdefault(name, {})
            if signal not in of_message:
                of_message[signal] = _Signal(column, frames.get(name, 0))
            of_message[signal].add(column, log.rows[name], before[name])
    return {
        name: MessageSeries(stamps.content(), {signal: one.samples(stamps.n) for signal, one in signals[name].items()})
        for name, stamps in times.items()
    }


class _Growing:
    """An array that grows at its end."""

    def __init__(self, dtype: np.dtype[Any], expected: int) -> None:
        self._content: npt.NDArray[Any] = np.empty(expected, dtype)
        self.n = 0

    def add(self, further: npt.NDArray[Any]) -> None:
        """Append; where there are more than expected, the room doubles."""
        end = self.n + len(further)
        if end > len(self._content):
            wider = np.empty(max(end, 2 * len(self._content)), self._content.dtype)
            wider[: self.n] = self._content[: self.n]
            self._content = wider
        self._content[self.n : end] = further
        self.n = end

    def content(self) -> npt.NDArray[Any]:
        """What was appended."""
        return self._content[: self.n]


class _Signal:
    """One signal, table after table; its rows are kept from the first frame on that has no value."""

    def __init__(self, column: Column, expected: int) -> None:
        self._signal = column.signal
        self._expected = expected
        self._values = _Growing(column.values.dtype, expected)
        self._rows: _Growing | None = None

    def add(self, column: Column, frames: Rows, before: int) -> None:
        """Values of a table, whose message has the frames ``frames`` in it and ``before`` before it."""
        if self._rows is None and (len(column.rows) != len(frames) or self._values.n != before):
            self._rows = self._every()
        if self._rows is not None:
            self._rows.add(np.searchsorted(frames, column.rows) + before)
        self._values.add(column.values)

    def samples(self, frames: int) -> Samples:
        """All values; ``frames`` are those of the message."""
        if self._rows is None and self._values.n != frames:
            self._rows = self._every()
        return Samples(self._signal, None if self._rows is None else self._rows.content(), self._values.content())

    def _every(self) -> _Growing:
        rows = _Growing(np.dtype(np.int64), self._expected)
        rows.add(np.arange(self._values.n))
        return rows
