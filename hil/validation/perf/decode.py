"""Reading and decoding logs, beside python-can with cantools, asammdf, hilspy and mdfr: frames of a blended stop."""

import sys
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import can
import numpy as np

from dbc.contract import database_text
from dbc.database import Database, parse_database
from dbc.frame import BusName
from hil.bench.virtual import simulate
from hil.extras import pip_install
from hil.log.builder import ROWS
from hil.log.frames import FrameTable
from hil.log.read import open_log
from hil.log.signals.decode import Decoder
from hil.log.write import write_log
from hil.rt.clock import cpu_time_ns
from hil.rt.process import output_of
from hil.scenario.scenario import load_scenario
from hil.validation.perf.cantools_codec import database
from hil.validation.perf.row import Progress, Row, paired, unseen

FRAMES = 1_000_000  # of our files
FEW = 50_000  # of the files that Python reads frame by frame
PEER_TIMEOUT_S = 60.0
UNIT = "Mframe/s"
_STEPS = 8  # of the whole, about equally long
PYTHON_CAN = "python-can + cantools"


def measure(progress: Progress = unseen) -> list[Row]:
    """Million frames a second of processor time, from a file (or frames in memory) to all signals as columns."""
    frames = many_frames(FRAMES)
    rows = [_frames_to_signals(frames)]
    with tempfile.TemporaryDirectory() as folder:
        files = Files(Path(folder), frames)
        for n, suffix in enumerate((".log", ".asc", ".blf", ".trc"), 1):
            progress(n / _STEPS)
            rows.append(_file_to_signals(files, suffix))
        for n, more in enumerate((_csv_to_signals, _mf4, _blf_raw), 5):
            progress(n / _STEPS)
            rows += more(files)
    return rows


def many_frames(n: int) -> FrameTable:
    """Frames of the vehicle bus of one blended stop, over and over, with stamps that go on."""
    stop = simulate(load_scenario("stop72_blend70")).decoded.recording.frames
    stop = stop.take(stop.channel == stop.channels.index(BusName.VEHICLE.value))
    rows = np.arange(n) % len(stop)
    table = stop.take(rows)
    span_ns = int(stop.time_ns[-1] - stop.time_ns[0]) + 1_000_000
    time_ns = 1_700_000_000 * 10**9 + table.time_ns // 1000 * 1000 + np.arange(n) // len(stop) * span_ns
    channel = np.zeros(n, np.int32)
    return FrameTable(
        ("can0",), time_ns, channel, table.can_id, table.extended, table.length, table.data, table.flags
    )  # fmt: skip


class Files:
    """The frames as files, by format: all of them for us, few for those who take them one by one."""

    def __init__(self, folder: Path, frames: FrameTable) -> None:
        self.folder, self.frames, self.few = folder, frames, frames.take(slice(0, FEW))

    def many(self, suffix: str) -> Path:
        """All frames."""
        return self._written(f"many{suffix}", self.frames)

    def little(self, suffix: str) -> Path:
        """The first `FEW`."""
        return self._written(f"few{suffix}", self.few)

    def _written(self, name: str, frames: FrameTable) -> Path:
        path = self.folder / name
        if not path.exists():
            write_log(frames, path)
        return path


def _rate(work: Callable[[], int]) -> Callable[[], float]:
    """Million frames a second of processor time of ``work``, which returns how many it did."""

    def once() -> float:
        begin_ns = cpu_time_ns()
        n = work()
        return n / (cpu_time_ns() - begin_ns) * 1e3

    return once


def _compared(name: str, ours: Callable[[], int], other: Callable[[], int], other_is: str, pairs: int = 5) -> Row:
    ours()  # compiled passes are loaded
    return paired(name, _rate(ours), _rate(other), other_is, UNIT, pairs=pairs, larger_is_better=True)


@cache
def _database() -> Database:
    return parse_database(database_text(BusName.VEHICLE))


def _signals(path: Path) -> int:
    decoder = Decoder(_database())
    with open_log(path) as log:
        return sum(piece.frames for piece in decoder.stream(log.tables()))


def _table_signals(tables: list[FrameTable]) -> int:
    return sum(piece.frames for piece in Decoder(_database()).stream(tables))


def _frames_to_signals(frames: FrameTable) -> Row:
    loaded = database(BusName.VEHICLE)
    few = [(int(frames.can_id[i]), frames.data[i, : frames.length[i]].tobytes()) for i in range(FEW)]

    def theirs() -> int:
        return sum(bool(loaded.decode_message(i, data, decode_choices=False)) for i, data in few)

    tables = [frames.take(slice(begin, begin + ROWS)) for begin in range(0, len(frames), ROWS)]  # as readers give them
    return _compared("frames to signals", partial(_table_signals, tables), theirs, "cantools")


def _python_can_signals(reader: Callable[[Path], Any], path: Path) -> int:
    loaded, n = database(BusName.VEHICLE), 0
    columns: dict[tuple[int, str], list[Any]] = {}
    with reader(path) as messages:
        for message in messages:
            n += 1
            values: Any = loaded.decode_message(message.arbitration_id, message.data, decode_choices=False)
            for name, value in values.items():
                columns.setdefault((message.arbitration_id, name), []).append(value)
    return n


READERS: dict[str, Callable[[Path], Any]] = {
    ".log": can.CanutilsLogReader,
    ".asc": can.ASCReader,
    ".blf": can.BLFReader,
    ".trc": can.TRCReader,
}


def _file_to_signals(files: Files, suffix: str) -> Row:
    theirs = partial(_python_can_signals, READERS[suffix], files.little(suffix))
    return _compared(f"{suffix[1:]} to signals", partial(_signals, files.many(suffix)), theirs, PYTHON_CAN)


def _csv_to_signals(files: Files) -> list[Row]:
    """python-can's CSV, the same file for both; ours beside it, which has more to say of a frame."""
    few, many = files.folder / "few_python_can.csv", files.folder / "many_python_can.csv"
    frames = files.few
    with can.CSVWriter(few) as writer:
        for i in range(len(frames)):
            writer.on_message_received(
                can.Message(
                    timestamp=float(frames.time_ns[i]) / 1e9,
                    arbitration_id=int(frames.can_id[i]),
                    is_extended_id=False,
                    data=frames.data[i, : frames.length[i]].tobytes(),
                )
            )
    head, _, rows = few.read_bytes().partition(b"\n")
    many.write_bytes(head + b"\n" + rows * max(1, FRAMES // len(frames)))
    theirs = partial(_python_can_signals, can.CSVReader, few)
    return [
        _compared("python-can's csv to signals", partial(_signals, many), theirs, PYTHON_CAN),
        _compared("our csv to signals", partial(_signals, files.many(".csv")), theirs, f"{PYTHON_CAN}, its csv"),
    ]


def _mf4(files: Files) -> list[Row]:
    path = files.many(".mf4")
    rows = []
    try:
        import asammdf
    except ImportError:
        print(f"asammdf is not installed ({pip_install('mdf')}): its row is left out", file=sys.stderr)
    else:
        dbc = files.folder / "vehicle.dbc"
        dbc.write_text(database_text(BusName.VEHICLE), encoding="utf-8")

        def theirs() -> int:
            with asammdf.MDF(path) as mdf, mdf.extract_bus_logging({"CAN": [(str(dbc), 0)]}):
                return FRAMES

        rows.append(_compared("mf4 to signals", partial(_signals, path), theirs, "asammdf extract_bus_logging"))
    if _mdfr_s(path) is None:
        print("mdfr is not installed (pip install mdfr): its row is left out", file=sys.stderr)
        return rows
    ours = _rate(partial(_frames, path))
    ours()
    other = partial(_mdfr_rate, path)
    rows.append(paired("mf4 to frames", ours, other, "mdfr, own process", UNIT, larger_is_better=True))
    return rows


def _frames(path: Path) -> int:
    with open_log(path) as log:
        return sum(len(table) for table in log.tables())


MDFR = """
import sys, time, mdfr
begin = time.process_time()
file = mdfr.Mdfr(sys.argv[1])
file.load_all_channels_data_in_memory()
assert len(file.get_channel_data("CAN_DataFrame.ID"))
print(time.process_time() - begin)
"""
"""Run in a process of its own: its licence (GPL-3) is not ours, and nothing of ours is linked with it."""


def _mdfr_s(path: Path) -> float | None:
    """Processor time (s) in which mdfr loads all channels; None where it is not installed or fails."""
    printed = output_of([sys.executable, "-c", MDFR, str(path)], PEER_TIMEOUT_S)
    return None if printed is None else float(printed)


def _mdfr_rate(path: Path) -> float:
    seconds = _mdfr_s(path)
    return float("nan") if seconds is None else FRAMES / seconds * 1e-6


def _blf_raw(files: Files) -> list[Row]:
    path = files.many(".blf")
    ours = partial(_frames, path)
    rows = [_compared("blf to frames", ours, partial(_inflated, path), "bare inflate of its containers")]
    try:
        import hilspy
    except ImportError:
        print("hilspy is not installed (pip install hilspy): its row is left out", file=sys.stderr)
        return rows

    def theirs() -> int:
        with hilspy.open(f"file://{path}", "raw") as messages:
            return sum(1 for _ in messages)

    return [*rows, _compared("blf to frames, raw", ours, theirs, "hilspy, raw codec")]


def _inflate() -> Callable[[bytes], bytes]:
    try:
        from isal.isal_zlib import decompress
    except ImportError:
        from zlib import decompress
    return decompress


def _inflated(path: Path) -> int:
    """The limit: what any reader of this file has to do first."""
    content = path.read_bytes()
    position, unpacked = 144, 0
    inflate = _inflate()
    while position + 32 <= len(content):
        size = int.from_bytes(content[position + 8 : position + 12], "little")
        unpacked += len(inflate(content[position + 32 : position + size]))
        position += size + size % 4
    return FRAMES if unpacked else 0
