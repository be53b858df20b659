"""The bench in virtual time: the same nodes, codec and protection in one process, as fast as the machine goes."""

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame, Node, Received
from ecu.node import EcuNode
from hil.bench.bench_run import (
    HOLD_TIMEOUT_NS,
    LOST,
    LOST_TIMEOUT_NS,
    BenchError,
    BenchRun,
    BenchState,
    Say,
    silent,
)
from hil.bench.node_process import ECU, NODE_PERIOD_NS, PLANT, Role
from hil.bench.port import OwnedNode
from hil.bench.recorder import Recorder
from hil.bench.result import Signals
from hil.bench.stimulus import BENCH_PHASE_NS, StimulusNode
from hil.bus.timed.line import TimedLine
from hil.faults.fault import Injection
from hil.faults.line import FaultyNode
from hil.log.frames import FrameTable, Recording
from hil.rt.lockstep import Member, Step, lockstep
from hil.rt.process import StopSignal
from hil.scenario.scenario import Scenario
from plant.node import PlantNode

SPEC = "virtual"
_STIMULUS_NODE = 2
_FLUSH_TICKS = 500


def own_nodes(scenario: Scenario, seed: int) -> tuple[Node, Node]:
    """Our plant and our controller for a scenario."""
    plant = PlantNode(scenario.plant, scenario.manoeuvre, seed, NODE_PERIOD_NS, **scenario.effects.for_node())
    return plant, EcuNode(scenario.ecu, NODE_PERIOD_NS)


def members(scenario: Scenario, plant: Node, ecu: Node, stimulus_node: StimulusNode) -> list[Member]:
    """Plant, controller and bench, each at the phase it has in real time; faults that are armed meet their frames."""
    order = scenario.start_order
    plant = FaultyNode(plant, PLANT.senders, stimulus_node)
    ecu = FaultyNode(ecu, ECU.senders, stimulus_node)
    return [
        Member(plant, NODE_PERIOD_NS, PLANT.phase_ns + round(order.plant_s * 1e9)),
        Member(ecu, NODE_PERIOD_NS, ECU.phase_ns + round(order.ecu_s * 1e9)),
        Member(stimulus_node, NODE_PERIOD_NS, BENCH_PHASE_NS),
    ]


def simulate(
    scenario: Scenario,
    seed: int = 1,
    *,
    plant: Node | None = None,
    ecu: Node | None = None,
    faults: Sequence[Injection] = (),
    each_tick: Callable[[Step], None] | None = None,
    line: TimedLine | None = None,
) -> Signals:
    """Run a scenario to its end without any file, and return what a recording of both buses would hold.

    Parameters
    ----------
    seed : of all noise.
    plant, ecu : nodes in the places of our own.
    faults : beside the scenario's.
    each_tick : sees every step: member 0 the plant, 1 the controller, 2 the bench.
    line : a timed vehicle bus; None: frames arrive at once.

    Raises
    ------
    BenchError
        The manoeuvre did not start within 15 s of virtual time, or the plant fell silent for 2 s.
    """
    own_plant, own_ecu = own_nodes(scenario, seed)
    stimulus_node = StimulusNode(scenario.blending, (*scenario.faults, *faults), seed=seed)
    frames: list[Frame] = []
    times: list[int] = []
    taking_part = members(scenario, plant or own_plant, ecu or own_ecu, stimulus_node)
    with _no_collection():
        for step in lockstep(taking_part) if line is None else line.lockstep(taking_part, (_STIMULUS_NODE,)):
            if line is None:
                frames += step.frames
                times += [step.now_ns] * len(step.frames)
            else:
                heard = [one for one in line.heard() if isinstance(one, Frame)]
                frames += heard
                times += [frame.time_ns for frame in heard]
            if each_tick is not None:
                each_tick(step)
            if step.member == _STIMULUS_NODE:
                if stimulus_node.finished:
                    break
                if stimulus_node.time_s is None and step.now_ns > HOLD_TIMEOUT_NS:
                    raise BenchError("the manoeuvre did not start: the plant never saw valid demands of an ECU")
                if (stimulus_node.motion_age_ns(step.now_ns) or 0) > LOST_TIMEOUT_NS:
                    raise BenchError(LOST)
    return Signals(Recording(Path(scenario.name), SPEC, frame_table(frames, times)))


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without the collection of cyclic garbage: a run makes next to none, and it would look through all frames."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


def frame_table(frames: Sequence[Frame], times_ns: Sequence[int]) -> FrameTable:
    """Frames as columns."""
    names = tuple(BusName)
    table = FrameTable.empty(len(frames), channels=tuple(name.value for name in names))
    table.time_ns[:] = times_ns
    table.channel[:] = [names.index(frame.bus) for frame in frames]
    table.can_id[:] = [frame.can_id for frame in frames]
    table.extended[:] = [frame.extended for frame in frames]
    table.length[:] = [len(frame.data) for frame in frames]
    data = b"".join([frame.data.ljust(8, b"\0") for frame in frames])
    table.data[:] = np.frombuffer(data, np.uint8).reshape(-1, 8)
    return table


class _Process:
    """A node with what its process adds in real time: it owns its identifiers, and reports its ticks (never late)."""

    def __init__(self, role: Role, node: Node) -> None:
        self._role = role
        self._node = OwnedNode(node, role.senders)
        self._health = Transmitter()
        self._tick = 0

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        try:
            frames = list(self._node.step(now_ns, inbox))
        except Exception as error:
            raise BenchError(
                f"{self._role.name} raised {type(error).__name__} at {now_ns * 1e-9:.3f} s: {error}"
            ) from error
        frames += self._health.frames(now_ns, [self._role.timing(self._tick & 0xFFFFFF, 0.0, 0)])
        self._tick += 1
        return frames


class _Tap:
    """What the recorder hears of the nodes."""

    def __init__(self) -> None:
        self.heard: list[Received] = []

    def receive(self, _timeout_s: float) -> list[Received]:
        heard, self.heard = self.heard, []
        return heard


class VirtualBench(BenchRun):
    """Steps recorder, plant, ECU and bench in one process; its recording is the same, byte for byte, each time.

    Parameters
    ----------
    scenario, out, seed, say, stop : as of `BenchRun`.
    plant, ecu : nodes in the places of our own.
    line : a timed vehicle bus; None: frames arrive at once.
    """

    spec = SPEC
    note = "as fast as it goes"
    real_time = False

    def __init__(
        self,
        scenario: Scenario,
        out: Path,
        seed: int = 1,
        say: Say = silent,
        stop: StopSignal | None = None,
        plant: Node | None = None,
        ecu: Node | None = None,
        line: TimedLine | None = None,
    ) -> None:
        super().__init__(scenario, out, seed, say, stop)
        self._line = line
        if line is not None:
            self.spec, self.note, self.bit_rate = line.spec, line.note, line.bus.bit_rate
        self._nodes = (plant, ecu)
        self._tap = _Tap()
        self._recorder: Recorder | None = None
        self._steps: Iterator[Step] = iter(())
        self._ticks = 0

    def _begin(self) -> None:
        self._recorder = Recorder(self.log, [self._tap], epoch_ns=0)
        self.state = BenchState.RECORDING
        plant, ecu = (
            given or own for given, own in zip(self._nodes, own_nodes(self.scenario, self._seed), strict=True)
        )
        taking_part = members(self.scenario, _Process(PLANT, plant), _Process(ECU, ecu), self.stimulus_node)
        self._steps = (
            lockstep(taking_part) if self._line is None else self._line.lockstep(taking_part, (_STIMULUS_NODE,))
        )
        self.alive_at_end = 2

    def _pass_period(self) -> int:
        for step in self._steps:
            self._tap.heard += step.stamped() if self._line is None else self._line.heard()
            if step.member == _STIMULUS_NODE:
                break
        self._ticks += 1
        if self._ticks % _FLUSH_TICKS == 0:
            self.flush()
        return step.now_ns

    def flush(self) -> None:
        """Bring the recording up to now."""
        if self._recorder is not None:
            self._recorder.flush()

    def _end(self) -> None:
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None
