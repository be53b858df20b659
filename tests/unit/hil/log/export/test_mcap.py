import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from dbc.database import parse_database
from hil.cli.main import main
from hil.log.export.blocks import block_of, layout_of
from hil.log.export.mcap_file import McapMessages, identifier, messages_in, write_mcap
from hil.log.export.protobuf import number_of, varint
from hil.log.frames import LogError
from hil.log.read import read_log
from hil.log.samples import log_path
from hil.log.signals.decode import decode_log

DBC = """VERSION ""
BU_: A
BO_ 1 M: 2 A
 SG_ S : 0|8@1+ (0.5,0) [0|0] "km/h" A
 SG_ T : 8|8@1+ (1,0) [0|0] "" A
 SG_ T_name : 8|4@1+ (1,0) [0|0] "" A
BO_ 2 N: 2 A
 SG_ MUX M : 0|8@1+ (1,0) [0|0] "" A
 SG_ AB m1 : 8|8@1- (1,0) [0|0] "bar, gauge" A
 SG_ A_B m2 : 8|8@1+ (1,0) [0|0] "" A
VAL_ 1 T 0 "off" 1 "on" 255 "SNA" ;
"""
LOG = (
    "(1.000001000) can0 001#0401\n(1.5) can1 001#0600\n(1.6) can0 7FF#00\n(2.0) can0 002#01FF\n(2.1) can0 002#0209\n"
    "(2.5) can0 001#08FF\n"
)


def decoded_messages(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [(c, m.log_time, p) for _, c, m, p in reader.iter_decoded_messages()]


@pytest.fixture
def small(tmp_path):
    """Messages of a small log, as the official reader of Protocol Buffers sees them."""
    path = tmp_path / "a.log"
    path.write_text(LOG)
    log = decode_log(read_log(path), parse_database(DBC))
    written = tmp_path / "a.mcap"
    assert write_mcap([block_of(log)], layout_of(log), written) == 5
    return decoded_messages(written)


def test_each_frame_is_a_message_of_its_channels_topic_at_its_stamp(small):
    assert [(channel.topic, time_ns) for channel, time_ns, _ in small] == [
        ("/can0/M", 1_000_001_000),
        ("/can1/M", 1_500_000_000),
        ("/can0/N", 2_000_000_000),
        ("/can0/N", 2_100_000_000),
        ("/can0/M", 2_500_000_000),
    ]


def test_values_are_physical_and_what_a_frame_does_not_have_is_nan(small):
    first, second, third, fourth, last = (message for _, _, message in small)
    assert (first.S, first.T, first.T_name_2) == (2.0, 1.0, "on")
    assert (second.S, second.T, second.T_name_2) == (3.0, 0.0, "off")
    assert math.isnan(last.T)
    assert not last.HasField("T_name_2")
    assert (third.AB, fourth.A_B) == (-1.0, 9.0)
    assert math.isnan(third.A_B)
    assert math.isnan(fourth.AB)


def test_a_topic_states_units_and_names(small):
    of = {channel.topic: channel.metadata for channel, _, _ in small}
    assert of["/can0/N"]["unit.AB"] == "bar, gauge"
    assert of["/can0/M"]["unit.S"] == "km/h"
    assert json.loads(of["/can0/M"]["values.T"])["1"] == "on"


@pytest.mark.slow
def test_a_whole_recording_reads_back_as_it_is_decoded(tmp_path):
    log, out = log_path("sample:weak_brake"), tmp_path / "a.mcap"
    assert main(["convert", str(log), str(out)]) == 0
    expected = decode_log(read_log(log))
    found = {}
    for channel, time_ns, message in decoded_messages(out):
        found.setdefault(channel.topic.split("/")[-1], []).append((time_ns, message))
    assert {name: len(rows) for name, rows in found.items()} == {n: m.count for n, m in expected.messages.items()}
    for name, column in expected.columns.items():
        message, signal = name.split(".")
        rows = expected.rows[message]
        dense = np.full(len(rows), np.nan)
        dense[np.searchsorted(rows, column.rows)] = column.values
        np.testing.assert_array_equal([getattr(one, signal) for _, one in found[message]], dense)
        np.testing.assert_array_equal([t for t, _ in found[message]], expected.recording.frames.time_ns[rows])


def test_rerun_reads_it(tmp_path):
    rerun = pytest.importorskip(
        "rerun.chunk", reason="rerun-sdk takes 490 MB and is in an extra of its own: pip install --editable '.[rerun]'"
    )
    log, out = tmp_path / "a.log", tmp_path / "a.mcap"
    log.write_text(LOG)
    decoded = decode_log(read_log(log), parse_database(DBC))
    write_mcap([block_of(decoded)], layout_of(decoded), out)
    values = {}
    for chunk in rerun.McapReader(str(out)).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            values.setdefault(str(chunk.entity_path), {}).setdefault(name, []).extend(batch.column(name).to_pylist())
    (held,) = (v for n, v in values["/can0/M"].items() if n == "can.M:message")
    rows = [row[0] for row in held if row]
    assert [row["S"] for row in rows] == [2.0, 4.0]
    assert rows[0]["T_name_2"] == "on"
    assert math.isnan(rows[1]["T"])


@pytest.mark.slow
def test_memory_does_not_grow_with_the_log(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("".join(f"({1 + i * 1e-4:.6f}) can0 001#{i % 200:02X}01\n" for i in range(5_000)))
    decoded = decode_log(read_log(log), parse_database(DBC))
    layout, peaks = layout_of(decoded), []
    for times in (5, 15):
        tracemalloc.start()
        write_mcap((block_of(decoded) for _ in range(times)), layout, tmp_path / f"{times}.mcap")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_a_log_of_another_car_is_refused(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("(1.0) can0 7FF#00\n")
    assert main(["convert", str(log), str(tmp_path / "a.mcap")]) == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.log"]


def test_frames_of_no_message_are_told(tmp_path, capsys):
    log, dbc = tmp_path / "a.log", tmp_path / "a.dbc"
    log.write_text(LOG)
    dbc.write_text(DBC)
    assert main(["convert", str(log), str(tmp_path / "a.mcap"), "--dbc", str(dbc), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["frames_written"] == 5
    assert told["frames_read"] == 6
    assert any("1 frames of no message" in note for note in told["notes"])
    assert messages_in(tmp_path / "a.mcap") == {"/can0/M": 2, "/can1/M": 1, "/can0/N": 2}


def test_a_database_is_for_signals_alone(tmp_path, capsys):
    assert main(["convert", "a.log", str(tmp_path / "a.blf"), "--dbc", "a.dbc"]) == 2
    assert "only signals need a database" in capsys.readouterr().err


def test_a_full_disk_leaves_no_file(tmp_path):
    log = tmp_path / "a.log"
    log.write_text(LOG)
    decoded = decode_log(read_log(log), parse_database(DBC))
    with pytest.raises(OSError, match="No space left"), McapMessages(Path("/dev/full"), layout_of(decoded)) as messages:
        messages.write(block_of(decoded))


@pytest.mark.slow
def test_a_run_writes_it_and_goes_on_without_it(tmp_path, capsys):
    assert main(["run", "stop72", "--virtual", "--mcap", "--json", "--out", str(tmp_path / "a")]) == 0
    capsys.readouterr()
    assert messages_in(tmp_path / "a" / "recording.mcap")["/vehicle/BRAKE_PEDAL"] > 900
    (tmp_path / "b" / "recording.mcap").mkdir(parents=True)  # nothing can be written there
    assert main(["run", "stop72", "--virtual", "--mcap", "--json", "--out", str(tmp_path / "b")]) == 5
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "incomplete"
    assert "recording.mcap" in told["missing"][0]
    assert told["page"] is not None
    same = [(tmp_path / folder / "recording.log").read_bytes() for folder in "ab"]
    assert same[0] == same[1]


def test_stamps_before_1970_are_refused(tmp_path):
    log = tmp_path / "a.csv"
    log.write_text("time_s,channel,id,extended,flags,length,data\n-1.0,can0,001,0,,2,0401\n")
    decoded = decode_log(read_log(log), parse_database(DBC))
    with pytest.raises(LogError, match="before 1970"):
        write_mcap([block_of(decoded)], layout_of(decoded), tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_names_become_identifiers_once_each():
    taken = {}
    assert [identifier(name, taken) for name in ("a.b", "a b", "1st", "größe", "")] == [
        "a_b",
        "a_b_2",
        "_1st",
        "gr__e",
        "_",
    ]


def test_numbers_of_fields_leave_the_reserved_ones_out():
    assert [number_of(place) for place in (0, 18_998, 18_999)] == [1, 18_999, 20_000]
    assert varint(300) == b"\xac\x02"
