"""Log files of any kind (CAN logs, CSV, Parquet, MF4, MAT) into the canonical table."""

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dbc.database import Database
from hil.diagnosis.data.brakebench_signals import own_channels, own_sources
from hil.diagnosis.data.channel_map import ChannelMap, channel_to_si
from hil.diagnosis.data.channels_read import GAP_S
from hil.diagnosis.data.columns import Column, by_name, with_unit
from hil.diagnosis.data.hints import expected_instead
from hil.diagnosis.data.log import CHANNELS, Floats, Log, Origin, UnusableError, make_log
from hil.diagnosis.data.table_text import read_text_table
from hil.diagnosis.data.time_column import NAMES, times_s
from hil.errors import in_words, unknown_keys
from hil.extras import missing
from hil.log import DecodedLog, decode_log, log_format, read_log
from hil.scenario.parameters import is_number

_GRID_S = 0.01
_MOTION, _SLOW_S = ("ax_mps2", "ay_mps2", "yaw_rate_rad_s", "speed_mps"), 0.04
"""Channels of the motion, and the time between two samples from which on one is slow: the cells of a comparison."""
_TABLES = (".csv", ".parquet", ".mf4", ".mdf", ".mat")
_CSV_FRAMES = ("csv", "python_can_csv", "gvret")
"""Formats of frames with the suffix of a table; rows of numbers between tabs look like other logs of frames."""
_FACTS = ("direction", "initial_disc_temperature_k")
"""Keys of a log in ``logs.toml``."""
_FRAMES = {"channel", "id", "extended", "length", "data"}


def read_logs(
    paths: Sequence[Path], database: Database | None = None, channel_map: ChannelMap | None = None,
    about: Path | None = None, torque_constant_nm_a: float = 1.0,
) -> list[Log]:  # fmt: skip
    """Read logs; folders give all the logs in them.

    Parameters
    ----------
    about : ``logs.toml``; None takes the one beside the logs, where there is one.

    Raises
    ------
    UnusableError, hil.log.frames.LogError
        A file that cannot be used: the message says why.
    """
    files = [file for path in paths for file in files_of(path)]
    if not files:
        raise UnusableError(f"no log in {', '.join(map(str, paths))}; give log files or a folder of them")
    return [_with_log_facts(read_one(file, database, channel_map, torque_constant_nm_a), file, about) for file in files]


def files_of(path: Path) -> list[Path]:
    """The logs in a folder; a file itself."""
    if not path.is_dir():
        return [path]
    suffixes = {*_TABLES, ".log", ".asc", ".blf", ".trc", ".pcap", ".pcapng", ".gz"}
    return sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes and not file.name.startswith("."))


def _with_log_facts(log: Log, file: Path, about: Path | None) -> Log:
    """A log with its entry of ``logs.toml``: ``["name.csv"]`` with direction and initial_disc_temperature_k."""
    source = about or file.parent / "logs.toml"
    if not source.exists():
        if about is not None:
            raise UnusableError(f"{about}: no such file; give the logs.toml that describes the logs")
        return log
    try:
        table = tomllib.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise UnusableError(f"{source}: cannot be read: {in_words(error)}") from error
    except ValueError as error:
        raise UnusableError(f"{source}: not valid TOML: {in_words(error)}") from error
    entry = table.get(file.name, table.get(file.stem, table.get("logs", {}).get(file.name, {})))
    if not isinstance(entry, Mapping):
        raise UnusableError(f"{source}: {file.name}: expected a table with direction and initial_disc_temperature_k")
    if odd := unknown_keys(entry, _FACTS):
        raise UnusableError(f"{source}: {file.name}: {odd}")
    loose = {name: value for name, value in table.items() if not isinstance(value, Mapping)}
    if loose:
        raise UnusableError(
            f'{source}: {", ".join(loose)}: expected tables alone, one for each log; write it below ["{file.name}"]'
        )
    direction = entry.get("direction", 1)
    if direction not in (1, -1):
        raise UnusableError(f"{source}: {file.name}: direction: expected 1 or -1, got {direction!r}")
    temperature = entry.get("initial_disc_temperature_k")
    if temperature is not None and not (is_number(temperature) and 200.0 <= temperature <= 1300.0):
        raise UnusableError(
            f"{source}: {file.name}: initial_disc_temperature_k: expected 200 to 1300, got {temperature!r}"
        )
    return replace(
        log, direction=int(direction), disc_temperature_k=None if temperature is None else float(temperature)
    )


def read_one(
    path: Path, database: Database | None = None, channel_map: ChannelMap | None = None,
    torque_constant_nm_a: float = 1.0,
) -> Log:  # fmt: skip
    """Read one log: a table by its suffix and header, else a CAN log."""
    used = {*CHANNELS, *NAMES} if channel_map is None else {*channel_map.sources(), channel_map.time or "t_s"}
    columns = None if database is not None else _table_columns(path, used)
    if columns is not None:
        return replace(from_columns(path.name, columns, channel_map), another_car=True)
    decoded = decode_log(read_log(path), database)
    if channel_map is not None:
        series = {name: decoded.series(name) for name in channel_map.sources() if name in decoded.columns}
        targets = channel_map.targets(series)
        units = {target: channel_map.entries[target].unit for target in targets}
        signals = {target: channel_map.entries[target].signal for target in targets}
        converted = {target: channel_map.convert(target, series) for target in targets}
        gridded = _gridded(path.name, converted, signals, units, tuple(decoded.columns), sparse=True)
        return replace(gridded, another_car=True)
    if database is not None:
        raise UnusableError(f"{path.name}: another car's DBC needs --map CHANNELS.toml, its signals by channel")
    return _brakebench_log(path.name, decoded, torque_constant_nm_a)


@dataclass(frozen=True, eq=False)
class Samples:
    """All signals of one file as they came: times, s, and values by name, units as stated; ``time`` of a table."""

    name: str
    series: Mapping[str, tuple[Floats, Floats]]
    units: Mapping[str, str]
    time: str | None = None


def read_samples(path: Path, database: Database | None = None) -> Samples:
    """Every signal of a file, whatever it is called.

    Raises
    ------
    UnusableError
        A table without times; a CAN log of another car without ``database``, or one that it does not describe.
    """
    columns = None if database is not None else _table_columns(path, NAMES)
    if columns is not None:
        time, t_s, _ = times_s(path.name, columns, _time_of(columns))
        own = {
            key: (t_s, one.values) if one.own_t_s is None or one.own_values is None else (one.own_t_s, one.own_values)
            for key, one in columns.items()
            if key != time
        }
        return Samples(path.name, own, {key: one.unit for key, one in columns.items()}, None if time in NAMES else time)
    decoded = decode_log(read_log(path), database)
    if database is None and own_channels(decoded, 1.0):
        raise UnusableError(f"{path.name}: a recording of brakebench's own bus: `explain` takes it without a map")
    if not decoded.columns:
        how = "none of its messages is in the DBC" if database is not None else "another car's frames need its --dbc"
        raise UnusableError(f"{path.name}: no signal in it: {how}")
    units = {name: column.signal.unit or "" for name, column in decoded.columns.items()}
    return Samples(path.name, {name: decoded.series(name) for name in decoded.columns}, units)


def _time_of(columns: Mapping[str, Column]) -> str | None:
    """The time column where it has none of the usual names: the first whose name begins so and whose values grow."""
    if any(key in columns for key in NAMES):
        return None
    named = [key for key in columns if key.lower().startswith(("time", "zeit", "t_", "stamp")) or key.lower() == "t"]
    return next(
        (key for key in named if len(columns[key].values) > 1 and np.diff(columns[key].values).min() >= 0), None
    )


def _brakebench_log(name: str, decoded: DecodedLog, torque_constant_nm_a: float) -> Log:
    series = own_channels(decoded, torque_constant_nm_a)
    if not series:
        raise UnusableError(f"{name}: no signal of our own DBC in it; give --dbc and --map for another car's log")
    signals, units = own_sources()
    return _gridded(name, series, signals, units, tuple(decoded.columns))


def _gridded(
    name: str, series: Mapping[str, tuple[Floats, Floats]], signals: Mapping[str, str], units: Mapping[str, str],
    columns: Sequence[str], sparse: bool = False,
) -> Log:  # fmt: skip
    """Channels with their own time stamps on one grid: linear interpolation, NaN over gaps of 0.25 s.

    ``signals`` and ``units`` are what each channel was made of, ``columns`` the names of all signals. ``sparse`` leaves
    a slow channel of the motion empty between its samples: what is drawn between them is no measurement, and smooth.
    """
    if not series:
        raise UnusableError(f"{name}: none of the mapped signals is in the log; {expected_instead(columns, CHANNELS)}")
    begin = max(min(float(t[0]) for t, _ in series.values()), 0.0)
    end = max(float(t[-1]) for t, _ in series.values())
    grid = np.arange(begin, end, _GRID_S)
    values_of = {}
    for channel, (t, v) in series.items():
        values = np.interp(grid, t, v, left=np.nan, right=np.nan)
        nearest = np.clip(np.searchsorted(t, grid), 1, len(t) - 1) if len(t) > 1 else np.zeros(len(grid), int)
        gap = t[nearest] - t[nearest - 1] if len(t) > 1 else np.full(len(grid), np.inf)
        values[gap > GAP_S] = np.nan
        if sparse and channel in _MOTION and len(t) > 1 and float(np.median(np.diff(t))) > _SLOW_S:
            between = np.ones(len(grid), bool)
            between[np.clip(np.round((t - begin) / _GRID_S).astype(int), 0, len(grid) - 1)] = False
            values[between] = np.nan
        values_of[channel] = values
    origins = {channel: Origin(signals[channel], units[channel], t, v) for channel, (t, v) in series.items()}
    return make_log(name, grid - begin, values_of, origins=origins, columns=columns)


def from_columns(name: str, columns: Mapping[str, Column], channel_map: ChannelMap | None = None) -> Log:
    """A log from columns and their units; an empty unit is that of the canonical name."""
    time, t_s, remarks = times_s(name, columns, None if channel_map is None else channel_map.time)
    channels, origins = {}, {}
    if channel_map is not None:
        series = {key: (t_s, column.values) for key, column in columns.items()}
        for target in channel_map.targets(series):
            source = channel_map.entries[target]
            channels[target] = channel_map.convert(target, series)[1]
            origins[target] = _origin(source.signal, source.unit, columns[source.signal], source.factor, source.offset)
        if not channels:
            wanted = ", ".join(source.signal for source in list(channel_map.entries.values())[:12])
            seen = ", ".join(list(columns)[:20])
            raise UnusableError(
                f"{name}: none of the columns that --map names is there ({wanted}); columns seen: {seen}"
            )
    else:
        for key, column in columns.items():
            if key == time:
                continue
            scale, offset = 1.0, 0.0
            if key in CHANNELS:
                scale, offset = channel_to_si(key, column.unit, f"{name}: {key}")
                origins[key] = _origin(key, column.unit, column, scale, offset)
            channels[key] = column.values * scale + offset
    return make_log(name, t_s, channels, tuple(remarks), origins, [key for key in columns if key != time])


def _origin(name: str, unit: str, column: Column, factor: float, offset: float) -> Origin:
    values = None if column.own_values is None else column.own_values * factor + offset
    return Origin(name, unit, column.own_t_s, values)


def from_frame(frame: Any, name: str = "dataframe") -> Log:
    """A log from a pandas or polars data frame, or any mapping of columns."""
    # iterating a polars frame gives its columns, not their names
    columns = ((str(key), frame[key]) for key in frame.keys())  # noqa: SIM118
    named = ((key, Column(np.asarray(values, np.float64))) for key, values in columns if np.ndim(values) == 1)
    return from_columns(name, dict(named))


def _table_columns(path: Path, used: Collection[str]) -> dict[str, Column] | None:
    """Columns by name, those ``used`` once each; None where the file is a log of frames."""
    suffix = path.suffix.lower()
    if suffix == ".csv" and path.exists() and log_format(path) in _CSV_FRAMES:
        return None
    readers = {".csv": _csv, ".parquet": _parquet, ".mf4": _mdf, ".mdf": _mdf, ".mat": _mat}
    columns = readers[suffix](path) if suffix in readers else None
    return None if columns is None else by_name(str(path), columns, used)


def _csv(path: Path) -> list[tuple[str, Column]]:
    columns = []
    for head, below, values in read_text_table(path):
        name, unit = with_unit(head, below)
        columns.append((name, Column(values, unit)))
    return columns


def _parquet(path: Path) -> list[tuple[str, Column]] | None:
    import pyarrow as pa
    import pyarrow.parquet

    try:
        with pyarrow.parquet.ParquetFile(path) as file:  # read_table refuses a head that stands twice
            table = file.read()
    except (pa.ArrowException, OSError) as error:
        raise UnusableError(f"{path}: not a Parquet file: {str(error).splitlines()[0]}") from error
    if set(table.column_names) >= _FRAMES:
        return None
    columns = []
    for item, content in zip(table.schema, table.columns, strict=True):
        if pa.types.is_timestamp(item.type):
            content, item = content.cast(pa.timestamp("ns")).cast(pa.int64()), item.with_metadata({"unit": "ns"})
        elif not (pa.types.is_floating(item.type) or pa.types.is_integer(item.type)):
            continue
        name, unit = with_unit(item.name, (item.metadata or {}).get(b"unit", b"").decode())
        columns.append((name, Column(np.asarray(content.to_numpy(), np.float64), unit)))
    return columns


def _mdf(path: Path) -> list[tuple[str, Column]] | None:
    try:
        import asammdf
    except ImportError as error:
        raise UnusableError(f"{path}: explain {missing('asammdf')}") from error
    try:
        with asammdf.MDF(path) as mdf:
            if any("CAN_DataFrame" in {c.name for c in group.channels} for group in mdf.groups):
                return None
            signals = [
                s for s in mdf.iter_channels(skip_master=True) if s.samples.ndim == 1 and s.samples.dtype.kind in "fiu"
            ]
    except Exception as error:  # asammdf raises many kinds on a damaged block
        raise UnusableError(f"{path}: asammdf cannot read it: {error}") from error
    signals = [s for s in signals if len(s.samples)]
    if not signals:
        raise UnusableError(f"{path}: no numeric signal in it")
    longest = np.asarray(max(signals, key=lambda s: len(s.timestamps)).timestamps, np.float64)
    columns = [("t_s", Column(longest, "s"))]
    for s in signals:
        own = s.samples.astype(np.float64)
        columns.append((s.name, Column(np.interp(longest, s.timestamps, own), s.unit, s.timestamps, own)))
    return columns


def _mat(path: Path) -> list[tuple[str, Column]]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=True)
    except Exception as error:  # scipy raises many kinds, NotImplementedError for version 7.3
        raise UnusableError(f"{path}: scipy cannot read it (version 7.3? save with -v7): {error}") from error
    vectors = {k: np.asarray(v, np.float64) for k, v in content.items() if not k.startswith("__") and _numeric(v)}
    return [(with_unit(key)[0], Column(values, with_unit(key)[1])) for key, values in vectors.items()]


def _numeric(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub" and value.size > 1
