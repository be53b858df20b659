"""Logs that readers have stumbled over, each with all that it holds; they lie in tests/data/logs."""

from pathlib import Path
from typing import NamedTuple

LOGS = Path(__file__).parents[1] / "data" / "logs"
COUNTED = bytes(range(64)).hex().upper()
EIGHT, PEDAL = COUNTED[:16], "1122334455667788"
ZONE = "start time taken as UTC (the log names no zone)"
SCREEN = "bit rate switch and error state of CAN FD frames are not in the log (candump -x shows them)"


class Case(NamedTuple):
    """What a log holds: its format, its frames as `frame_lines.lines_of` has them, and all that is said of it."""

    format: str
    frames: list[str]
    start_ns: int | None = None
    code: int = 0
    rejected: tuple[tuple[int, str], ...] = ()
    cut: int | None = None
    passed: dict[str, int] = {}  # noqa: RUF012 (never changed)
    notes: tuple[str, ...] = ()


def zoned(form, start_ns, frames, **more):
    """A case whose start time is a wall clock."""
    return Case(form, frames, start_ns, notes=(ZONE,), **more)


MAY, JANUARY, SEPTEMBER = 1746165600 * 10**9, 1736942400 * 10**9, 1727172930_500_000_000
NOON = 1727179200 * 10**9
LONG = 1746167048_927_000_000
COUNTING = [f"1700000000.{k:06d}000 can0 {k:03X}#{PEDAL}" for k in range(200)]
EVENT = {"event": 1}

CASES = {
    "fd.asc": zoned("asc", LONG, [f"1746167049.027000000 can3 4EE#{COUNTED} FD ESI"]),
    "long.asc": zoned(
        "asc",
        LONG,
        [f"1746167049.027000000 can0 123#{COUNTED[:24]} FD", f"1746167049.127000000 can0 123#{COUNTED} FD"],
    ),
    "errkinds.blf": zoned(
        "blf",
        MAY,
        [
            "1746165600.001000000 can0 123#1122",
            "1746165600.001500000 can0 error 000#",
            "1746165600.001600000 can0 error 000#0000000000000000",
            "1746165600.002000000 can0 123#1122",
        ],
        passed={"objects of type 3": 1},
    ),
    "dlc13.blf": zoned(
        "blf",
        MAY,
        [
            f"1746165600.001000000 can0 123#{EIGHT}",
            f"1746165600.002000000 can0 124#{EIGHT}",
            f"1746165600.003000000 can0 125#{EIGHT}",
        ],
    ),
    "dlc13only.blf": zoned("blf", MAY, [f"1746165600.002000000 can0 124#{EIGHT}"]),
    "view.log": Case(
        "candump_screen",
        [
            f"1700000000.000100000 can0 123#{PEDAL}",
            "1700000000.000200000 can0 error 004#0000000000000000",
            "1700000000.000300000 can0 18FEF100#0102",
            "1700000000.000400000 can0 124#0102030405060708090A0B0C FD",
            "1700000000.000500000 can0 125#R8",
        ],
        notes=(SCREEN,),
    ),
    "e.blf": zoned("blf", MAY, ["1746165600.001000000 can0 error 123#"]),
    "gvret.csv": Case("gvret", ["0.000973000 can0 13B#000008000000004C", "0.002009000 can1 18FEF100#010203"]),
    "gvret_old.csv": Case("gvret", ["166.064000000 can0 21A#FE3612FE690507AD"]),
    "log.log.gz": Case("candump", COUNTING),
    "log.asc.gz": zoned("asc", LONG, ["1746167049.927000000 can0 123#11"]),
    "j1939.log": Case(
        "candump",
        [
            "1.000000000 can0 0CF00400#F07D859B0FFFFF85",
            "1.100000000 can0 0CF00417#F07D85401FFFFF85",
            "1.200000000 can0 0CF004FE#F07D859B0FFFFF85",
        ],
    ),
    "tp.log": Case(
        "candump",
        [
            "1.000000000 can0 18ECFF00#20140003FFCAFE00",
            "1.050000000 can0 18EBFF00#0140010203040506",
            "1.100000000 can0 18EBFF00#020708090A0B0C0D",
            "1.150000000 can0 18EBFF00#030E0F1011121399",
        ],
    ),
    "fd.mf4": Case(
        "mf4",
        [f"1746165600.100000000 can0 123#{COUNTED} FD", f"1746165600.200000000 can0 123#{COUNTED[:24]} FD"],
        MAY,
    ),
    "self.csv": Case("csv", ["1.000000000 can0 123#1122334455667788"]),
    "can.pcap": Case("pcap", [f"{1700000000 + k}.{k:06d}000 can0 123#{EIGHT}" for k in range(300)]),
    "blf.asc": zoned("blf", JANUARY + 10**9, ["1736942401.000000000 can0 123#1122"]),  # told by what it holds
    "tz.asc": zoned("asc", JANUARY, ["1736942401.000000000 can0 123#1122"]),
    "tz.blf": zoned("blf", JANUARY + 10**9, ["1736942401.000000000 can0 123#1122"]),
    "tz.trc": zoned("trc", JANUARY, ["1736942401.000000000 can0 123#1122"]),
    "start.trc": Case(
        "trc",
        ["1.059900000 can0 300#11"],
        notes=("a start time in the header cannot be read: without another one, stamps count from 1970",),
    ),
    "cut.log": Case("candump", [*COUNTING[:-1], "1700000000.000199000 can0 0C7#11223344"], code=1, cut=9154),
    "cut.asc": zoned(
        "asc",
        LONG,
        [f"{1746167048 + k}.927000000 can0 123#{PEDAL}" for k in range(49)],
        code=1,
        cut=3287,
        rejected=((3287, "49.000000 1  123             Rx   d 8 11 22 33 44"),),
    ),
    "cut.trc": zoned(
        "trc",
        JANUARY,
        [f"1736942400.{k:03d}000000 can0 300#{PEDAL}" for k in range(49)],
        code=1,
        cut=2919,
        rejected=((2919, "49)  49.0  Rx         0300  8  11 22 33 44"),),
    ),
    "cut.csv": Case(
        "csv",
        [f"1.000000000 can0 001#{PEDAL}"],
        code=1,
        cut=78,
        rejected=((78, "1.1,can0,1,0,,8,112233"),),
    ),
    "cut.blf": zoned(
        "blf",
        MAY,
        [f"1746165600.001000000 can0 123#{EIGHT}"] * 355,
        code=1,
        cut=144,
        rejected=((144, "object of type 1, cut off: 4c 4f 42 4a 20 00 01 00 30 00 00 00 01 00 00 00 02 00"),),
    ),
    "esc.log": Case(
        "candump",
        ["1.000000000 can0 123#11"],
        code=1,
        rejected=((18, r"\x1b[31mRED\x1b]0;title\x07 line"),),
    ),
    "chan.log": Case("candump", [r"1.000000000 \x1b[2J\x1b[31mcan0 123#11"]),
    "whole.trc": zoned("trc", JANUARY, ["1736942401.059900000 can0 300#1122"]),
    "rtr.log": Case("candump", ["1.000000000 can0 123#R4"]),
}

CROSSED = {  # what one tool writes and another reads
    "fd-types.trc": zoned(
        "trc",
        NOON,
        [
            "1727179200.001000000 can0 100#0102 FD",
            "1727179200.002000000 can0 101#0102 FD BRS",
            "1727179200.003000000 can0 102#0102 FD ESI",
            "1727179200.004000000 can0 103#0102 FD BRS ESI",
        ],
    ),
    "canfd-remote.asc": zoned(
        "asc",
        SEPTEMBER,
        [
            "1727172930.600000000 can0 123#R5 sent",
            "1727172930.700000000 can0 18DAF110#R8",
            "1727172930.800000000 can0 124#",
        ],
        passed=EVENT,
    ),
    "error-frames.blf": zoned(
        "blf",
        SEPTEMBER,
        [
            "1727172930.500000010 can0 123#0102",
            "1727172930.500000020 can0 error 000#",
            "1727172930.500000030 can0 error 123#0000000000000000",
            "1727172930.500000040 can0 error 000#",
        ],
    ),
    "dlc-over-8.blf": zoned(
        "blf",
        SEPTEMBER,
        [
            f"1727172930.500000010 can0 123#{EIGHT}",
            f"1727172930.500000020 can0 123#{EIGHT}",
            "1727172930.500000030 can0 error 0FF#0000000000000000",
        ],
    ),
    "dlc-over-8.asc": zoned("asc", SEPTEMBER, [f"1727172930.600000000 can0 123#{EIGHT}"], passed=EVENT),
    "dlc-over-8.log": Case("candump", [f"1727172930.500000000 can0 123#{EIGHT}"]),
    "txrq.asc": zoned(
        "asc",
        SEPTEMBER,
        ["1727172930.600250000 can0 123#01 sent", "1727172930.700250000 can0 123#02 sent"],
        passed={"event": 1, "TxRq": 2},
    ),
    "nanoseconds.blf": zoned(
        "blf",
        SEPTEMBER,
        [
            "1727172930.500456789 can0 123#0000",
            "1727172930.510457110 can0 123#0100",
            "1727172930.520457431 can0 123#0200",
            "1727172930.530457752 can0 123#0300",
        ],
    ),
    "rx-tx.log": Case("candump", ["1727172930.000000000 can0 123#01", "1727172930.001000000 can0 124#02 sent"]),
    "wall-clock.asc": zoned("asc", SEPTEMBER, ["1727172930.600000000 can0 123#01"], passed=EVENT),
    "wall-clock.blf": zoned("blf", SEPTEMBER, ["1727172930.600000000 can0 123#01"]),
    "pre-trigger.blf": zoned(
        "blf",
        SEPTEMBER,
        [
            "1727172928.500000000 can0 123#0102",
            "1727172930.499000000 can0 123#0102",
            "1727172930.501000000 can0 123#0102",
        ],
    ),
    "fd.log": Case(
        "candump",
        ["1727172930.000000000 can0 100#111111111111111111111111 FD BRS", "1727172930.001000000 can0 101#01"],
    ),
    "channel-1.asc": zoned("asc", SEPTEMBER, ["1727172930.600000000 can0 123#01"], passed=EVENT),
    "channel-1.blf": zoned("blf", SEPTEMBER, ["1727172930.500000010 can0 123#0102"]),
    "channel-1.mf4": Case("mf4", ["1727172930.000000010 can0 123#0102"], 1727172930 * 10**9),
    "error-frame.trc": zoned(
        "trc",
        NOON,
        ["1727179200.001000000 can0 100#01", "1727179200.002000000 can0 error 000#"],
        passed={"hardware status": 1},
    ),
    "version-1.0.trc": zoned(
        "trc",
        1031760020_682_000_000,
        ["1031760022.523000000 can0 001#0102", "1031760022.526000000 can0 100#R3"],
        passed={"error": 1, "hardware status": 1},
    ),
    "screen.log": Case(
        "candump_screen", ["1727172930.000000000 can0 123#0102", "1727172930.010000000 can0 18DAF110#03"]
    ),
    "savvycan.csv": Case("gvret", ["1.000000000 can0 123#0102", "1.010000000 can1 18DAF110#03 sent"]),
}
