"""The whole closed loop in virtual time beside the same loop over cantools and python-can's virtual bus.

Same plant, same law, same protection, same frames; the other side encodes and decodes with cantools and sends every
frame through python-can. The share of each part is timed in the same runs. `beside` compares with another checkout.
"""

import contextlib
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import can

import ecu.node
from dbc.batch import Batch
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, Received
from hil.bench.stimulus import StimulusNode
from hil.bench.virtual import members, own_nodes
from hil.errors import BrakebenchError
from hil.rt.clock import cpu_time_ns, monotonic_ns
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from hil.validation.perf.cantools_codec import cantools_inside
from hil.validation.perf.row import Progress, Row, paired, unseen
from plant.node import PlantNode

SCENARIO = "stop72_blend70"
SIMULATED_S = 2.0
PAIRS = 9
BESIDE_PAIRS = 15
_PARTS: tuple[tuple[str, Any, str], ...] = (
    ("vehicle model", PlantNode, "_advance"),
    ("control law", ecu.node, "step"),
    ("send: encode, protect", Transmitter, "frames"),
    ("send: encode, protect", Batch, "frames"),
    ("receive: check, decode", Receiver, "accept"),
)


@dataclass(slots=True)
class Timing:
    """Microseconds of processor time for each 10 ms of simulated time: in all, and of each part."""

    whole_us: float
    parts_us: dict[str, float] = field(default_factory=dict)


def our_loop(until_ns: int) -> Iterator[Frame]:
    """Frames of the loop in lock-step."""
    for step in lockstep(_members()):
        if step.now_ns > until_ns:
            return
        yield from step.frames


def other_loop(until_ns: int) -> Iterator[Frame]:
    """Frames of the same loop over cantools and python-can."""
    with cantools_inside(), contextlib.ExitStack() as stack:
        everybody = _members()
        ports = [_port(stack) for _ in everybody]
        due = sorted(
            (m.phase_ns + k * m.period_ns, i) for i, m in enumerate(everybody) for k in range(_ticks(m, until_ns))
        )
        for now_ns, index in due:
            received = _receive(ports[index])
            frames = everybody[index].node.step(now_ns, received)
            for frame in frames:
                message = can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=False)
                ports[index][frame.bus].send(message)
            yield from frames


def _members() -> list[Member]:
    scenario = load_scenario(SCENARIO)
    scenario = replace(scenario, manoeuvre=replace(scenario.manoeuvre, wait_for_demands=False))
    return members(scenario, *own_nodes(scenario, 1), StimulusNode(scenario.blending, scenario.faults))


def _ticks(member: Member, until_ns: int) -> int:
    return (until_ns - member.phase_ns) // member.period_ns + 1


def _port(stack: contextlib.ExitStack) -> dict[BusName, can.BusABC]:
    return {
        bus: stack.enter_context(
            can.Bus(interface="virtual", channel=f"brakebench-perf-{bus}", preserve_timestamps=True)
        )
        for bus in BusName
    }


def _receive(port: dict[BusName, can.BusABC]) -> list[Received]:
    received: list[Received] = []
    for name, bus in port.items():
        while (message := bus.recv(0)) is not None:
            received.append(Frame(name, message.arbitration_id, bytes(message.data)))
    return received


def timed(loop: Callable[[int], Iterator[Frame]]) -> Timing:
    """Run a loop as it is for the whole, and once more with its parts under a clock for their shares."""
    whole = _run(loop, cpu_time_ns)
    spent = dict.fromkeys((name for name, _, _ in _PARTS), 0)
    with contextlib.ExitStack() as stack:
        for name, owner, attribute in _PARTS:
            stack.enter_context(_under_the_clock(owner, attribute, name, spent))
        clocked = _run(loop, monotonic_ns)
    whole_us = whole * 1e-3 / (SIMULATED_S * 100.0)
    parts = {name: whole_us * ns / clocked for name, ns in spent.items()}
    parts["nodes and transport"] = whole_us - sum(parts.values())
    return Timing(whole_us, parts)


def _run(loop: Callable[[int], Iterator[Frame]], clock_ns: Callable[[], int]) -> int:
    frames = loop(round(SIMULATED_S * 1e9))
    next(frames)  # by now everything is built
    begin = clock_ns()
    for _ in frames:
        pass
    return clock_ns() - begin


@contextlib.contextmanager
def _under_the_clock(owner: Any, attribute: str, name: str, spent: dict[str, int]) -> Iterator[None]:
    function = getattr(owner, attribute)

    def clocked(*arguments: Any, **more: Any) -> Any:
        begin = monotonic_ns()
        result = function(*arguments, **more)
        spent[name] += monotonic_ns() - begin
        return result

    setattr(owner, attribute, clocked)
    try:
        yield
    finally:
        setattr(owner, attribute, function)


def measure(progress: Progress = unseen) -> list[Row]:
    """Whole loop and parts, microseconds for 10 ms of simulated time; then the real-time factor."""
    for loop in (our_loop, other_loop):  # compile, load, fill caches
        for _ in loop(200_000_000):
            pass
    ours: list[Timing] = []
    theirs: list[Timing] = []
    for n in range(PAIRS):
        ours.append(timed(our_loop))
        theirs.append(timed(other_loop))
        progress((n + 1) / PAIRS)
    whole = _median([t.whole_us for t in ours])
    other_is = "the same loop over cantools and python-can's virtual bus"
    rows = [_row("closed loop, 10 ms", [t.whole_us for t in ours], [t.whole_us for t in theirs], other_is)]
    for name in ours[0].parts_us:
        mine = [t.parts_us[name] for t in ours]
        label = f"{name} ({_median(mine) / whole:.0%} of ours)"
        rows.append(_row(label, mine, [t.parts_us[name] for t in theirs], "the same part there"))
    factor = 1e4 / whole
    rows.append(Row("simulated time over time taken", factor, 1.0, "real time", factor, "s/s"))
    return rows


class _Checkout:
    """The loop of a checkout of the project, in a process of its own."""

    def __init__(self, folder: Path) -> None:
        if not (folder / "hil").is_dir():
            raise BrakebenchError(f"{folder}: expected a checkout of the project, found no folder hil in it")
        child = Path(__file__).with_name("loop_child.py")
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(child)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            cwd=folder, env=os.environ | {"PYTHONPATH": str(folder)},
        )  # fmt: skip
        found = self._answer()
        if Path(found) != folder:
            self.close()
            raise BrakebenchError(f"{folder}: its process ran the code of {found}")

    def _answer(self) -> str:
        assert self._process.stdout is not None
        answer = self._process.stdout.readline().strip()
        if not answer:
            self.close()
            raise BrakebenchError("the process of a checkout ended; what it said is above")
        return answer

    def per_tick_us(self) -> float:
        """Processor time of 10 ms of simulated time, us."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{round(SIMULATED_S * 100)}\n")
        self._process.stdin.flush()
        return float(self._answer())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def beside(folder: str) -> list[Row]:
    """The whole loop beside that of another checkout of the project; the two take turns, each in its own process."""
    with contextlib.ExitStack() as stack:
        pair = []
        for path in (Path(folder).resolve(), Path(__file__).resolve().parents[3]):
            pair.append(_Checkout(path))
            stack.callback(pair[-1].close)
        other, ours = pair
        name, other_is = "closed loop, 10 ms", f"the checkout in {folder}"
        return [paired(name, ours.per_tick_us, other.per_tick_us, other_is, "us", pairs=BESIDE_PAIRS)]


def _row(name: str, mine: Sequence[float], other: Sequence[float], other_is: str) -> Row:
    ratio = statistics.median(b / a for a, b in zip(mine, other, strict=True))
    return Row(name, _median(mine), _median(other), other_is, ratio, "us")


def _median(values: Sequence[float]) -> float:
    return float(statistics.median(values))
