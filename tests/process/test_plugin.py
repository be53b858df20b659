"""The pytest plugin in pytest processes of its own: passing, failing, timing out, interrupted, in parallel."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from documented import MOTOR_LOSS
from processes import RUN_LIMIT_S, alive, children_of, heed_interrupts, wait_until

from hil.bench.result import Signals

NO_TAKEOVER = """
import ecu.law.step  # every motor is taken for able, whatever it reports
ecu.law.step._usable_torque = lambda *_: (700.0, 700.0, 700.0, 700.0)
"""
FIXTURES = """
import pytest
from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakeMode, BrakeStatus, MotorState, MotorStatusFront
from hil.errors import BrakebenchError

def test_all_fixtures_share_one_bench(bench, bus, clock, faults, recording):
    assert "motor_dead" in faults.names
    assert bus.latest(BrakeStatus) is None
    bench.drive("20 m/s")
    clock.run(0.5)
    assert clock.now_s == pytest.approx(0.5, abs=0.011)
    assert bus.latest(BrakeStatus).mode is BrakeMode.NORMAL
    faults.inject("motor_dead", wheel=["fl", "fr"])
    clock.run(0.1)
    assert bus.latest(MotorStatusFront).fault_fr is MotorState.FAILED
    faults.clear("motor_dead", wheel="fr")
    clock.run(0.1)
    assert bus.latest(MotorStatusFront).fault_fr is MotorState.OK
    seen = bus.count(BrakeStatus)
    bus.send(Frame(BusName.VEHICLE, spec_of(BrakeStatus).can_id, bytes(8)))
    clock.run(0.02)
    assert bus.count(BrakeStatus) == seen + 1  # every 20 ms; our own is not heard
    assert recording.get("TRUTH_MOTION.SPEED")[1][-1] == pytest.approx(20.0, abs=0.3)
    assert recording.path.exists()

def test_road_steering_and_speed(bench, recording):
    bench.drive(15.0)
    bench.steer(0.5)
    bench.road(0.9, grade=0.02)
    bench.run(1.5)
    assert recording.get("BODY_MOTION.YAW_RATE")[1][-20:].mean() > 0.05
    assert recording.get("STIMULUS_ROAD.GRADE")[1][-1] == pytest.approx(0.02)
    bench.drive("72 km/h")
    bench.run_until(lambda b: b.speed_mps > 17.0)
    bench.coast()
    bench.run(2.0)
    assert bench.speed_mps < 17.0

def test_a_scenario_of_the_library(bench):
    bench.load("mu_jump")
    bench.run(2.0)
    assert 15.0 < bench.speed_mps < 19.5

@pytest.mark.parametrize(("ask", "says"), [
    (lambda b: b.drive("72 mph"), "expected a number with km/h or m/s"),
    (lambda b: b.pedal(60), "expected a travel from 0 to 1"),
    (lambda b: b.inject("motor_ded"), "did you mean 'motor_dead'"),
    (lambda b: b.inject("motor_dead", wheel="left"), "expected fl, fr, rl, rr"),
    (lambda b: b.deceleration_dip(), "has not run yet"),
    (lambda b: (b.run(0.1), b.signals.get("TRUTH_MOTION.SPED")), "did you mean TRUTH_MOTION.SPEED"),
    (lambda b: b.latest("BrakeState"), "did you mean BrakeStatus"),
    (lambda b: b.count(Frame), "expected a message type"),
    (lambda b: (b.run(0.1), b.load("stop72")), "runs already"),
    (lambda b: b.run_until(lambda b: False, timeout=0.5), "did not come true within 0.5 s"),
    (lambda b: (b.load("no_such"), b.run(1.0)), "no scenario 'no_such'"),
    (lambda b: (b.load("stop72"), b.run(30.0)), "the scenario ended at"),
])
def test_wrong_use_says_what_to_do(bench, ask, says):
    with pytest.raises(BrakebenchError, match=says):
        ask(bench)
"""
OWN_ECU = """
from dbc.frame import BusName
from hil.pytest_plugin import stopped

class Mute:
    def step(self, now_ns, inbox):
        return []

def test_own_ecu(bench):
    bench.use(ecu=Mute())
    bench.run(1.0)
"""
RAISING_ECU = """
from ecu.node import EcuNode
from hil.scenario.scenario import load_scenario

class Mine:
    def __init__(self):
        self.node = EcuNode(load_scenario("stop72").ecu, 10_000_000)

    def step(self, now_ns, inbox):
        if now_ns > 500_000_000:
            self.demand(now_ns)
        return self.node.step(now_ns, inbox)

    def demand(self, now_ns):
        return 1.0 / (now_ns - now_ns)

def test_own_ecu(bench):
    bench.use(ecu=Mine())
    bench.run(1.0)
"""
REAL = """
from hil.pytest_plugin import stopped

def test_stop(bench, recording):
    bench.drive("18 km/h")
    bench.pedal(0.5)
    bench.inject("motor_dead", wheel="fl", after=0.5)
    bench.run_until(stopped, timeout=30.0)
    assert 1.0 < recording.get("TRUTH_MOTION.DISTANCE")[1][-1] < 20.0
    assert recording.get("MOTOR_STATUS_FRONT.FAULT_FL")[1][-1] == 2
"""


DISTURB = """
def disturb(bench):
    import time
    from dbc.contract import spec_of
    from dbc.frame import BusName, Frame
    from dbc.messages import Steering
    from hil.bus.open import open_bus
    bench.run(0.1)
    with open_bus(bench._bench_run.spec, BusName.VEHICLE) as bus:
        for _ in range(50):
            bus.send([Frame(BusName.VEHICLE, spec_of(Steering).can_id, bytes(8))])
            time.sleep(0.002)
"""


@pytest.fixture
def run_pytest(tmp_path):
    """Start pytest on some text; `communicate` ends it."""
    started = []

    def begin(text, *options, conftest=""):
        (tmp_path / "test_it.py").write_text(text)
        (tmp_path / "conftest.py").write_text(conftest)
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", *options]
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
        started.append(
            subprocess.Popen(
                command,
                cwd=tmp_path,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env=environment,
                start_new_session=True,
                preexec_fn=heed_interrupts,
            )
        )
        return started[-1]

    yield begin
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def output(process, expected):
    out, _ = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode == expected, out
    return out


def named(out, what):
    """The file that the output names."""
    return Path(re.search(rf"^{what}: (.+)$", out, re.MULTILINE)[1])


def test_the_requirement_passes_and_is_listed(run_pytest, tmp_path):
    out = output(run_pytest(MOTOR_LOSS, "--junitxml=junit.xml", "--strict-markers", "-W", "error"), 0)
    assert "BRK-7: passed (1 test)" in out
    assert '<property name="requirement" value="BRK-8"' in (tmp_path / "junit.xml").read_text()


def test_without_takeover_it_fails_with_recording_figure_and_report(run_pytest):
    out = output(run_pytest(MOTOR_LOSS, conftest=NO_TAKEOVER), 1)
    assert re.search(r"assert 0\.\d+ < 0\.3", out)
    assert Signals(named(out, "recording")).get("TRUTH_MOTION.SPEED")[1][-1] < 0.1
    assert named(out, "figure").read_bytes().startswith(b"\x89PNG")
    page = named(out, "report").read_text()
    assert "test_motor_loss" in page
    assert "BRK-7" in page
    assert "requirements: BRK-7, BRK-8" in out
    assert "BRK-8: failed (1 test)" in out


@pytest.mark.slow
def test_fixtures_in_parallel(run_pytest, tmp_path):
    out = output(run_pytest(FIXTURES + MOTOR_LOSS, "-n", "2", "--brakebench-out", "files", conftest=NO_TAKEOVER), 1)
    assert "15 passed" in out
    assert "1 failed" in out
    assert named(out, "figure").parent == tmp_path / "files" / "test_motor_loss"
    assert "BRK-7: failed (1 test)" in out


@pytest.mark.slow
def test_an_ecu_that_says_nothing_is_named(run_pytest):
    out = output(run_pytest(OWN_ECU), 1)
    assert "BenchError: the manoeuvre did not start: the plant never saw valid demands of an ECU" in out
    assert named(out, "recording").exists()


@pytest.mark.slow
def test_an_exception_in_an_own_node_is_shown_with_file_and_line(run_pytest):
    out = output(run_pytest(RAISING_ECU), 1)
    assert "return 1.0 / (now_ns - now_ns)" in out
    assert re.search(r"test_it\.py:\d+: ZeroDivisionError", out)
    assert "BenchError: ecu raised ZeroDivisionError at 0.505 s: " in out
    assert "verdict: broken" in out
    assert "1 broken" in out


@pytest.mark.slow
def test_the_wall_time_limit(run_pytest):
    endless = "def test_endless(bench):\n    bench.run_until(lambda b: False, timeout=1e6)\n"
    out = output(run_pytest(endless, "--brakebench-limit", "1"), 1)
    assert "wall-time limit of 1 s reached at" in out
    assert named(out, "report").exists()


@pytest.mark.slow
def test_interrupted_in_virtual_time(run_pytest, tmp_path):
    text = "def test_endless(bench):\n    bench.run_until(lambda b: False, timeout=1e6)\n"
    process = run_pytest(text, "--brakebench-out", "files")
    log = tmp_path / "files" / "test_endless" / "recording.log"
    wait_until(lambda: log.exists() and log.stat().st_size, "a recording")
    process.send_signal(signal.SIGINT)
    out = output(process, 2)
    assert "KeyboardInterrupt" in out
    assert Signals(named(out, "brakebench: stopped before its end; recording")).decoded.frames > 0


def test_in_real_time(run_pytest, tmp_path):
    """A busy machine may make the run inconclusive: then the test has not passed, and says why."""
    process = run_pytest(REAL, "--brakebench-realtime", "--junitxml=junit.xml", "-v")
    out, _ = process.communicate(timeout=RUN_LIMIT_S)
    assert "brakebench: real time on a free bus; real-time scheduling asked for" in out
    assert re.search(r"^real time: .*no garbage collection.*(: granted|NOT granted, ).*\(1 bench\)$", out, re.MULTILINE)
    assert re.search(r"^real time: .*SCHED_FIFO", out, re.MULTILINE)
    if process.returncode:
        assert "brakebench: the test's own checks hold, but its run is inconclusive" in out
        assert re.search("^inconclusive: the .*(silent|skipped)", out, re.MULTILINE)
    verdict = "inconclusive" if process.returncode else "passed"
    assert f"1 {verdict}" in out
    junit = (tmp_path / "junit.xml").read_text()
    assert f'<property name="brakebench verdict" value="{verdict}"' in junit


@pytest.mark.slow
def test_a_run_that_a_second_sender_disturbs_has_not_passed(run_pytest, channel):
    """Somebody sends pedal frames in the middle of a test whose own checks hold."""
    text = REAL.replace("bench.run_until(stopped", "disturb(bench)\n    bench.run_until(stopped") + DISTURB
    out = output(run_pytest(text, "--brakebench-bus", channel, conftest=""), 1)
    assert "its run is inconclusive" in out
    assert "STEERING (0xE0 on the vehicle bus) came" in out
    assert "somebody else sends it too" in out


@pytest.mark.slow
def test_against_an_ecu_that_somebody_else_started(run_pytest, start, channel):
    ecu = start("ecu", "--bus", channel)
    process = run_pytest(REAL, "--brakebench-no-ecu", "--brakebench-bus", channel)
    out, _ = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode == 0 or "but its run is inconclusive" in out, out
    assert ecu.poll() is None


def test_interrupted_in_real_time_leaves_nothing_behind(run_pytest, channel):
    text = "def test_endless(bench):\n    bench.run_until(lambda b: False, timeout=1e6)\n"
    process = run_pytest(text, "--brakebench-bus", channel)

    def nodes():
        assert process.poll() is None, process.communicate()
        found = children_of(process.pid)
        return found if {"record", "plant", "ecu"} <= set(found) else None

    started = wait_until(nodes, "recorder, plant and ECU")
    process.send_signal(signal.SIGINT)
    out = output(process, 2)
    assert "stopped before its end; recording:" in out
    assert not any(alive(pid) for pid in started.values())
