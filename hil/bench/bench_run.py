"""A run of one scenario as transitions between named states; a broken run stays broken.

What carries it is left to `hil.bench.real` (processes on buses) and `hil.bench.virtual` (nodes in one process, in
virtual time); all else is the same.
"""

import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Self

from dbc.bench_messages import ManoeuvreState
from dbc.frame import BusName
from hil.bench.recorder import RecorderError
from hil.bench.stimulus import StimulusNode
from hil.bench.watch import Watch
from hil.errors import BrakebenchError, Verdict
from hil.faults.wire import Commands
from hil.rt.process import Child, StopSignal
from hil.scenario.scenario import Scenario

RECORDING = "recording.log"
HOLD_TIMEOUT_NS = 15_000_000_000
LOST_TIMEOUT_NS = 2_000_000_000  # without any word of the plant's motion no manoeuvre goes on
LOST = f"the plant said nothing of its motion for {LOST_TIMEOUT_NS * 1e-9:g} s"
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
    UNRECORDED = "unrecorded"  # the recording ended before the run did
    INTERRUPTED = "interrupted"


_UNDER_WAY = (ManoeuvreState.RUNNING, ManoeuvreState.FINISHED)  # not a value that the DBC reserves
_OVER = {BenchState.BROKEN, BenchState.UNRECORDED}


class BenchError(BrakebenchError):
    """The bench broke.

    Attributes
    ----------
    details : the traceback or the last words of what broke it, for people; may be empty.
    """

    exit_code = Verdict.BROKEN.exit_code

    def __init__(self, reason: str, details: str = "") -> None:
        super().__init__(f"{reason}\n{details}" if details else reason)
        self.reason, self.details = reason, details


class RecordingError(BenchError):
    """The recording cannot go on, and so the run does not."""

    exit_code = Verdict.INCOMPLETE.exit_code


class OutputError(BrakebenchError):
    """A folder that cannot take a run; said before anything is started."""


def prepare_folder(out: Path) -> None:
    """Make a folder for a run and see that it can be written.

    Raises
    ------
    OutputError : it cannot be, or it holds a recording already.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out) as probe:
            probe.write(b"brakebench")
    except OSError as error:
        raise OutputError(f"{out}: cannot be written ({error.strerror}); name another folder with --out") from error
    if (out / RECORDING).exists():
        raise OutputError(f"{out}: holds a {RECORDING} already, which is never overwritten; name another folder")


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
    watch : supervises what everybody sends.
    state, reason : where the run is, and why it is broken.
    error : what broke it, with its cause.
    spec, note : what carries it, and why that.
    bit_rate : of the vehicle bus, bit/s, where it is known not to be the database's.
    real_time : whether time passes by itself; else only in `tick`.
    log : the recording.
    processes, alive_at_end : recorder and nodes where they are processes; nodes that lived until asked to stop.
    """

    spec = ""
    note = ""
    bit_rate: int | None = None
    real_time = True

    def __init__(self, scenario: Scenario, out: Path, seed: int, say: Say, stop: StopSignal | None) -> None:
        self.scenario = scenario
        self.state = BenchState.NEW
        self.reason = ""
        self.error: BenchError | None = None
        self.out = out
        self.log = out / RECORDING
        self.alive_at_end = 0
        self.stimulus_node = StimulusNode(scenario.blending, scenario.faults, seed=seed)
        self.watch = Watch(say)
        self._commands = Commands()
        self.hold_timeout_ns = HOLD_TIMEOUT_NS
        self._seed = seed
        self._say = say
        self._stop_signal = stop
        self._second = -1
        self._left = False
        prepare_folder(out)

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
            self.state = BenchState.INTERRUPTED if self._asked_to_stop else BenchState.STARTED
        except (BenchError, RecorderError) as error:
            self._break(error)

    def tick(self) -> bool:
        """Let one period pass; False where the run is over."""
        if self.state not in (BenchState.STARTED, BenchState.DRIVING):
            return False
        if self._left:
            self.state = BenchState.FINISHED
            return False
        try:
            now_ns = self._pass_period()
            self.watch.hear(now_ns, self.stimulus_node.inbox)
            self._excuse_faults()
            self._follow(now_ns)
        except (BenchError, RecorderError) as error:
            self._break(error)
        return self.state in (BenchState.STARTED, BenchState.DRIVING)

    def _excuse_faults(self) -> None:
        """What armed faults disturb is no finding, whoever armed them: the bench, or somebody by hand."""
        node = self.stimulus_node
        for command in self._commands.read([*node.inbox, *node.sent]):
            if command.start is not None and command.start.target.can_ids:
                self.watch.excuse((BusName.VEHICLE, can_id) for can_id in command.start.target.can_ids)
            elif command.start is not None:
                self.watch.excuse()

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
        try:
            self._end()
        except RecorderError as error:
            self._break(error)

    @property
    def _asked_to_stop(self) -> bool:
        return self._stop_signal is not None and self._stop_signal.asked

    def _follow(self, now_ns: int) -> None:
        if self._asked_to_stop:
            self.state = BenchState.INTERRUPTED
            return
        motion = self.stimulus_node.motion
        if self.state is BenchState.STARTED:
            if motion is None or motion.manoeuvre not in _UNDER_WAY:
                if now_ns > self.hold_timeout_ns:
                    others = self.watch.others
                    why = f"; somebody else sends {', '.join(others)}" if others else ""
                    raise BenchError(f"the manoeuvre did not start: the plant never saw valid demands of an ECU{why}")
                return
            self.watch.begin()
        self.state = BenchState.FINISHED if self.stimulus_node.finished else BenchState.DRIVING
        if motion is None or (self.stimulus_node.motion_age_ns(now_ns) or 0) > LOST_TIMEOUT_NS:
            raise BenchError(LOST)
        if now_ns // 1_000_000_000 != self._second:
            self._second = now_ns // 1_000_000_000
            self._say(f"driving: {(motion.speed_mps or 0.0) * 3.6:5.1f} km/h, {motion.distance_m or 0.0:6.1f} m")

    def _break(self, error: BenchError | RecorderError) -> None:
        """Keep the first reason; a run that was interrupted stays so."""
        if self.state in _OVER or self.state is BenchState.INTERRUPTED:
            return
        if isinstance(error, RecorderError):
            reason, error = error, RecordingError(str(error))
            error.__cause__ = reason
        self.state = BenchState.UNRECORDED if isinstance(error, RecordingError) else BenchState.BROKEN
        self.reason, self.error = error.reason, error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
