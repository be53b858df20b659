"""Vector's text format (ASC): read line by line, every line of a frame accounted for; written."""

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from hil.log.frames import FD_CODES, FrameBuilder, FrameFlag, FrameTable, Recording

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
GERMAN = {"Mär": "Mar", "Mai": "May", "Okt": "Oct", "Dez": "Dec"}

_DATE = re.compile(r"(?:date|begin triggerblock)\s+(.+)", re.IGNORECASE)
_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_EVENT = re.compile(r"(\d{1,10}(?:\.\d{1,9})?)\s+(?:(CANFD)\s+)?(\d{1,4})\s+(.*)", re.IGNORECASE)
_ERROR = re.compile(r"(?:(?:Rx|Tx)\s+)?ErrorFrame\b", re.IGNORECASE)
_CLASSICAL = re.compile(
    r"(?P<id>[0-9A-F]{1,10})(?P<x>x?)\s+(?:Rx|Tx|TxRq)\s+(?P<kind>[dr])(?:\s+(?P<dlc>[0-9A-F]{1,2})\b)?(?P<rest>.*)",
    re.IGNORECASE,
)
_FD = re.compile(
    r"(?:Rx|Tx|TxRq)\s+(?P<id>[0-9A-F]{1,10})(?P<x>x?)\s+(?:\S+\s+)??(?P<brs>[01])\s+(?P<esi>[01])\s+"
    r"(?P<dlc>[0-9A-F])\s+(?P<length>\d{1,2})(?P<rest>.*)",
    re.IGNORECASE,
)
# An event of a channel that is no frame: "1  Statistic: ...", "1  CAN 1 Status:chip status error active".
_NO_FRAME = re.compile(r"(?:Statistic|CAN\b|Start\b|J1939TP|SV:|Log\b|Status|\w+\s*:)", re.IGNORECASE)


def read_asc(path: Path) -> Recording:
    """Read an ASC log; comments and events that are no frames are passed over, unreadable frames rejected."""
    builder = FrameBuilder()
    base, relative, start_ns, last_ns = 16, False, 0, 0
    truncated_at: int | None = None
    offset = 0
    with path.open("rb") as file:
        for raw in file:
            line = raw.decode("cp1252", "replace").strip()
            begin, offset = offset, offset + len(raw)
            if match := _EVENT.fullmatch(line):
                stamp_ns = _ns(match[1]) + (last_ns if relative else 0)
                last_ns = stamp_ns
                if not raw.endswith(b"\n"):
                    truncated_at = begin
                rest = match[4]
                if not _frame(builder, start_ns + stamp_ns, match, base) and not _NO_FRAME.match(rest):
                    builder.reject(begin, line)
            elif match := _BASE.match(line):
                base = 10 if match[1].lower() == "dec" else 16
                relative = (match[2] or "").lower() == "relative"
            elif match := _DATE.match(line):
                start_ns = _start_ns(match[1])
            elif line and not raw.endswith(b"\n") and not line.lower().startswith("end trigger"):
                truncated_at = begin
    return builder.recording(path, "asc", truncated_at)


def _ns(seconds: str) -> int:
    whole, _, fraction = seconds.partition(".")
    return int(whole) * 10**9 + int(fraction.ljust(9, "0"))


def _start_ns(text: str) -> int:
    """Start of the log: weekday, month, day, local time of day (perhaps am or pm), year; 0 where it is unreadable."""
    for german, english in GERMAN.items():
        text = text.replace(german, english)
    words = text.split()[1:]
    if not words or words[0] not in MONTHS:
        return 0
    words[0] = str(MONTHS.index(words[0]) + 1)
    for form in ("%m %d %H:%M:%S.%f %Y", "%m %d %H:%M:%S %Y", "%m %d %I:%M:%S.%f %p %Y", "%m %d %I:%M:%S %p %Y"):
        try:
            start = datetime.strptime(" ".join(words), form).astimezone()
        except (ValueError, OverflowError):
            continue
        return round((start - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1000) * 10**6
    return 0


def _frame(builder: FrameBuilder, time_ns: int, event: re.Match[str], base: int) -> bool:
    channel, text = f"can{max(int(event[3]), 1) - 1}", event[4]
    if _ERROR.match(text):
        return builder.add(time_ns, channel, 0, False, b"", FrameFlag.ERROR, 0)
    match = (_FD if event[2] else _CLASSICAL).fullmatch(text)
    if match is None:
        return False
    flags = FrameFlag(0)
    try:
        can_id = int(match["id"], base)
        words = match["rest"].split()
        if event[2]:
            length = int(match["length"])
            behind = words[length:]  # duration, bits on the bus, flags: bit 12 tells an FD frame from a classical one
            if len(behind) < 3 or int(behind[2], 16) & 0x1000:
                flags = FrameFlag.FD
                flags |= FrameFlag.BIT_RATE_SWITCH if match["brs"] == "1" else FrameFlag(0)
                flags |= FrameFlag.ERROR_STATE if match["esi"] == "1" else FrameFlag(0)
        else:
            length = min(int(match["dlc"] or "0", base), 8)
            flags = FrameFlag.REMOTE if match["kind"] in "rR" else FrameFlag(0)
        data = b"" if flags & FrameFlag.REMOTE else bytes(int(byte, base) for byte in words[:length])
    except ValueError:
        return False
    if len(data) != length and not flags & FrameFlag.REMOTE:
        return False
    return builder.add(time_ns, channel, can_id, bool(match["x"]), data, flags, length)


def asc_lines(frames: FrameTable, numbers: list[int]) -> Iterator[str]:
    """Yield the lines of an ASC log: start to the millisecond, stamps to the microsecond, from channel ``numbers``.

    ASC keeps neither class nor data of an error frame.
    """
    first_ns = int(frames.time_ns.min()) // 10**6 * 10**6 if len(frames) else 0
    start = datetime.fromtimestamp(first_ns // 10**9, UTC).astimezone()
    milli = first_ns // 10**6 % 1000
    date = f"{DAYS[start.weekday()]} {MONTHS[start.month - 1]} {start:%d %H:%M:%S}.{milli:03d} {start:%Y}"
    yield f"date {date}\nbase hex  timestamps absolute\ninternal events logged\nBegin Triggerblock {date}\n"
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.length, frames.flags)
    for row, (time_ns, channel, can_id, extended, length, flags) in enumerate(
        zip(*(c.tolist() for c in columns), strict=True)
    ):
        stamp = f"{(time_ns - first_ns + 500) // 1000 / 1e6:11.6f}"
        number = numbers[channel] + 1
        name = f"{can_id:X}{'x' if extended else ''}"
        data = frames.data[row, :length].tobytes().hex(" ").upper()
        if flags & FrameFlag.ERROR:
            yield f"{stamp} {number}  ErrorFrame\n"
        elif flags & FrameFlag.REMOTE:
            yield f"{stamp} {number}  {name:<15} Rx   r {length:x}\n"
        elif flags & FrameFlag.FD:
            brs, esi = int(bool(flags & FrameFlag.BIT_RATE_SWITCH)), int(bool(flags & FrameFlag.ERROR_STATE))
            bits = 1 << 12 | brs << 13 | esi << 14
            code = FD_CODES.index(length)
            yield (
                f"{stamp} CANFD {number:>3} Rx   {name:>8}  {'':>32} {brs} {esi} {code:x} {length:>2} {data} "
                f"{0:>8} {0:>4} {bits:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"
            )
        else:
            yield f"{stamp} {number}  {name:<15} Rx   d {length:x} {data}\n"
    yield "End TriggerBlock\n"
