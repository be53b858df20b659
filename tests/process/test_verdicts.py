"""A verdict whatever a disk, a bus or a person does: real processes, real limits, real signals."""

import json
import os
import signal
import sys

import pytest
from processes import RUN_LIMIT_S, result_of, wait_until

from hil.bench.result import Signals

pytestmark = pytest.mark.slow
COMMAND = [sys.executable, "-m", "hil.cli.main"]
BLENDED = """title = "blended stop"
blending = 0.6
[start]
speed_mps = 5.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.6]]
[end]
duration_s = 8.0
after_standstill_s = 0.3
"""
RAISES = """
import sys
if "ecu" in sys.orig_argv:
    import ecu.node
    step = ecu.node.EcuNode.step
    def step_of_mine(self, now_ns, inbox):
        if now_ns > 500_000_000:
            raise ArithmeticError("no more of this")
        return step(self, now_ns, inbox)
    ecu.node.EcuNode.step = step_of_mine
"""


def limited(kilobytes):
    """The command under a limit of file sizes, which a full disk is to who writes."""
    return ["bash", "-c", f'ulimit -f {kilobytes}; exec "$@"', "limited", *COMMAND]


def test_a_full_disk_gives_a_verdict(start, channel, short, tmp_path):
    process = start("run", short, "--bus", channel, "--json", "--out", "out", program=limited(48))
    result = result_of(process, expected=5)
    assert (result["verdict"], result["exit_code"], result["ended_early"]) == ("incomplete", 5, True)
    assert "recorder" in result["reason"]
    assert "INCOMPLETE (File too large)" in result["reason"]
    assert Signals(tmp_path / result["log"]).decoded.frames > 500
    assert any(line.startswith("report.html: ") for line in result["missing"])  # 100 kB and more
    assert result["page"] is None


def test_a_full_disk_in_virtual_time(start, short):
    process = start("run", short, "--virtual", "--out", "out", program=limited(48))
    out, err = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode == 5, err
    assert "INCOMPLETE" in out
    assert "missing  report.html" in out


def test_a_folder_that_cannot_be_written_is_refused_before_anything_starts(brakebench, channel, short, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "recording.log").write_text("")
    for folder, why in (
        ("file/out", "file/out: cannot be written (Not a directory)"),
        ("/proc/out", "/proc/out: cannot be written"),
        ("full", "full: holds a recording.log already"),
    ):
        done = brakebench("run", short, "--bus", channel, "--out", folder, check=2)
        assert why in done.stderr
        assert not {"Traceback", "starting"} & set(done.stderr.split())
        assert done.stdout == ""
    for command in (["run", short, "--virtual"], ["compare", short]):
        assert "file/out: cannot be written" in brakebench(*command, "--out", "file/out", check=2).stderr


@pytest.mark.parametrize("when", ["at the start", "at the first frames"])
def test_ctrl_c_early_gives_a_verdict(start, channel, tmp_path, when, short):
    process = start("run", short, "--bus", channel, "--json", "--out", "out")
    log = tmp_path / "out" / "recording.log"
    wait_until(lambda: log.exists() and (when == "at the start" or log.stat().st_size), "a recording")
    process.send_signal(signal.SIGINT)
    result = result_of(process, expected=130)
    assert (result["verdict"], result["reason"]) == ("incomplete", "interrupted")
    assert (result["exit_code"], result["missing"] == []) == (130, log.stat().st_size > 0)


def test_a_foreign_controller_that_dies_breaks_the_run(start, channel, short, tmp_path):
    ecu = start("ecu", "--bus", channel)
    bench = start("run", short, "--without", "ecu", "--bus", channel, "--json", "--out", "out")
    log = tmp_path / "out" / "recording.log"

    def braking():
        assert bench.poll() is None, bench.communicate()
        return _written(log) and _manoeuvre_time_s(log) > 0.5

    wait_until(braking, "the stop")
    ecu.kill()
    out, err = bench.communicate(timeout=RUN_LIMIT_S)
    assert bench.returncode == 3, err
    result = json.loads(out)
    assert result["verdict"] == "broken"
    assert "messages of the ECU stopped; the last ones: " in result["reason"]
    assert "watch: the ECU is silent since " in err


def _written(log):
    return log.exists() and log.stat().st_size


def _manoeuvre_time_s(log):
    t_s, state = Signals(log).get("TRUTH_MOTION.MANOEUVRE")
    return t_s[-1] if len(t_s) and state[-1] else 0.0


def test_a_second_plant_is_refused_at_the_start_and_told_while_running(start, brakebench, channel, short, tmp_path):
    plant = start("plant", short, "--bus", channel)
    record = start("record", "before.log", "--bus", channel)
    before = tmp_path / "before.log"
    wait_until(lambda: _written(before), "the plant's frames")
    refused = brakebench("run", short, "--without", "ecu", "--bus", channel, "--out", "refused", check=2)
    assert f"bus {channel}: somebody already sends 0xA0 BRAKE_PEDAL" in refused.stderr
    assert not (tmp_path / "refused").exists()
    record.send_signal(signal.SIGINT)
    record.communicate(timeout=RUN_LIMIT_S)
    plant.send_signal(signal.SIGSTOP)  # says nothing while the bench listens
    bench = start("run", short, "--bus", channel, "--json", "--out", "out")
    log = tmp_path / "out" / "recording.log"
    wait_until(lambda: _written(log) and _manoeuvre_time_s(log) > 0.1, "the manoeuvre")
    plant.send_signal(signal.SIGCONT)
    out, err = bench.communicate(timeout=RUN_LIMIT_S)
    assert bench.returncode == 4, (out, err)
    assert any("somebody else sends it too" in found["text"] for found in json.loads(out)["findings"])
    assert "watch: " in err


def test_a_plant_by_hand_waits_for_the_bench_that_plays_its_part(start, channel, tmp_path):
    (tmp_path / "blended.toml").write_text(BLENDED)
    plant = start("plant", "blended.toml", "--bus", channel)
    start("ecu", "blended.toml", "--bus", channel)
    record = start("record", "before.log", "--bus", channel)
    log = tmp_path / "before.log"
    normal = "10 valid frames of each demand and more"

    def demanded():
        names = ("EHB_DEMAND_FRONT.ALIVE_COUNTER", "TRUTH_MOTION.SPEED")
        return _written(log) and all(len(Signals(log).get(name)[0]) > 50 for name in names)

    wait_until(demanded, normal)
    assert set(Signals(log).get("TRUTH_MOTION.MANOEUVRE")[1]) == {0.0}
    record.send_signal(signal.SIGINT)
    record.communicate(timeout=RUN_LIMIT_S)
    bench = start(
        "run", "blended.toml", "--without", "plant", "--without", "ecu", "--bus", channel, "--json", "--out", "out"
    )
    result = result_of(bench, (0, 4))
    signals = Signals(tmp_path / result["log"])
    assert set(signals.get("STIMULUS_ECU.BLENDING_FACTOR")[1]) == {0.6}
    assert signals.get("TRUTH_MOTION.SPEED")[1][-1] < 0.1
    plant.send_signal(signal.SIGINT)
    _, err = plant.communicate(timeout=RUN_LIMIT_S)
    wanted = f"the manoeuvre waits for `brakebench run blended --without plant --bus {channel}`"
    assert f"plant: the bench plays this scenario's the blending factor; {wanted}" in err


def test_an_exception_in_a_nodes_process_is_shown_with_file_and_line(brakebench, channel, short, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(RAISES)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = brakebench("run", short, "--bus", channel, "--json", check=3, env={"PYTHONPATH": path})
    result = json.loads(done.stdout)
    assert result["verdict"] == "broken"
    assert "ecu (process " in result["reason"]
    assert "ArithmeticError: no more of this" in result["reason"]
    assert f'File "{tmp_path}/sitecustomize.py", line 8, in step_of_mine' in done.stderr
