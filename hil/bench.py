"""The rig: one run of one scenario as transitions between named states; a broken rig stays broken."""

import contextlib
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Self

from dbc.bench_messages import EcuTiming, ManoeuvreState, PlantTiming, TruthMotion
from dbc.exchange import Receiver
from dbc.frame import BusName
from hil.bus.bus import Bus, open_bus
from hil.bus.channel import bench_channel, claim_channel
from hil.errors import BrakebenchError
from hil.process import Child, StopSignal, wait_for_end
from hil.rt.clock import WallClock
from hil.rt.loop import Loop

WATCH_PERIOD_NS = 20_000_000
READY_TIMEOUT_S = 120.0  # a first start compiles the plant
HOLD_TIMEOUT_NS = 15_000_000_000
SETTLE_NS = 500_000_000  # how long a bench keeps recording after a process died, so that the reaction is on record


class BenchState(StrEnum):
    """Where a run is."""

    NEW = "new"
    CLAIMED = "claimed"  # the channel is ours
    RECORDING = "recording"
    STARTED = "started"  # both nodes tick; the plant holds its initial state
    DRIVING = "driving"  # the manoeuvre runs
    FINISHED = "finished"
    BROKEN = "broken"
    INTERRUPTED = "interrupted"


class BenchError(BrakebenchError):
    """The bench broke."""

    exit_code = 3


class Bench:
    """Starts, watches and stops recorder, plant and ECU for one scenario.

    Parameters
    ----------
    scenario : path or name, as on the command line.
    bus : vehicle bus, or ``auto``.
    out : folder of the run; created.
    seed, realtime : as of the commands ``plant`` and ``ecu``.
    say : takes progress, one line at a time.

    Attributes
    ----------
    state, reason : where the run is, and why it is broken.
    spec, note : the vehicle bus taken, and why that one.
    log : the recording.
    alive_at_end : node processes that lived until they were asked to stop.
    """

    def __init__(
        self,
        scenario: str,
        bus: str,
        out: Path,
        seed: int = 1,
        realtime: bool = False,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.state = BenchState.NEW
        self.reason = ""
        self.out = out
        self.log = out / "recording.log"
        self._scenario = scenario
        self._node_options = ["--realtime"] if realtime else []
        self._seed = seed
        self._say = say
        self._stop = StopSignal()
        self._children: list[Child] = []
        self._stopped = False
        self.alive_at_end = 0
        self._stack = contextlib.ExitStack()
        self._claim = self._stack.enter_context(claim_channel(bus))
        self.spec, self.note = self._claim.spec, self._claim.note
        out.mkdir(parents=True, exist_ok=True)
        self.state = BenchState.CLAIMED

    @property
    def processes(self) -> tuple[Child, ...]:
        """The processes started so far: recorder, plant, ECU."""
        return tuple(self._children)

    def run(self) -> None:
        """Run the scenario to its end; ``state`` then says how it went."""
        with open_bus(bench_channel(self.spec), BusName.BENCH) as bus:
            try:
                self._start()
                self._watch(bus)
            except BenchError as error:
                self._break(str(error))
            finally:
                self._stop_all()
        if self.state is BenchState.DRIVING:
            self.state = BenchState.FINISHED

    def _start(self) -> None:
        self._spawn("recorder", ["record", str(self.log)])
        self._await_ready(self._children)
        self.state = BenchState.RECORDING
        self._say("starting plant and ECU (the first start on a machine compiles the plant: about 20 s)")
        self._spawn("plant", ["plant", self._scenario, "--seed", str(self._seed), *self._node_options])
        self._spawn("ecu", ["ecu", self._scenario, *self._node_options])
        self._await_ready(self._children[1:])
        self.state = BenchState.STARTED

    def _spawn(self, name: str, arguments: list[str]) -> None:
        words = self.out / f"{name}.txt"
        self._children.append(Child(name, [*arguments, "--bus", self.spec], words))

    def _await_ready(self, children: Sequence[Child]) -> None:
        """Wait until all are ready, then let all begin at once."""
        for child in children:
            if not child.wait_ready(READY_TIMEOUT_S):
                raise BenchError(f"did not start: {child.why()}; see {child.error_path.name}")
        for child in children:
            child.release()

    def _watch(self, bus: Bus) -> None:
        """Follow the plant's truth until the manoeuvre is over, a process dies, or somebody asks us to stop."""
        receiver = Receiver([TruthMotion, EcuTiming, PlantTiming])
        loop = Loop(WallClock(), WATCH_PERIOD_NS)
        until_ns = None
        second = -1
        for tick in loop.ticks():
            receiver.accept(tick.now_ns, bus.receive(0.0))
            motion = receiver.latest(TruthMotion)
            if self._stop.asked:
                self.state = BenchState.INTERRUPTED
                return
            dead = [child for child in self._children if child.ended]
            if dead and until_ns is None:
                self._break(f"{dead[0].why()}; see {dead[0].error_path.name}")
                until_ns = tick.now_ns + SETTLE_NS
            if until_ns is not None:
                if tick.now_ns >= until_ns:
                    return
                continue
            if motion is None or motion.manoeuvre is ManoeuvreState.HOLDING:
                if tick.now_ns > HOLD_TIMEOUT_NS:
                    raise BenchError("the manoeuvre did not start: the plant never saw valid demands of an ECU")
                continue
            self.state = BenchState.DRIVING
            if motion.manoeuvre is ManoeuvreState.FINISHED:
                return
            if tick.now_ns // 1_000_000_000 != second:
                second = tick.now_ns // 1_000_000_000
                self._say(f"driving: {(motion.speed_mps or 0.0) * 3.6:5.1f} km/h, {motion.distance_m or 0.0:6.1f} m")

    def _break(self, reason: str) -> None:
        self.state = BenchState.BROKEN
        self.reason = self.reason or reason

    def _stop_all(self) -> None:
        """Stop the nodes first, the recorder last; whoever fails to end well breaks the run."""
        nodes, recorder = self._children[1:], self._children[:1]
        if not self._stopped:
            self.alive_at_end = sum(not child.ended for child in nodes)
        self._stopped = True
        for group in (nodes, recorder):
            for child in group:
                child.ask_to_stop()
            wait_for_end(group)
            for child in group:
                child.stop()
        for child in self._children:
            if child.failed and self.state is not BenchState.BROKEN:
                self._break(child.why())
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop_all()
