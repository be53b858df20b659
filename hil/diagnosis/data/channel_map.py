"""Channel map (``--map CHANNELS.toml``): another car's signals as our channels, and the units they may have."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import CHANNELS, Floats, UnusableError
from hil.diagnosis.data.units import ROAD_SPEED, TO_SI, units_of, written
from hil.errors import in_words, unknown_keys

_KEYS = ("signal", "unit", "scale", "sign", "offset", "source")
_QUESTION = re.compile(r"^\s*([A-Za-z_0-9]+)\s*=\s*\?")
Series = tuple[Floats, Floats]
"""Times (s) and values of one signal, both (samples,)."""


def to_si(unit: str, where: str) -> tuple[float, float]:
    """Factor and offset of a unit: SI = value * factor + offset; ``where`` opens the error message.

    Raises
    ------
    UnusableError
        Unknown unit.
    """
    conversion = TO_SI.get(unit.strip().lower())
    if conversion is None:
        raise UnusableError(f"{where}: unknown unit {unit!r}; expected one of {', '.join(u for u in TO_SI if u)}")
    return conversion


def channel_to_si(channel: str, unit: str, where: str, scaled: bool = False) -> tuple[float, float]:
    """As `to_si`, of a unit that measures what the channel holds.

    Parameters
    ----------
    scaled : whether a scale is given besides: a wheel speed as a speed of the road needs one over the rolling radius.

    Raises
    ------
    UnusableError
        Unknown unit, or one of another quantity.
    """
    factor, offset = to_si(unit, where)
    units, name = units_of(channel), unit.strip().lower()
    if not name or name in units or scaled:
        return factor, offset
    if channel.startswith("wheel_speed") and name in ROAD_SPEED:
        raise UnusableError(
            f"{where}: {unit!r} is a speed of the road, expected one of the wheel (rad/s, rpm, ...): divide it by the "
            f'rolling radius in a --map, [{channel}] unit = "{unit}", scale = 1 / radius_m (3.2258 for 0.31 m)'
        )
    raise UnusableError(f"{where}: {unit!r} is no unit of {channel}; expected {', '.join(map(written, units))}")


@dataclass(frozen=True)
class Source:
    """Signal of a channel: SI = factor * value + offset; ``unit`` as the map names it."""

    signal: str
    factor: float
    offset: float
    unit: str = ""


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


def refuse_question_marks(path: Path, text: str) -> None:
    """Refuse a draft (`brakebench prepare`) in which a number is still a question mark.

    Raises
    ------
    UnusableError
        With the lines.
    """
    marked = [f"{key} (line {k})" for k, line in enumerate(text.splitlines(), 1) for key in _QUESTION.findall(line)]
    if marked:
        raise UnusableError(f"{path}: not filled in: {', '.join(marked)}: write a number, or # before the line")


def load_map(path: Path, radius_m: float | None = None) -> ChannelMap:
    """Read a channel map; wheel speeds in units of the road are divided by the rolling radius, if that is given.

    One table per channel: ``[ax_mps2]`` with ``signal`` ("MESSAGE.SIGNAL" or a column), and optionally ``unit``,
    ``scale``, ``sign`` (+1/-1) and ``offset`` (SI, added last). ``time = "column"`` at the top names a time column.

    Raises
    ------
    UnusableError
        Not TOML; an unknown channel, key or unit.
    """
    try:
        text = path.read_text(encoding="utf-8")
        refuse_question_marks(path, text)
        table = tomllib.loads(text)
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not a channel map: {in_words(error)}") from error
    time = table.pop("time", None)
    table.pop("source", None)
    entries = {}
    for target, entry in table.items():
        where = f"{path}: {target}"
        if target not in CHANNELS:
            raise UnusableError(f"{where}: unknown channel; expected one of {', '.join(CHANNELS)}")
        entry = {"signal": entry} if isinstance(entry, str) else entry
        if not isinstance(entry, dict) or "signal" not in entry:
            raise UnusableError(f"{where}: expected a table with signal = 'MESSAGE.SIGNAL' or a column, got {entry!r}")
        if odd := unknown_keys(entry, _KEYS):
            raise UnusableError(f"{where}: {odd}")
        unit = str(entry.get("unit", ""))
        on_road = target.startswith("wheel_speed") and unit.strip().lower() in ROAD_SPEED and "scale" not in entry
        factor, offset = channel_to_si(target, unit, where, "scale" in entry or (on_road and radius_m is not None))
        factor /= radius_m if on_road and radius_m is not None else 1.0
        factor *= float(entry.get("scale", 1.0)) * float(entry.get("sign", 1.0))
        entries[target] = Source(str(entry["signal"]), factor, offset + float(entry.get("offset", 0.0)), unit)
    return ChannelMap(entries, None if time is None else str(time))
