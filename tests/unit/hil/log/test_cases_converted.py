"""Logs from one tool to another by way of every format that can be written: what stays, and what is said to go."""

import json
import re

import can
import pytest
from frame_lines import lines_of
from log_cases import CASES, CROSSED, LOGS, SEPTEMBER

from hil.cli.main import main
from hil.log.formats import WRITABLE
from hil.log.read import open_log
from hil.log.source import ReadOptions

CONVERTED = CROSSED | {name: CASES[name] for name in ("fd.asc", "long.asc", "errkinds.blf", "view.log", "fd.mf4")}
SUFFIXES = [".log", ".asc", ".blf", ".trc", ".mf4", ".csv", ".pcapng", ".parquet"]
NO_START = {".log": "candump", ".csv": "csv", ".pcapng": "pcapng"}
NO_ERROR_CONTENT = {".asc": "asc", ".trc": "trc"}
NINE_DIGITS = "nine digits of a second: can-utils before 2025-09 and tshark 4.0 do not read those"


def test_every_format_is_meant():
    assert set(SUFFIXES) == {suffix for suffix, form in WRITABLE.items() if suffix == form.suffixes[0]}


def stamp(line):
    seconds, rest = line.split(" ")[0].split(".")
    return int(seconds) * 10**9 + int(rest)


def to_the_microsecond(line):
    seconds, rest = divmod((stamp(line) + 500) // 1000, 10**6)
    return f"{seconds}.{rest:06d}000 " + line.split(" ", 1)[1]


def held(lines, suffix):
    """The frames as a format holds them."""
    if suffix == ".trc":
        lines = [to_the_microsecond(line) for line in lines]
    if suffix in NO_ERROR_CONTENT:
        lines = [re.sub(r" error \S+#\S*", " error 000#", line) for line in lines]
    return lines


def losses(case, suffix):
    """What must be said of a conversion."""
    errors = sum(" error " in line for line in case.frames)
    fine = any(stamp(line) % 1000 for line in case.frames)
    if suffix in NO_START and case.start_ns not in (None, stamp(case.frames[0])):
        yield f"{NO_START[suffix]} keeps no start time beside the stamps"
    if suffix in NO_ERROR_CONTENT and errors:
        frames = "the error frame" if errors == 1 else f"the {errors} error frames"
        yield f"{NO_ERROR_CONTENT[suffix]} keeps neither class nor data of {frames}"
    if suffix == ".trc" and fine:
        yield "trc keeps stamps to the microsecond"
    if suffix == ".log" and fine:
        yield NINE_DIGITS


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", CONVERTED)
def test_conversions_keep_what_a_format_holds_and_say_the_rest(tmp_path, capsys, name, suffix):
    case, target = CONVERTED[name], tmp_path / f"a{suffix}"
    assert main(["convert", str(LOGS / name), str(target), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["frames_read"], said["frames_written"], said["rejected"]) == (len(case.frames), len(case.frames), 0)
    assert sorted(said["notes"]) == sorted([*losses(case, suffix), *case.notes])
    assert said["passed_over"] == case.passed
    for fast in (False, True):
        with open_log(target, options=ReadOptions(fast=fast)) as log:
            back = log.recording()
        assert lines_of(back.frames) == held(case.frames, suffix)
        assert (back.rejected, back.truncated_at) == (0, None)
        if case.start_ns is not None:
            assert back.start_ns == (None if suffix in NO_START else case.start_ns)


def converted(tmp_path, name, suffix):
    target = tmp_path / f"{name}{suffix}"
    assert main(["convert", str(LOGS / name), str(target)]) == 0
    return target


def words_of(path, begin):
    """Words of the lines of frames, from the first one of which the line is a frame on."""
    return [line.split() for line in path.read_text().splitlines() if re.match(begin, line)]


def test_types_of_can_fd_frames_in_trc(tmp_path):
    """FE is the error state alone, BI both; python-can 4.6.1 has them exchanged, so it cannot tell."""
    lines = words_of(converted(tmp_path, "fd-types.trc", ".trc"), r" +\d")
    assert [line[2] for line in lines] == ["FD", "FB", "FE", "BI"]


def test_direction_in_text(tmp_path):
    assert [line[3] for line in words_of(converted(tmp_path, "rx-tx.log", ".asc"), r".* d 1 ")] == ["Rx", "Tx"]
    assert [line[5] for line in words_of(converted(tmp_path, "rx-tx.log", ".trc"), r" +\d")] == ["Rx", "Tx"]
    assert [line[3:] for line in words_of(converted(tmp_path, "rx-tx.log", ".log"), r"\(")] == [["R"], ["T"]]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".mf4"])
def test_direction_as_python_can_sees_it(tmp_path, suffix):
    with can.LogReader(converted(tmp_path, "rx-tx.log", suffix)) as reader:
        assert [(one.arbitration_id, one.is_rx) for one in reader] == [(0x123, True), (0x124, False)]


def test_nanoseconds_in_candump(tmp_path):
    text = converted(tmp_path, "nanoseconds.blf", ".log").read_text()
    assert text.splitlines()[0] == "(1727172930.500456789) can0 123#0000"
    assert converted(tmp_path, "rx-tx.log", ".log").read_text().splitlines()[0] == "(1727172930.000000) can0 123#01 R"


def test_frames_before_the_start(tmp_path):
    """The start stays what it is, and the stamps stay before it."""
    asc = words_of(converted(tmp_path, "pre-trigger.blf", ".asc"), r" *-?[\d.]+ +1 ")
    assert [line[0] for line in asc] == ["-2.000000", "-0.001000", "0.001000"]
    trc = words_of(converted(tmp_path, "pre-trigger.blf", ".trc"), r" +\d")
    assert [line[1] for line in trc] == ["-2000.000", "-1.000", "1.000"]
    with open_log(converted(tmp_path, "pre-trigger.blf", ".mf4")) as log:
        assert (log.frames().time_ns - SEPTEMBER).tolist() == [-(2 * 10**9), -(10**6), 10**6]


def test_one_channel_number_for_all(tmp_path):
    """Channel 1 of ASC, BLF and MF4 is one channel, and is channel 1 where it is written."""
    for name in ("channel-1.asc", "channel-1.blf", "channel-1.mf4"):
        assert converted(tmp_path, name, ".log").read_text().split()[1] == "can0"
        (asc,) = words_of(converted(tmp_path, name, ".asc"), r".* d \d ")
        (trc,) = words_of(converted(tmp_path, name, ".trc"), r" +\d")
        assert (asc[1], trc[3]) == ("1", "1")
