"""Channel map (``--map CHANNELS.toml``): another car's signals as our channels, and the units they may have."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import CHANNELS, Floats, UnusableError

Series = tuple[Floats, Floats]
"""Times (s) and values of one signal, both (samples,)."""
_TO_SI: dict[str, tuple[float, float]] = {
    "": (1.0, 0.0), "1": (1.0, 0.0), "s": (1.0, 0.0), "ms": (1e-3, 0.0), "us": (1e-6, 0.0), "ns": (1e-9, 0.0),
    "rad/s": (1.0, 0.0), "deg/s": (0.017453292519943295, 0.0), "rpm": (0.10471975511965977, 0.0),
    "1/min": (0.10471975511965977, 0.0), "m/s2": (1.0, 0.0), "m/s^2": (1.0, 0.0), "m/s²": (1.0, 0.0),
    "g": (9.80665, 0.0), "pa": (1.0, 0.0), "kpa": (1e3, 0.0), "mpa": (1e6, 0.0), "bar": (1e5, 0.0),
    "psi": (6894.757293168, 0.0), "nm": (1.0, 0.0), "n m": (1.0, 0.0), "rad": (1.0, 0.0),
    "deg": (0.017453292519943295, 0.0), "%": (0.01, 0.0), "m/s": (1.0, 0.0), "km/h": (1.0 / 3.6, 0.0),
    "kmph": (1.0 / 3.6, 0.0), "kph": (1.0 / 3.6, 0.0), "mph": (0.44704, 0.0), "k": (1.0, 0.0), "degc": (1.0, 273.15),
}  # fmt: skip
"""Unit -> factor and offset to SI."""


def to_si(unit: str, where: str) -> tuple[float, float]:
    """Factor and offset of a unit: SI = value * factor + offset; ``where`` opens the error message.

    Raises
    ------
    UnusableError
        Unknown unit.
    """
    conversion = _TO_SI.get(unit.strip().lower())
    if conversion is None:
        raise UnusableError(f"{where}: unknown unit {unit!r}; expected one of {', '.join(u for u in _TO_SI if u)}")
    return conversion


@dataclass(frozen=True)
class Source:
    """Signal of a channel: SI = factor * value + offset."""

    signal: str
    factor: float
    offset: float


@dataclass(frozen=True)
class ChannelMap:
    """Sources by channel; ``time`` names the time column of a table, None for the default ones."""

    entries: Mapping[str, Source]
    time: str | None = None

    def sources(self) -> list[str]:
        """Names of all mapped signals."""
        return [source.signal for source in self.entries.values()]

    def targets(self, present: Iterable[str]) -> list[str]:
        """Channels whose signal is among those ``present``."""
        available = set(present)
        return [target for target, source in self.entries.items() if source.signal in available]

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
        Not TOML; an unknown channel, key or unit.
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
            raise UnusableError(f"{where}: unknown channel; expected one of {', '.join(CHANNELS)}")
        entry = {"signal": entry} if isinstance(entry, str) else entry
        unknown = set(entry) - {"signal", "unit", "scale", "sign", "offset", "source"}
        if "signal" not in entry or unknown:
            raise UnusableError(f"{where}: expected signal, unit, scale, sign, offset, got {', '.join(entry)}")
        factor, offset = to_si(str(entry.get("unit", "")), where)
        factor *= float(entry.get("scale", 1.0)) * float(entry.get("sign", 1.0))
        entries[target] = Source(str(entry["signal"]), factor, offset + float(entry.get("offset", 0.0)))
    return ChannelMap(entries, None if time is None else str(time))
