"""Options of the commands that read logs, and what they mean."""

import argparse
import glob
import os
from collections.abc import Iterable
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from dbc.database import Database
from hil.errors import BrakebenchError
from hil.log.account import printable
from hil.log.choice import Choice
from hil.log.foreign.database_files import read_database
from hil.log.samples import log_path
from hil.log.several import UNDATED_NS, Logs
from hil.log.signals.databases import Databases
from hil.log.source import STDIN
from hil.log.summary.summary import BitRates
from hil.log.wall_clock import wall_clock_of

LOGS = "a log (candump, ASC, BLF, TRC, MF4, CSV, pcap, Parquet; also packed with gzip); - is standard input"
ZONE = "zone of wall clocks that name none: an IANA name (Asia/Tokyo), UTC or local (default: UTC)"


def add_databases(parser: argparse.ArgumentParser) -> None:
    """``--dbc``, as often as needed."""
    parser.add_argument(
        "--dbc",
        metavar="[CHANNEL=]FILE",
        action="append",
        default=[],
        help="database (DBC, ARXML, KCD, SYM) of all channels, or of one; may be given several times. A channel with "
        "databases of its own uses no other",
    )


def add_timezone(parser: argparse.ArgumentParser) -> None:
    """``--timezone``."""
    parser.add_argument("--timezone", metavar="ZONE", type=zone, default=UTC, help=ZONE)


def add_force(parser: argparse.ArgumentParser, what: str = "the output") -> None:
    """``--force``."""
    parser.add_argument(
        "--force", action="store_true", help=f"replace {what} where it exists; never a file that is read"
    )


def zone(text: str) -> tzinfo:
    """Time zone of an option.

    Raises
    ------
    argparse.ArgumentTypeError
        For a name that is none.
    """
    if text.upper() == "UTC":
        return UTC
    if text == "local":
        return _local()
    try:
        return ZoneInfo(text)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no time zone; give an IANA name such as Europe/Berlin, UTC or local"
        ) from None


def _local() -> tzinfo:
    """Zone of this computer with its summer times, not just the offset of today."""
    name = os.environ.get("TZ", "").lstrip(":")
    if not name and Path("/etc/localtime").is_symlink():
        name = str(Path("/etc/localtime").resolve()).partition("zoneinfo/")[2]
    if name:
        try:
            return ZoneInfo(name)
        except (ZoneInfoNotFoundError, ValueError, OSError):
            pass
    offset = datetime.now(UTC).astimezone().tzinfo
    return UTC if offset is None else offset


def paths(words: list[str]) -> list[Path]:
    """Files of the arguments, each once; a pattern (``drive_*.blf``) stands for all files that match it.

    ``sample:NAME`` is a log that comes with brakebench.

    Raises
    ------
    BrakebenchError
        When a pattern matches none.
    """
    found: list[Path] = []
    for word in words:
        if word == STDIN or Path(word).exists() or not glob.has_magic(word):
            found.append(log_path(word))
            continue
        names = glob.glob(word, recursive=True)  # noqa: PTH207 (Path.glob takes no absolute pattern)
        matched = sorted(path for name in names if (path := Path(name)).is_file())
        if not matched:
            raise BrakebenchError(f"{word}: no file matches this pattern")
        found += matched
    distinct: dict[Path, Path] = {}
    for path in found:
        distinct.setdefault(path.resolve(), path)
    return list(distinct.values())


def databases(words: list[str]) -> tuple[Databases, list[Path]]:
    """Databases of ``--dbc``, our own without any, and the files they come from.

    Raises
    ------
    BrakebenchError
        When one cannot be read.
    """
    if not words:
        return Databases.own(), []
    general: list[Database] = []
    by_channel: dict[str, list[Database]] = {}
    files: list[Path] = []
    read: list[Database] = []
    for word in words:
        channel, path = _database(word)
        if path not in files:
            files.append(path)
            read.append(read_database(path))
        (by_channel.setdefault(channel, []) if channel else general).append(read[files.index(path)])
    return Databases.joined(general, by_channel), files


def _database(word: str) -> tuple[str, Path]:
    """Channel ("" for all) and file; of several ``=`` the first one behind which a file is called so parts them."""
    parts = word.split("=")
    if len(parts) == 1 or Path(word).exists():
        return "", Path(word)
    pairs = [("=".join(parts[:k]), Path("=".join(parts[k:]))) for k in range(1, len(parts))]
    return next((pair for pair in pairs if pair[1].is_file()), pairs[0])


def bit_rates(words: list[str]) -> dict[str, BitRates]:
    """Bit rates of ``--bitrate`` by channel; "" stands for all others.

    Raises
    ------
    BrakebenchError
        For what is no bit rate.
    """
    by_channel: dict[str, BitRates] = {}
    for word in words:
        channel, _, rates = word.rpartition("=")
        try:
            numbers = [int(part) for part in rates.split("/")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 2) or not all(1_000 <= number <= 20_000_000 for number in numbers):
            raise BrakebenchError(
                f"--bitrate {word}: expected bit/s as 500000, 500000/2000000 (with the data bit rate of CAN FD) or "
                "can0=500000"
            )
        by_channel[channel] = numbers[0], numbers[1] if len(numbers) == 2 else None
    return by_channel


def check_found(choice: Choice, frames: int, *logs: Logs) -> None:
    """Refuse a choice that leaves no frame of logs that have some, so that a slip of the pen is no empty result.

    Raises
    ------
    BrakebenchError
        It says what the logs have: channels, or the span of time.
    """
    held = [one for one in logs if any(part.frames for part in one.parts)]
    if frames or not choice.of_frames or not held:
        return
    name = " and ".join(str(one.parts[0].path) for one in held)
    known = dict.fromkeys(channel for one in held for channel in one.channels)
    if choice.channels and not set(choice.channels) & set(known):
        raise BrakebenchError(f"{name}: no channel {', '.join(choice.channels)}; {channels_of(known)}")
    last_s = max((one.last_ns - one.first_ns) / 1e9 for one in held)
    first_ns = held[0].first_ns
    when = f", which is stamped {wall_clock_of(first_ns, UTC)} UTC" if first_ns >= UNDATED_NS else ""
    on = f" on channel {', '.join(choice.channels)}" if choice.channels else ""
    raise BrakebenchError(
        f"{name}: no frame{on} between --from and --to; give times within 0 to {last_s:.3f} s from its first frame"
        f"{when}"
    )


def channels_of(names: Iterable[str]) -> str:
    """Channels that a log has, as messages name them."""
    return f"its channels are {', '.join(map(printable, names))}"


def unused(option: str, channels: Iterable[str], logs: Logs) -> list[str]:
    """Notes on channels that an option names and the log does not have."""
    missing = [name for name in channels if name not in logs.channels]
    if not missing or not logs.channels:
        return []
    return [f"{option}: the log has no channel {', '.join(map(printable, missing))}; {channels_of(logs.channels)}"]


def words_of(text: list[str]) -> tuple[str, ...]:
    """Words of an option that may be given several times and holds words parted by commas."""
    return tuple(word.strip() for part in text for word in part.split(",") if word.strip())
