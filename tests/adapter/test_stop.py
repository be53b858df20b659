"""Runs at 100 Hz over two adapters: the bench with the car on can0, the controller on can1, candump on both."""

from __future__ import annotations

import signal
import time
from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from processes import RUN_LIMIT_S, result_of, wait_until
from started import latest

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.contract import contract, spec_of
from dbc.frame import BusName
from dbc.messages import BrakeMode, BrakeStatus, BrakeTroubleCode
from hil.bench.result import Signals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from candump import Candump
    from conftest import Adapter
    from started import Started

    Cards = tuple[Adapter, Adapter]

BESIDE = ("--without", "ecu", "--realtime", "--json")
DOWN_S = 0.5
LINK_DOWN = 0x3041  # docs/trouble-codes.md

SHORT = """title = "short stop"
[start]
speed_mps = 5.0
[driver]
pedal = [[1.0, 0.0], [1.2, 0.6]]
[end]
duration_s = 10.0
"""


ROLLING = """title = "the car rolls downhill, and brakes"
[start]
speed_mps = 15.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.3]]
[[road]]
start_m = -100.0
grade = -0.15
[end]
duration_s = 8.0
after_standstill_s = false
"""


def recorded(log: Path) -> list[tuple[int, bytes]]:
    """Identifier and payload of every frame of the vehicle bus in one of our recordings."""
    frames = [line.split()[2].split("#") for line in log.read_text().splitlines() if " vehicle " in line]
    return [(int(can_id, 16), bytes.fromhex(data)) for can_id, data in frames]


def cars(frames: Counter[tuple[int, bytes]]) -> Counter[tuple[int, bytes]]:
    """Those of the car."""
    ecu = {spec.can_id for spec in contract(BusName.VEHICLE).sent_by("ECU")}
    return Counter({frame: count for frame, count in frames.items() if frame[0] not in ecu})


@pytest.fixture(scope="module")
def ecu(adapters: Cards, folder: Path, begin: Callable[..., Started]) -> Iterator[Started]:
    """The controller on its own adapter, for all runs; Ctrl-C ends it at once and without a word of error."""
    (folder / "short.toml").write_text(SHORT)
    ecu = begin("ecu", "short.toml", "--realtime", "--bus", adapters[1].spec)
    ecu.says("every 10 ms")
    yield ecu
    ecu.process.send_signal(signal.SIGINT)
    assert ecu.process.wait(60) == 0, ecu.words.read_text()
    assert "Traceback" not in ecu.words.read_text()


def test_car_and_controller_stop_each_on_its_own_adapter(
    adapters: Cards,
    ecu: Started,
    folder: Path,
    begin: Callable[..., Started],
    candump: Callable[[str], Candump],
    figure: Callable[[str], None],
) -> None:
    witnesses = [candump(adapter.name) for adapter in adapters]
    bench = begin("run", "short.toml", *BESIDE, "--bus", adapters[0].spec, "--out", "stop")
    result = result_of(bench.process)
    there, here = (Counter((line.can_id, line.data) for line in witness.stop()) for witness in witnesses)
    ours = Counter(recorded(folder / "stop" / "recording.log"))

    assert (result["verdict"], result["bus"]) == ("passed", "socketcan:can0")
    assert (result["frames_lost"], result["frames_corrupt"], result["link_states"]) == (0, 0, {})
    assert result["overruns"] == 0
    assert 3.5 < result["stop_distance_m"] < 6.5
    signals = Signals(folder / "stop" / "recording.log")
    times_s, modes = signals.get("BRAKE_STATUS.MODE")
    driven = times_s < signals.get("TRUTH_MOTION.SPEED")[0][-1]
    normal = list(modes[driven]).index(BrakeMode.NORMAL)
    assert set(modes[driven][normal:]) == {BrakeMode.NORMAL}

    assert {can_id for can_id, _ in ours} == set(contract(BusName.VEHICLE).by_id)
    assert not ours - there  # the controller was there before the bench, and stayed
    assert not ours - here
    assert cars(ours) == cars(there) == cars(here)
    figure(
        f"stop over {adapters[0].name} and {adapters[1].name}, driver {adapters[0].driver}: "
        f"{result['stop_distance_m']:.2f} m, {ours.total()} frames recorded, all on both, "
        f"{result['overruns']} overruns, lateness p99 {result['lateness_ms']['p99']:.2f} ms by the guest's clock"
    )


def test_the_controllers_interface_is_down_for_half_a_second_of_a_run(
    cards: Cards,
    ecu: Started,
    folder: Path,
    begin: Callable[..., Started],
    candump: Callable[[str], Candump],
    figure: Callable[[str], None],
) -> None:
    (folder / "rolling.toml").write_text(ROLLING)
    witness = candump(cards[0].name)
    bench = begin("run", "rolling.toml", *BESIDE, "--bus", cards[0].spec, "--out", "down")
    log = folder / "down" / "recording.log"

    def braking() -> bool:
        assert bench.process.poll() is None, bench.words.read_text()
        running = any(motion.manoeuvre is ManoeuvreState.RUNNING for motion in latest(log, TruthMotion))
        return running and all(status.mode is BrakeMode.NORMAL for status in latest(log, BrakeStatus))

    wait_until(braking, "the manoeuvre", RUN_LIMIT_S)
    cards[1].down()
    time.sleep(DOWN_S)
    cards[1].up()
    result = result_of(bench.process, expected=4)
    seen = witness.stop()
    assert ecu.process.poll() is None
    assert result["verdict"] == "inconclusive"
    assert result["link_states"] == {}  # of the bench's own adapter
    status = spec_of(BrakeStatus)
    frames = [line for line in seen if line.can_id == status.can_id]
    gap_s, again = max((b.time_s - a.time_s, i + 1) for i, (a, b) in enumerate(pairwise(frames)))
    told = [status.decode(line.data) for line in frames[again:]]
    assert gap_s >= DOWN_S
    assert told[0].mode >= BrakeMode.FRICTION_ONLY
    assert BrakeMode.NORMAL in [one.mode for one in told]
    codes = spec_of(BrakeTroubleCode)
    numbers = {codes.decode(line.data)[0] for line in seen if line.can_id == codes.can_id}
    assert LINK_DOWN in numbers, numbers
    figure(
        f"controller's interface down for {gap_s:.2f} s of a run: first word after it {told[0].mode.name}; "
        f"the run says: {result['reason']}"
    )
