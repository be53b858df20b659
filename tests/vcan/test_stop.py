"""Whole runs on the kernel's vcan, with can-utils as witness: what candump wrote decides, not what we recorded."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from processes import RUN_LIMIT_S, alive, children_of, result_of, wait_until
from started import blended, brakes, latest

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.contract import contract, spec_of
from dbc.e2e import check_value
from dbc.exchange import Receiver
from dbc.frame import BusName
from dbc.messages import (
    BrakeMode,
    BrakePedal,
    BrakeStatus,
    EhbDemandFront,
    EhbDemandRear,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorDemandFront,
    MotorDemandRear,
    MotorStatusFront,
    MotorStatusRear,
)
from hil.bench.result import Signals
from hil.bus import open_bus

if TYPE_CHECKING:
    from candump import Candump, Line
    from started import Started

    Begin = Callable[..., Started]
    Witness = Callable[[str], Candump]
    Figure = Callable[[str], None]

UNKNOWN_ID = 0x7A5
GARBAGE = bytes.fromhex("00A5DEADBEEF0123")  # as a motor demand: counter 5, wrong check value
TORQUE_FRAMES = 5  # of 10 ms: motor demand zero on the wire <= 50 ms after the plant's last frame
HOLD_S = 0.2  # the last demand stands for so long; then the brake follows its own pedal map
TIMEOUT_FRAMES = 5  # the brake waits 40 ms for a demand
SETTLED_FRAMES = 20  # motors and pressures have followed after 200 ms
NO_CURRENT_A = 5.0  # above the noise of the sensor
NOISE_PA = 1e5
PEDAL_NOISE = 0.01  # between two demands; the last frames of the plant may be read after the last one is sent
RIPPLE_PA = 5e3  # the same where the demand is small: five steps of the signal
STEADY_FRAMES = 20  # of motor demand with torque, before anybody is killed
OF_ECU = {spec.can_id for spec in contract(BusName.VEHICLE).sent_by("ECU")}

SHORT = """title = "short stop"
[start]
speed_mps = 5.0
[driver]
pedal = [[1.0, 0.0], [1.2, 0.6]]
[end]
duration_s = 10.0
"""


def messages(seen: list[Line], message: type[Any]) -> list[Any]:
    """What candump saw, as messages of a type."""
    spec = spec_of(message)
    return [spec.decode(line.data) for line in seen if line.can_id == spec.can_id]


def by_id(frames: list[tuple[int, bytes]]) -> dict[int, list[bytes]]:
    """Payloads of each identifier, in order."""
    found = defaultdict(list)
    for can_id, data in frames:
        found[can_id].append(data)
    return dict(found)


class Observed(NamedTuple):
    """A run with candump beside it."""

    result: dict[str, Any]
    words: str
    pid: int
    second: str
    orphans: list[str]
    folder: Path
    candump: Path
    seen: list[Line]
    recorded: list[tuple[float, int, bytes]]


@pytest.fixture(scope="module")
def observed(lab_vcan0: str, folder: Path, begin: Begin, candump: Witness) -> Observed:
    """A short stop on whatever `auto` takes; a second bench that tries the same; three frames from cansend."""
    (folder / "short.toml").write_text(SHORT)
    witness = candump(lab_vcan0)
    sender = ["sh", "-c", f"while read frame; do cansend {lab_vcan0} $frame; done"]  # a shell starts processes faster
    shell = subprocess.Popen(sender, stdin=subprocess.PIPE, text=True)
    first = begin("run", "short.toml", "--json", "--bus", "auto", "--out", "observed")
    first.says("bus socketcan")
    second = begin("run", "short.toml", "--json", "--bus", "auto", "--out", "second")
    line = second.says("bus loopback")
    children = wait_until(lambda: children_of(second.process.pid), "the second bench's recorder")
    second.process.kill()
    log = folder / "observed" / "recording.log"

    def braking() -> bool:
        assert first.process.poll() is None, first.words.read_text()
        return any(motion.manoeuvre is ManoeuvreState.RUNNING for motion in latest(log, TruthMotion))

    wait_until(braking, "the manoeuvre", RUN_LIMIT_S)
    shell.communicate(f"{UNKNOWN_ID:03X}#DEADBEEF\n0B0#{GARBAGE.hex()}\n0B1#00\n")
    result = result_of(first.process, (0, 4))
    words = first.words.read_text()
    recorded = []
    for one in log.read_text().splitlines():
        time, bus, frame = one.split()
        identifier, data = frame.split("#")
        if bus == "vehicle":
            recorded.append((float(time.strip("()")), int(identifier, 16), bytes.fromhex(data)))
    orphans = [name for name, pid in children.items() if alive(pid)]
    seen = witness.stop()
    return Observed(result, words, first.process.pid, line, orphans, folder, witness.path, seen, recorded)


def test_auto_takes_vcan0_and_says_so(observed: Observed) -> None:
    assert observed.result["bus"] == "socketcan:vcan0"
    assert "bus socketcan:vcan0 (vcan0 is there)" in observed.words.splitlines()


def test_a_second_bench_takes_a_loopback_and_says_why(observed: Observed) -> None:
    assert observed.second == f"bus loopback:brakebench (another bench, process {observed.pid}, has vcan0)"


def test_nothing_is_left_of_a_bench_killed_at_its_start(observed: Observed) -> None:
    assert observed.orphans == []


def test_candump_and_our_recording_hold_the_same_frames(observed: Observed, figure: Figure) -> None:
    theirs = [(line.can_id, line.data) for line in observed.seen]
    ours = [(can_id, data) for _, can_id, data in observed.recorded]
    assert not any(line.error for line in observed.seen)
    assert len(ours) > 1000
    assert by_id(ours) == by_id(theirs)
    assert {can_id for can_id, _ in theirs} == set(contract(BusName.VEHICLE).by_id) | {UNKNOWN_ID}
    apart_s = np.array([a[0] for a in observed.recorded]) - np.array([b.time_s for b in observed.seen])
    figure(
        f"run on vcan0: candump and recording hold the same {len(ours)} frames, time stamps "
        f"{np.median(np.abs(apart_s)) * 1e6:.0f} us (median), {np.abs(apart_s).max() * 1e3:.3f} ms (max) apart"
    )


def test_what_cansend_sent_is_on_record_and_counted_as_what_it_is(observed: Observed) -> None:
    frames = by_id([(can_id, data) for _, can_id, data in observed.recorded])
    assert frames[UNKNOWN_ID] == [b"\xde\xad\xbe\xef"]
    assert GARBAGE[0] != check_value(spec_of(MotorDemandFront).data_id or 0, GARBAGE)
    assert (frames[0x0B0].count(GARBAGE), frames[0x0B1].count(b"\x00")) == (1, 1)
    assert observed.result["frames_sent"] == len(observed.recorded)
    assert (observed.result["frames_corrupt"], observed.result["frames_lost"]) == (2, 0)


def test_the_run_goes_on_as_if_they_had_not_been_there(observed: Observed) -> None:
    assert observed.result["verdict"] in ("passed", "inconclusive")  # a busy machine skips ticks
    assert observed.result["processes"] == 2
    assert observed.result["link_states"] == {}
    assert 3.5 < observed.result["stop_distance_m"] < 6.5
    signals = Signals(observed.folder / "observed" / "recording.log")
    assert BrakeMode.NORMAL in signals.get("BRAKE_STATUS.MODE")[1]
    assert signals.get("ECU_RECEPTION.FRAMES_CORRUPT")[1].max() == 0


def test_decode_reads_candumps_own_file(observed: Observed) -> None:
    command = [sys.executable, "-m", "hil.cli.main", "decode", str(observed.candump), "--json"]
    done = subprocess.run(command, cwd=observed.folder, check=True, capture_output=True, text=True)
    decoded = json.loads(done.stdout)
    frames = by_id([(line.can_id, line.data) for line in observed.seen])
    assert (decoded["format"], decoded["truncated_at"]) == ("candump", None)
    assert (decoded["frames"], decoded["unknown"], decoded["rejected"]) == (len(observed.seen), 1, 0)
    assert decoded["decoded"] == len(observed.seen) - 1
    assert decoded["messages"]["MOTOR_DEMAND_REAR"]["short"] == 1  # the one cansend cut short
    counts = {name: message["count"] for name, message in decoded["messages"].items()}
    expected = {spec.name: len(frames[can_id]) for can_id, spec in contract(BusName.VEHICLE).by_id.items()}
    assert counts == expected
    corrupt = sum(one["corrupt"] for one in decoded["protection"].values())
    assert corrupt == 2  # that one, and the garbage


def test_a_killed_plant_takes_the_motor_demand_to_zero_and_no_pressure(
    lab_vcan0: str, folder: Path, begin: Begin, candump: Witness, figure: Figure
) -> None:
    (folder / "blended.toml").write_text(blended(40.0))
    witness = candump(lab_vcan0)
    bench = begin("run", "blended.toml", "--json", "--bus", f"socketcan:{lab_vcan0}", "--out", "killed-plant")
    log = folder / "killed-plant" / "recording.log"

    def braking() -> dict[str, int] | None:
        assert bench.process.poll() is None, bench.words.read_text()
        demands = latest(log, MotorDemandFront, STEADY_FRAMES)
        steady = len(demands) == STEADY_FRAMES and all(brakes(demand) for demand in demands)
        return children_of(bench.process.pid) if steady else None

    nodes = wait_until(braking, "the motors to brake", RUN_LIMIT_S)
    os.kill(nodes["plant"], signal.SIGKILL)
    result = result_of(bench.process, expected=3)
    seen = witness.stop()
    assert (result["verdict"], result["processes"]) == ("broken", 1)
    assert f"plant (process {nodes['plant']}) was killed by SIGKILL" in result["reason"]
    assert not any(alive(pid) for pid in nodes.values())

    last = max(i for i, line in enumerate(seen) if line.can_id not in OF_ECU)
    before, after = seen[: last + 1], seen[last + 1 :]
    assert len(messages(after, MotorDemandFront)) >= 30
    for kind in (MotorDemandFront, MotorDemandRear):
        assert brakes(messages(before, kind)[-1])
        torques = [min(values) for values in messages(after, kind)]
        carrying = torques.index(0.0)
        assert set(torques[carrying:]) == {0.0}
        assert carrying <= TORQUE_FRAMES
    pressed_s = [line.time_s for line in before if line.can_id == spec_of(BrakePedal).can_id][-1]
    for kind in (EhbDemandFront, EhbDemandRear):
        demands = messages(after, kind)
        at_death = [min(pair) for pair in zip(messages(before, kind)[-1], demands[0], strict=True)]
        times_s = [line.time_s for line in after if line.can_id == spec_of(kind).can_id]
        held = next((i for i, values in enumerate(demands) if None in values), len(demands))
        assert held == len(demands) or times_s[held] - pressed_s >= HOLD_S
        least = [(1.0 - PEDAL_NOISE) * v - RIPPLE_PA for v in at_death]
        assert all(d >= low for values in demands[:held] for d, low in zip(values, least, strict=True))
        taken_over = [d >= v for values in demands[carrying:held] for d, v in zip(values, at_death, strict=True)]
        assert all(taken_over)  # friction does what the motors did
        assert all(values == (None, None) for values in demands[held:])
        rise = max(max(values) for values in demands[:held]) / max(at_death)
    modes = [status.mode for status in messages(after, BrakeStatus)]
    found = next(i for i, mode in enumerate(modes) if mode is not BrakeMode.NORMAL)
    assert found <= 2  # of 20 ms
    lost = next(i for i, mode in enumerate(modes) if mode not in (BrakeMode.NORMAL, BrakeMode.DEGRADED))
    assert lost <= found + 2  # the body's motion is missed a frame before the motors are
    assert set(modes[lost:]) <= {BrakeMode.FRICTION_ONLY, BrakeMode.SAFE_STOP}

    zero = next(line for line in after if line.can_id == 0x0B1 and not any(messages([line], MotorDemandRear)[0]))
    told = next(line for line in after if messages([line], BrakeStatus) and messages([line], BrakeStatus)[0].mode > 1)
    figure(
        f"plant killed, alpha 0.7: {carrying} demands with torque after its last frame (at most {TORQUE_FRAMES}); "
        f"zero after {(zero.time_s - seen[last].time_s) * 1e3:.1f} ms, told after "
        f"{(told.time_s - seen[last].time_s) * 1e3:.1f} ms; pressure demand up to {rise:.2f} of that at death"
    )


def test_a_killed_ecu_leaves_the_brake_to_its_own_pedal_map(
    lab_vcan0: str, folder: Path, begin: Begin, candump: Witness, figure: Figure
) -> None:
    (folder / "blended.toml").write_text(blended(40.0))
    witness = candump(lab_vcan0)
    spec = f"socketcan:{lab_vcan0}"
    plant, ecu = begin("plant", "blended.toml", "--bus", spec), begin("ecu", "blended.toml", "--bus", spec)
    receiver = Receiver([MotorDemandFront, EhbPressureFront])
    with open_bus(spec, BusName.VEHICLE) as bus:
        count = 0

        def steady() -> bool:
            nonlocal count
            assert plant.process.poll() is None, plant.words.read_text()
            receiver.accept(0, bus.receive(0.1))
            demand = receiver.latest(MotorDemandFront)
            count = count + receiver.receptions[MotorDemandFront].fresh if demand and brakes(demand) else 0
            return count >= STEADY_FRAMES

        def alone() -> bool:
            nonlocal count
            receiver.accept(0, bus.receive(0.1))
            pressure = receiver.latest(EhbPressureFront)
            own_map = pressure is not None and pressure.ehb_state_front is EhbState.OWN_PEDAL_MAP
            count = count + receiver.receptions[EhbPressureFront].fresh if own_map else 0
            return count >= STEADY_FRAMES

        wait_until(steady, "the motors to brake", RUN_LIMIT_S)
        ecu.process.kill()
        wait_until(alone, "the brake to follow its own pedal map")
    plant.process.send_signal(signal.SIGINT)
    assert plant.process.wait(20) == 0
    seen = witness.stop()

    last = max(i for i, line in enumerate(seen) if line.can_id in OF_ECU)
    before, after = seen[: last + 1], seen[last + 1 :]
    for demand, told in ((EhbDemandFront, EhbPressureFront), (EhbDemandRear, EhbPressureRear)):
        states = [message[2] for message in messages(after, told)]
        own_map = states.index(EhbState.OWN_PEDAL_MAP)
        assert own_map <= TIMEOUT_FRAMES
        assert set(states[own_map:]) == {EhbState.OWN_PEDAL_MAP}
        at_death = messages(before, demand)[-1]
        held = [message[:2] for message in messages(after, told)[own_map + SETTLED_FRAMES :]]
        assert len(held) >= 10
        assert all(v > d - NOISE_PA for values in held for v, d in zip(values, at_death, strict=True))
    for status in (MotorStatusFront, MotorStatusRear):
        currents = [max(abs(message[0]), abs(message[3])) for message in messages(after, status)]
        free = next(i for i in range(len(currents)) if max(currents[i:]) < NO_CURRENT_A)
        assert free <= SETTLED_FRAMES
    line = [one for one in after if one.can_id == spec_of(EhbPressureRear).can_id][own_map]
    figure(
        f"ECU killed, alpha 0.7: {own_map} pressure frames until the brake follows its own pedal map "
        f"({(line.time_s - seen[last].time_s) * 1e3:.1f} ms), motor current gone after {free} frames of 10 ms"
    )
