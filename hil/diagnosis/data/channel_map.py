"""``--map CHANNELS.toml``: which measured signal of another car is which channel of ours."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import CHANNELS, Floats, UnusableError
from hil.diagnosis.data.units import to_si

Series = tuple[Floats, Floats]


@dataclass(frozen=True)
class Source:
    """Where a channel comes from: SI = sign * scale * unit(value) + offset."""

    signal: str
    factor: float
    offset: float


@dataclass(frozen=True)
class ChannelMap:
    """Sources by channel; ``time`` names the time column of a table, None for the usual ones."""

    entries: Mapping[str, Source]
    time: str | None = None

    def sources(self) -> list[str]:
        """Signals wanted."""
        return [source.signal for source in self.entries.values()]

    def targets(self, present: Iterable[str]) -> list[str]:
        """Channels whose signal is there."""
        there = set(present)
        return [target for target, source in self.entries.items() if source.signal in there]

    def convert(self, target: str, series: Mapping[str, Series]) -> Series:
        """Times and SI values of a channel."""
        source = self.entries[target]
        t, values = series[source.signal]
        return t, np.asarray(values, np.float64) * source.factor + source.offset


def load_map(path: Path) -> ChannelMap:
    """Read a channel map.

    One table per channel: ``[ax_mps2]`` with ``signal`` ("MESSAGE.SIGNAL" or a column), and optionally ``unit``,
    ``scale``, ``sign`` (+1/-1) and ``offset`` (SI, added last). ``time = "column"`` at the top names a time column.

    Raises
    ------
    UnusableError
        Not TOML, an unknown channel or key, a unit nobody knows.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not a channel map: {error}") from error
    time = table.pop("time", None)
    table.pop("source", None)
    entries = {}
    for target, entry in table.items():
        where = f"{path}: {target}"
        if target not in CHANNELS:
            raise UnusableError(f"{where}: no such channel; expected one of {', '.join(CHANNELS)}")
        entry = {"signal": entry} if isinstance(entry, str) else entry
        odd = set(entry) - {"signal", "unit", "scale", "sign", "offset", "source"}
        if "signal" not in entry or odd:
            raise UnusableError(f"{where}: expected signal, unit, scale, sign, offset, got {', '.join(entry)}")
        factor, offset = to_si(str(entry.get("unit", "")), where)
        factor *= float(entry.get("scale", 1.0)) * float(entry.get("sign", 1.0))
        entries[target] = Source(str(entry["signal"]), factor, offset + float(entry.get("offset", 0.0)))
    return ChannelMap(entries, None if time is None else str(time))
