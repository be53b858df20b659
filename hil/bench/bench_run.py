"""A run of one scenario as transitions between named states; a broken run stays broken.

What carries it is left to `hil.bench.real` (processes on buses) and `hil.bench.virtual` (nodes in one process, in
virtual time); all else is the same.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Self

from dbc.bench_messages import ManoeuvreState
from hil.bench.stimulus import StimulusNode
from hil.errors import BrakebenchError
from hil.rt.process import Child, StopSignal
from hil.scenario.scenario import Scenario

HOLD_TIMEOUT_NS = 15_000_000_000
Say = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing."""


class BenchState(StrEnum):
    """Where a run is."""

    NEW = "new"
    CLAIMED = "claimed"  # the channel is ours
    RECORDING = "recording"
    STARTED = "started"  # the nodes tick; the plant holds its initial state
    DRIVING = "driving"  # the manoeuvre runs
    FINISHED = "finished"
    BROKEN = "broken"
    INTERRUPTED = "interrupted"


class BenchError(BrakebenchError):
    """The bench broke."""

    exit_code = 3


class BenchRun(ABC):
    """One run of one scenario.

    Parameters
    ----------
    scenario : what to drive.
    out : folder of the run; created.
    seed : of all noise.
    say : takes progress, one line at a time.
    stop : says when somebody asks to stop; None where nobody can.

    Attributes
    ----------
    stimulus_node : the bench's own node.
    state, reason : where the run is, and why it is broken.
    spec, note : what carries it, and why that.
    real_time : whether time passes by itself; else only in `tick`.
    log : the recording.
    processes, alive_at_end : recorder and nodes where they are processes; nodes that lived until asked to stop.
    """

    spec = ""
    note = ""
    real_time = True

    def __init__(self, scenario: Scenario, out: Path, seed: int, say: Say, stop: StopSignal | None) -> None:
        self.scenario = scenario
        self.state = BenchState.NEW
        self.reason = ""
        self.out = out
        self.log = out / "recording.log"
        self.alive_at_end = 0
        self.stimulus_node = StimulusNode(scenario.blending, scenario.faults, seed=seed)
        self.hold_timeout_ns = HOLD_TIMEOUT_NS
        self._seed = seed
        self._say = say
        self._stop_signal = stop
        self._second = -1
        self._left = False
        out.mkdir(parents=True, exist_ok=True)

    @property
    def processes(self) -> tuple[Child, ...]:
        """The processes started so far."""
        return ()

    def flush(self) -> None:  # noqa: B027 - a recorder of its own process does so by itself
        """Bring the recording up to now."""

    @abstractmethod
    def _begin(self) -> None:
        """Bring recorder and nodes to life, or raise `BenchError`."""

    @abstractmethod
    def _pass_period(self) -> int:
        """Let one period of the stimulus node pass; its time, ns. Raises `BenchError` where the bench broke."""

    @abstractmethod
    def _end(self) -> None:
        """End everything that `_begin` began; called once or more."""

    def start(self) -> None:
        """Bring the bench to life; `state` says whether that went well."""
        try:
            self._begin()
            self.state = BenchState.STARTED
        except BenchError as error:
            self._break(str(error))

    def tick(self) -> bool:
        """Let one period pass; False where the run is over."""
        if self.state not in (BenchState.STARTED, BenchState.DRIVING):
            return False
        if self._left:
            self.state = BenchState.FINISHED
            return False
        try:
            now_ns = self._pass_period()
            self._follow(now_ns)
        except BenchError as error:
            self._break(str(error))
        return self.state in (BenchState.STARTED, BenchState.DRIVING)

    def leave(self) -> None:
        """Let the run be over at the next tick, whatever the manoeuvre; may come from another thread."""
        self._left = True

    def run(self) -> None:
        """Run the scenario to its end; ``state`` then says how it went."""
        try:
            self.start()
            while self.tick():
                pass
        finally:
            self.stop()

    def stop(self) -> None:
        """End everything; harmless when called again."""
        self._end()

    def _follow(self, now_ns: int) -> None:
        if self._stop_signal is not None and self._stop_signal.asked:
            self.state = BenchState.INTERRUPTED
            return
        motion = self.stimulus_node.motion
        if motion is None or motion.manoeuvre is ManoeuvreState.HOLDING:
            if now_ns > self.hold_timeout_ns:
                raise BenchError("the manoeuvre did not start: the plant never saw valid demands of an ECU")
            return
        self.state = BenchState.FINISHED if self.stimulus_node.finished else BenchState.DRIVING
        if now_ns // 1_000_000_000 != self._second:
            self._second = now_ns // 1_000_000_000
            self._say(f"driving: {(motion.speed_mps or 0.0) * 3.6:5.1f} km/h, {motion.distance_m or 0.0:6.1f} m")

    def _break(self, reason: str) -> None:
        self.state = BenchState.BROKEN
        self.reason = self.reason or reason

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
