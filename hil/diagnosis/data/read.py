"""Log files of any kind (CAN logs, CSV, Parquet, MF4, MAT) into the canonical table."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dbc.database import Database
from hil.diagnosis.data.brakebench_signals import own_channels
from hil.diagnosis.data.channel_map import ChannelMap, to_si
from hil.diagnosis.data.log import CHANNELS, Floats, Log, UnusableError, make_log
from hil.log import DecodedLog, decode_log, log_format, read_log

_GRID_S = 0.01
_TABLES = (".csv", ".parquet", ".mf4", ".mdf", ".mat")
_WITH_UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*")
_FRAMES = {"channel", "id", "extended", "length", "data"}
_HOLD_S = 0.25


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
    files = [file for path in paths for file in _files(path)]
    if not files:
        raise UnusableError(f"no log in {', '.join(map(str, paths))}; give log files or a folder of them")
    return [_with_log_facts(read_one(file, database, channel_map, torque_constant_nm_a), file, about) for file in files]


def _files(path: Path) -> list[Path]:
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
    except (OSError, ValueError) as error:
        raise UnusableError(f"{source}: not valid TOML: {error}") from error
    entry = table.get(file.name, table.get(file.stem, table.get("logs", {}).get(file.name, {})))
    if not isinstance(entry, Mapping):
        raise UnusableError(f"{source}: {file.name}: expected a table with direction and initial_disc_temperature_k")
    direction = int(entry.get("direction", 1))
    if direction not in (1, -1):
        raise UnusableError(f"{source}: {file.name}: direction: expected 1 or -1, got {direction}")
    temperature = entry.get("initial_disc_temperature_k")
    if temperature is not None and not 200.0 <= float(temperature) <= 1300.0:
        raise UnusableError(
            f"{source}: {file.name}: initial_disc_temperature_k: expected 200 to 1300, got {temperature}"
        )
    return replace(log, direction=direction, disc_temperature_k=None if temperature is None else float(temperature))


def read_one(
    path: Path, database: Database | None = None, channel_map: ChannelMap | None = None,
    torque_constant_nm_a: float = 1.0,
) -> Log:  # fmt: skip
    """Read one log: a table by its suffix and header, else a CAN log."""
    columns = None if database is not None else _table_columns(path)
    if columns is not None:
        return from_columns(path.name, columns, channel_map)
    decoded = decode_log(read_log(path), database)
    if channel_map is not None:
        series = {name: decoded.series(name) for name in channel_map.sources() if name in decoded.columns}
        return _gridded(
            path.name, {target: channel_map.convert(target, series) for target in channel_map.targets(series)}
        )
    if database is not None:
        raise UnusableError(f"{path.name}: another car's DBC needs --map CHANNELS.toml, its signals by channel")
    return _brakebench_log(path.name, decoded, torque_constant_nm_a)


def _brakebench_log(name: str, decoded: DecodedLog, torque_constant_nm_a: float) -> Log:
    series = own_channels(decoded, torque_constant_nm_a)
    if not series:
        raise UnusableError(f"{name}: no signal of our own DBC in it; give --dbc and --map for another car's log")
    return _gridded(name, series)


def _gridded(name: str, series: Mapping[str, tuple[Floats, Floats]]) -> Log:
    """Signals with their own time stamps on one grid: linear interpolation, NaN over gaps of 0.25 s."""
    if not series:
        raise UnusableError(f"{name}: none of the mapped signals is in the log")
    begin = max(min(float(t[0]) for t, _ in series.values()), 0.0)
    end = max(float(t[-1]) for t, _ in series.values())
    grid = np.arange(begin, end, _GRID_S)
    columns = {}
    for channel, (t, v) in series.items():
        values = np.interp(grid, t, v, left=np.nan, right=np.nan)
        nearest = np.clip(np.searchsorted(t, grid), 1, len(t) - 1) if len(t) > 1 else np.zeros(len(grid), int)
        gap = t[nearest] - t[nearest - 1] if len(t) > 1 else np.full(len(grid), np.inf)
        values[gap > _HOLD_S] = np.nan
        columns[channel] = values
    return make_log(name, grid - begin, columns)


def from_columns(name: str, columns: Mapping[str, tuple[Floats, str]], channel_map: ChannelMap | None = None) -> Log:
    """A log from columns and their units; an empty unit is that of the canonical name."""
    time = next((key for key in ("t_s", "time_s", "time", "t", "timestamp") if key in columns), None)
    if channel_map is not None and channel_map.time is not None:
        time = channel_map.time if channel_map.time in columns else None
    if time is None:
        raise UnusableError(f"{name}: no column t_s; got {', '.join(list(columns)[:12])}")
    factor, _ = to_si(columns[time][1], f"{name}: {time}")
    t_s = columns[time][0] * factor
    if channel_map is not None:
        series = {key: (t_s, values) for key, (values, _) in columns.items()}
        mapped = {target: channel_map.convert(target, series)[1] for target in channel_map.targets(series)}
        return make_log(name, t_s - t_s[0], mapped)
    channels: dict[str, Floats] = {}
    for key, (values, unit) in columns.items():
        if key != time:
            scale, offset = to_si(unit, f"{name}: {key}") if key in CHANNELS else (1.0, 0.0)
            channels[key] = values * scale + offset
    return make_log(name, t_s - t_s[0], channels)


def from_frame(frame: Any, name: str = "dataframe") -> Log:
    """A log from a pandas or polars data frame, or any mapping of columns."""
    # iterating a polars frame gives its columns, not their names
    return from_columns(name, {str(key): (np.asarray(frame[key], np.float64), "") for key in frame.keys()})  # noqa: SIM118


def _table_columns(path: Path) -> dict[str, tuple[Floats, str]] | None:
    """Columns and their units; None where the file is a log of frames."""
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return None if path.exists() and log_format(path) is not None else _csv(path)
    if suffix == ".parquet":
        return _parquet(path)
    if suffix in (".mf4", ".mdf"):
        return _mdf(path)
    if suffix == ".mat":
        return _mat(path)
    return None


def _named(columns: Mapping[str, Floats]) -> dict[str, tuple[Floats, str]]:
    """Columns and their units, which stand in brackets after the name."""
    out = {}
    for key, values in columns.items():
        match = _WITH_UNIT.fullmatch(key)
        out[match[1] if match else key] = (values, match[2] if match else "")
    return out


def _csv(path: Path) -> dict[str, tuple[Floats, str]] | None:
    try:
        with path.open(encoding="utf-8-sig") as file:
            lines = file.readlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UnusableError(f"{path}: cannot be read: {error}") from error
    if not lines:
        raise UnusableError(f"{path}: empty file; expected a header and rows")
    at = 0
    while lines[at].startswith("#") and at + 1 < len(lines) and lines[at + 1].startswith("#"):
        at += 1
    header = [cell.strip().strip('"') for cell in lines[at].lstrip("# ").split(",")]
    rows = [line for line in lines[at + 1 :] if line.strip() and not line.startswith("#")]
    try:
        table = np.genfromtxt(rows, delimiter=",", dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise UnusableError(f"{path}: rows of different length: {str(error).splitlines()[0]}") from error
    if table.size == 0 or table.shape[1] != len(header):
        got = table.shape[1] if table.size else 0
        raise UnusableError(f"{path}: {len(header)} names in the header, {got} columns; expected as many")
    return _named({name: table[:, k] for k, name in enumerate(header)})


def _parquet(path: Path) -> dict[str, tuple[Floats, str]] | None:
    import pyarrow as pa
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise UnusableError(f"{path}: not a Parquet file: {str(error).splitlines()[0]}") from error
    if set(table.column_names) >= _FRAMES:
        return None
    columns: dict[str, tuple[Floats, str]] = {}
    for item in table.schema:
        if pa.types.is_floating(item.type) or pa.types.is_integer(item.type):
            unit = (item.metadata or {}).get(b"unit", b"").decode()
            values = np.asarray(table[item.name].to_numpy(zero_copy_only=False), np.float64)
            columns |= {key: (v, unit or u) for key, (v, u) in _named({item.name: values}).items()}
    return columns


def _mdf(path: Path) -> dict[str, tuple[Floats, str]] | None:
    try:
        import asammdf
    except ImportError as error:
        raise UnusableError(f"{path}: MF4 needs asammdf; install it with: pip install 'brakebench[mdf]'") from error
    try:
        with asammdf.MDF(path) as mdf:
            if any("CAN_DataFrame" in {c.name for c in group.channels} for group in mdf.groups):
                return None
            signals = [
                s for s in mdf.iter_channels(skip_master=True) if s.samples.ndim == 1 and s.samples.dtype.kind in "fiu"
            ]
    except Exception as error:  # asammdf raises many kinds on a damaged block
        raise UnusableError(f"{path}: asammdf cannot read it: {error}") from error
    if not signals:
        raise UnusableError(f"{path}: no numeric signal in it")
    longest = max(signals, key=lambda s: len(s.timestamps)).timestamps
    columns = {s.name: (np.interp(longest, s.timestamps, s.samples.astype(np.float64)), s.unit) for s in signals}
    return {"t_s": (np.asarray(longest, np.float64), ""), **columns}


def _mat(path: Path) -> dict[str, tuple[Floats, str]]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=True)
    except Exception as error:  # scipy raises many kinds, NotImplementedError for version 7.3
        raise UnusableError(f"{path}: scipy cannot read it (version 7.3? save with -v7): {error}") from error
    vectors = {k: np.asarray(v, np.float64) for k, v in content.items() if not k.startswith("__") and _numeric(v)}
    return _named(vectors)


def _numeric(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub" and value.size > 1
