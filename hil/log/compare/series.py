"""Chosen signals of a log as whole columns."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.frames import FrameTable
from hil.log.signals.decode import Decoder
from hil.log.signals.decoded import Rows, Values


@dataclass(slots=True, eq=False)
class Samples:
    """One signal: ``rows`` index the frames of its message."""

    signal: Signal
    rows: Rows
    values: Values


@dataclass(slots=True, eq=False)
class MessageSeries:
    """The frames of one message: their stamps (ns) and its signals by name."""

    time_ns: npt.NDArray[np.int64]
    signals: dict[str, Samples] = field(default_factory=dict)


def collect(tables: Iterable[FrameTable], decoder: Decoder) -> dict[str, MessageSeries]:
    """Messages by name with their signals, as whole columns: memory grows with what the decoder wants."""
    times: dict[str, list[npt.NDArray[np.int64]]] = {}
    counts: dict[str, int] = {}
    parts: dict[str, dict[str, list[Samples]]] = {}
    for table in tables:
        log = decoder.add(table)
        wanted = {full.rpartition(".")[0] for full in log.columns}
        for name in wanted:
            times.setdefault(name, []).append(table.time_ns[log.rows[name]])
            parts.setdefault(name, {})
        for full, column in log.columns.items():
            name, _, signal = full.rpartition(".")
            at = np.searchsorted(log.rows[name], column.rows) + counts.get(name, 0)
            parts[name].setdefault(signal, []).append(Samples(column.signal, at, column.values))
        for name in wanted:
            counts[name] = counts.get(name, 0) + len(log.rows[name])
    return {
        name: MessageSeries(np.concatenate(some), {signal: _joined(samples) for signal, samples in parts[name].items()})
        for name, some in times.items()
    }


def _joined(samples: list[Samples]) -> Samples:
    return Samples(
        samples[0].signal,
        np.concatenate([one.rows for one in samples]),
        np.concatenate([one.values for one in samples]),
    )
