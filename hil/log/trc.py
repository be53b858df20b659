"""PEAK's text format (TRC), versions 1.0 to 2.1: read line by line, every line accounted for; written as 2.1."""

import re
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path

from hil.log.frames import FD_CODES, FrameBuilder, FrameFlag, FrameTable, Recording

# Column letters as in the header of version 2: number, offset in ms, type, bus, id, direction, reserved, data length
# in bytes (l) or length code (L), data.
COLUMNS = {"1.0": "N,O,I,L,D", "1.1": "N,O,d,I,L,D", "1.2": "N,O,B,d,I,L,D", "1.3": "N,O,B,d,I,R,L,D"}
TYPES = {
    "DT": FrameFlag(0),
    "RR": FrameFlag.REMOTE,
    "FD": FrameFlag.FD,
    "FB": FrameFlag.FD | FrameFlag.BIT_RATE_SWITCH,
    "FE": FrameFlag.FD | FrameFlag.BIT_RATE_SWITCH | FrameFlag.ERROR_STATE,
    "BI": FrameFlag.FD | FrameFlag.ERROR_STATE,
}
NO_FRAME = frozenset({"ST", "EC", "ER", "EV", "Warng", "Error", "Event"})
EPOCH_DAY = 25569  # 1970-01-01, counted from 1899-12-30
_OFFSET = re.compile(r"\d{1,15}(?:\.\d{1,6})?")


def read_trc(path: Path) -> Recording:
    """Read a TRC log; status lines are passed over, unreadable frames rejected. The start time is taken as UTC."""
    builder = FrameBuilder()
    columns = COLUMNS["1.0"].split(",")
    start_ns = 0
    truncated_at: int | None = None
    offset = 0
    with path.open("rb") as file:
        for raw in file:
            line = raw.decode("cp1252", "replace").strip()
            begin, offset = offset, offset + len(raw)
            key, _, value = line.partition("=")
            if key == ";$FILEVERSION":
                columns = COLUMNS.get(value.strip(), COLUMNS["1.0"]).split(",")
            elif key == ";$STARTTIME":
                start_ns = _start_ns(value)
            elif key == ";$COLUMNS":
                columns = value.strip().split(",")
            elif line and not line.startswith(";"):
                if not raw.endswith(b"\n"):
                    truncated_at = begin
                cells = dict(zip(columns, line.split(maxsplit=len(columns) - 1), strict=False))
                if not NO_FRAME & {cells.get("T"), cells.get("d")} and not _frame(builder, start_ns, cells):
                    builder.reject(begin, line)
    return builder.recording(path, "trc", truncated_at)


def _start_ns(days: str) -> int:
    try:
        start_ns = round((Decimal(days.strip()) - EPOCH_DAY) * 86_400_000_000) * 1000
    except (InvalidOperation, ValueError, OverflowError):
        return 0
    return start_ns if 0 <= start_ns < 2**62 else 0


def _frame(builder: FrameBuilder, start_ns: int, cells: dict[str, str]) -> bool:
    flags = TYPES.get(cells.get("T", "DT"))
    if flags is None or not _OFFSET.fullmatch(cells.get("O", "")):
        return False
    data_text = cells.get("D", "")
    if data_text == "RTR":
        flags, data_text = FrameFlag.REMOTE, ""
    try:
        can_id = int(cells["I"], 16)
        bus = int(cells.get("B", "1"))
        length = int(cells["l"]) if "l" in cells else FD_CODES[int(cells["L"])]
        data = bytes.fromhex(data_text)
    except (KeyError, ValueError, IndexError):
        return False
    length = length if flags & FrameFlag.FD else min(length, 8)
    if len(data) != (0 if flags & FrameFlag.REMOTE else length):
        return False
    time_ns = start_ns + int(Decimal(cells["O"]) * 10**6)
    return builder.add(time_ns, f"can{max(bus, 1) - 1}", can_id, len(cells["I"]) > 4, data, flags, length)


def trc_lines(frames: FrameTable, numbers: list[int]) -> Iterator[str]:
    """Yield the lines of a TRC log, version 2.1, stamps to the microsecond, from channel ``numbers``.

    Error frames have no place in it; the caller leaves them out.
    """
    first_ns = int(frames.time_ns.min()) // 10**6 * 10**6 if len(frames) else 0
    days = Decimal(first_ns) / (86_400 * 10**9) + EPOCH_DAY
    yield f";$FILEVERSION=2.1\n;$STARTTIME={days:.15f}\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n;\n"
    yield ";   Number, offset in ms, type, bus, id (hex), direction, reserved, data length, data (hex)\n;\n"
    names = {int(flags): name for name, flags in TYPES.items()}
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.length, frames.flags)
    for row, (time_ns, channel, can_id, extended, length, flags) in enumerate(
        zip(*(c.tolist() for c in columns), strict=True)
    ):
        offset_ms = (time_ns - first_ns + 500) // 1000 / 1000
        name = f"{can_id:08X}" if extended else f"{can_id:04X}"
        data = "" if flags & FrameFlag.REMOTE else " " + frames.data[row, :length].tobytes().hex(" ").upper()
        place = f"{row + 1:>7} {offset_ms:13.3f} {names[flags]} {numbers[channel] + 1:>2} {name:>8}"
        yield f"{place} Rx -  {length:<4}{data}".rstrip() + "\n"
