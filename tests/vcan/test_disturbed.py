"""A run on the kernel's SocketCAN while the time of day is set, and while the interface is down for half a second.

All times are stamps of the recording.
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from processes import RUN_LIMIT_S, result_of, wait_until
from started import latest

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.contract import contract
from dbc.frame import BusName, Frame, Received
from dbc.messages import BrakeMode, BrakeStatus, Fault
from ecu.node import EcuNode
from hil.bench.result import Signals
from hil.bus import Bus, open_bus
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

if TYPE_CHECKING:
    from started import Started

HOUR_S = 3600.0
APART_S = 0.1  # of frames of one tick; a busy machine sends them late, an hour it is not
BACK_S = 0.3  # after the interface is up again
DOWN_S = 0.5
READ_S = 0.1  # until a reader has taken what had arrived
BURST_S = 0.2

TICK_NS = 10_000_000
TICKS = 260
STAMP_NS = 2_000_000  # of the kernel, against a reading of both clocks

ROLLING = """title = "the car rolls downhill, and brakes at last"
[start]
speed_mps = 15.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.3]]
[[road]]
start_m = -100.0
grade = -0.15
[end]
duration_s = 6.0
after_standstill_s = false
"""


@pytest.fixture
def stepped_clock() -> Iterator[Callable[[float], None]]:
    """Set the time of day forward or back; it is set right at the end. Never on a machine that others use."""
    if os.environ.get("VCAN_LAB") != "uml":
        pytest.skip("sets the time of day: inside User-Mode Linux only")
    ahead_s = time.time() - time.monotonic()

    def step(by_s: float) -> None:
        time.clock_settime(time.CLOCK_REALTIME, time.time() + by_s)

    yield step
    time.clock_settime(time.CLOCK_REALTIME, time.monotonic() + ahead_s)


@pytest.fixture
def driving(lab_vcan0: str, folder: Path, begin: Callable[..., Started], request: pytest.FixtureRequest) -> Any:
    """A run on vcan0 whose car rolls: the process, and its recording."""
    (folder / "rolling.toml").write_text(ROLLING)
    out = request.node.name
    bench = begin("run", "rolling.toml", "--json", "--bus", f"socketcan:{lab_vcan0}", "--out", out)
    log = folder / out / "recording.log"

    def braking() -> bool:
        assert bench.process.poll() is None, bench.words.read_text()
        running = any(motion.manoeuvre is ManoeuvreState.RUNNING for motion in latest(log, TruthMotion))
        return running and all(status.mode is BrakeMode.NORMAL for status in latest(log, BrakeStatus))

    wait_until(braking, "the manoeuvre", RUN_LIMIT_S)
    return bench, log


def stamps(log: Path) -> dict[str, list[tuple[float, int]]]:
    """Time and identifier of every line of a recording, by bus."""
    found: dict[str, list[tuple[float, int]]] = {"vehicle": [], "bench": []}
    for line in log.read_text().splitlines():
        stamp, bus, frame = line.split()
        found[bus].append((float(stamp.strip("()")), int(frame.partition("#")[0], 16)))
    return found


def test_nothing_fires_when_the_time_of_day_jumps_by_an_hour(
    lab_vcan0: str, stepped_clock: Callable[[float], None], folder: Path
) -> None:
    """Car and controller tick by tick, every frame awaited: the machine's load moves nothing."""
    (folder / "rolling.toml").write_text(ROLLING)
    loaded = load_scenario(str(folder / "rolling.toml"))
    car, ecu = PlantNode(loaded.plant, loaded.manoeuvre, seed=1), EcuNode(loaded.ecu)
    spec = f"socketcan:{lab_vcan0}"
    with open_bus(spec, BusName.VEHICLE) as there, open_bus(spec, BusName.VEHICLE) as here:

        def carry(sender: Bus, receiver: Bus, frames: list[Frame], jump_s: float) -> list[Received]:
            """Send frames, set the time of day half way, receive them all; stamps must be of that time."""
            frames = [frame for frame in frames if frame.bus is BusName.VEHICLE]
            before_ns, received = time.monotonic_ns(), []
            sender.send(frames[::2])
            if jump_s:
                stepped_clock(jump_s)
            sender.send(frames[1::2])
            while len(received) < len(frames):
                received += receiver.receive(1.0)
            assert all(isinstance(item, Frame) for item in received)
            times_ns = [item.time_ns for item in received]
            assert before_ns - STAMP_NS <= times_ns[0]
            assert times_ns == sorted(times_ns)
            assert times_ns[-1] <= time.monotonic_ns()
            return received

        heard: list[Received] = []
        for tick in range(TICKS):
            jump_s = {200: HOUR_S, 220: -2.0 * HOUR_S, 221: HOUR_S}.get(tick, 0.0)
            inbox = carry(there, here, car.step(tick * TICK_NS, heard), jump_s)
            heard = carry(here, there, ecu.step(tick * TICK_NS, inbox), -jump_s if tick > 220 else 0.0)
            if tick >= 100:
                assert ecu.outputs is not None
                assert (ecu.outputs.mode, ecu.outputs.faults) == (BrakeMode.NORMAL, Fault.NONE), tick


def test_a_recording_and_its_bus_load_stand_when_the_time_of_day_jumps_by_an_hour(
    driving: Any, stepped_clock: Callable[[float], None], figure: Callable[[str], None]
) -> None:
    bench, log = driving
    begun_s = time.monotonic()
    for by_s in (HOUR_S, -2.0 * HOUR_S, HOUR_S):
        stepped_clock(by_s)
        time.sleep(0.5)
    assert bench.process.poll() is None, "the run ended before the last step"
    stepped_s = time.monotonic() - begun_s
    result = result_of(bench.process)
    assert result["verdict"] == "passed"
    assert (result["link_states"], result["frames_lost"], result["frames_corrupt"]) == ({}, 0, 0)
    assert 0.1 < result["bus_load"] < 0.5  # 0.4 with no tick skipped; spread over an hour it is below 0.001
    signals = Signals(log)
    seen = stamps(log)
    whole_s = [time_s for bus in seen.values() for time_s, _ in bus]
    assert max(whole_s) - min(whole_s) < HOUR_S / 2
    assert stepped_s < max(whole_s) - min(whole_s)
    # kernel's stamps of the vehicle bus beside the bench bus's monotonic ones: both frames are of one tick of the plant
    truth = signals.get("TRUTH_MOTION.SPEED")[0]
    wheel = signals.get("WHEEL_SPEED_FRONT.WHEEL_SPEED_FL")[0]
    apart_s = np.min(np.abs(wheel[:, None] - truth[None, :]), axis=1)
    assert np.median(np.diff(wheel)) == pytest.approx(0.01, rel=0.05)
    assert apart_s.max() < APART_S
    figure(
        f"time of day set by +1 h, -2 h, +1 h: frames of one tick on both buses {np.median(apart_s) * 1e3:.2f} ms "
        f"(median), {apart_s.max() * 1e3:.1f} ms (max) apart; bus load {result['bus_load']:.3f}"
    )


def test_frames_flow_again_soon_after_the_interface_is_up_and_none_is_stale(
    driving: Any, lab_vcan0: str, figure: Callable[[str], None]
) -> None:
    bench, log = driving
    ahead_s = time.time() - time.monotonic()
    subprocess.run(["ip", "link", "set", lab_vcan0, "down"], check=True)
    down_s = time.monotonic()
    time.sleep(DOWN_S)
    early_s = time.monotonic()
    subprocess.run(["ip", "link", "set", lab_vcan0, "up"], check=True)
    up_s = time.monotonic()
    result = result_of(bench.process, (0, 1, 4))  # what the pause means for the run is not the subject here
    assert result["processes"] == 2
    assert result["link_states"] == {"disconnected": 1, "restarted": 1}

    frames = [(time_s - ahead_s, can_id) for time_s, can_id in stamps(log)["vehicle"]]
    # what was on its way when the interface went down may be stamped when its reader looks next
    down = [time_s - down_s for time_s, can_id in frames if can_id < 0x800 and down_s + READ_S < time_s < early_s]
    assert not down, down
    first_s = {}
    for message in contract(BusName.VEHICLE).by_id.values():
        later = [time_s for time_s, can_id in frames if can_id == message.can_id and time_s >= early_s]
        first_s[message.name] = later[0] - up_s
        burst = [time_s for time_s in later if time_s < later[0] + BURST_S]
        # what was due while the interface was down is not sent after all
        assert len(burst) <= BURST_S / (message.cycle_ns * 1e-9) + 2, message.name
    assert max(first_s.values()) < BACK_S, first_s
    figure(f"{lab_vcan0} down for {DOWN_S} s: all messages again {max(first_s.values()) * 1e3:.0f} ms after it is up")
