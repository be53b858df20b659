"""A bench to be driven step by step: what a test, or a person at a prompt, does with a run."""

import contextlib
import json
import re
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from threading import Condition, Thread, current_thread, main_thread
from typing import Any, TypeVar

import numpy as np

from dbc.bench_messages import PhysicalFault
from dbc.contract import Message, spec_of
from dbc.frame import BusName, Frame, Node
from hil.bench import Bench
from hil.errors import BrakebenchError
from hil.result import RunResult, Signals, measure
from hil.rig import BenchError, BenchState, Rig
from hil.rt.clock import WallClock
from hil.run import Outcome, finish
from hil.scenario import FAULT_NAMES, Scenario, load_scenario
from hil.stimulus import ALL_WHEELS, WHEELS, Channel, Director, FaultEvent
from hil.virtual import VirtualBench

M = TypeVar("M", bound=Message)
MakeRig = Callable[[Scenario, Path, int, Mapping[str, Node]], Rig]
SPEED_UNITS = {"km/h": 1.0 / 3.6, "m/s": 1.0}
CRAWL_MPS = 1.0  # below it a stop ends: motors fade out, the car comes to rest
_SESSION = """title = {title}

[start]
speed_mps = {speed!r}

[end]
duration_s = 3600.0
after_standstill_s = false
"""


@contextlib.contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Note a Ctrl-C instead of raising it wherever it falls, so that a run ends between two ticks."""
    asked: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or current_thread() is not main_thread():
        yield asked
        return
    signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


class SessionError(BrakebenchError):
    """The bench was asked for something it cannot do; the message says what to do instead."""


def speed_of(speed: str | float) -> float:
    """Speed in m/s of a number (m/s) or of a text such as ``72 km/h``."""
    if isinstance(speed, str):
        found = re.fullmatch(r"\s*([0-9.]+)\s*(\S+)\s*", speed)
        if found is None or found[2] not in SPEED_UNITS:
            raise SessionError(f"speed {speed!r}: expected a number with {' or '.join(SPEED_UNITS)}, such as '72 km/h'")
        return float(found[1]) * SPEED_UNITS[found[2]]
    return float(speed)


def wheels_of(wheel: str | Iterable[str] | None) -> int:
    """Bits of one wheel, some, or (None) all."""
    if wheel is None:
        return ALL_WHEELS
    names = [wheel] if isinstance(wheel, str) else list(wheel)
    odd = [name for name in names if name not in WHEELS]
    if odd:
        raise SessionError(f"wheel {odd[0]!r}: expected {', '.join(WHEELS)}, a list of them, or None for all")
    return sum(1 << WHEELS.index(name) for name in set(names))


def virtual_rig(scenario: Scenario, folder: Path, seed: int, nodes: Mapping[str, Node]) -> Rig:
    """A rig in virtual time."""
    return VirtualBench(scenario, folder, seed, plant=nodes.get("plant"), ecu=nodes.get("ecu"))


def real_rig(bus: str, without: Sequence[str] = ()) -> MakeRig:
    """Rigs in real time on a bus; the nodes in ``without`` are somebody else's."""

    def make(scenario: Scenario, folder: Path, seed: int, nodes: Mapping[str, Node]) -> Rig:
        if nodes:
            raise SessionError("use: a node as an object runs in virtual time only; put a process on the bus instead")
        return Bench(scenario, bus, folder, seed, without=without, whole=True)

    return make


class Session:
    """One run under command.

    Commands given before the first `run` act at the start of the manoeuvre, later ones at once (after, at the next tick
    of 10 ms). In virtual time the car stands still between two calls; in real time it does not: use ``after``.

    Parameters
    ----------
    make_rig : builds the rig of a scenario: folder, seed, and objects in the places of nodes.
    folder : takes all files of the run.
    title : what the run is called in its report.
    limit_s : wall time that the session may take in all.

    Attributes
    ----------
    seed : of all noise; to be set before the first `run`.
    fault_s : manoeuvre time of the fault injected last, s.
    """

    def __init__(self, make_rig: MakeRig, folder: Path, title: str, limit_s: float = 120.0) -> None:
        self.seed = 1
        self.folder = folder
        self.fault_s: float | None = None
        self._make_rig = make_rig
        self._title = "".join(c if c.isprintable() else "?" for c in title)
        self._limit_s = limit_s
        self._deadline_ns = 0
        self._scenario: str | None = None
        self._speed_mps = 20.0
        self._nodes: dict[str, Node] = {}
        self._early: list[Callable[[Director], None]] = []
        self._rig: Rig | None = None
        self._thread: Thread | None = None
        self._ticked = Condition()
        self._error: BaseException | None = None
        self._last: dict[tuple[BusName, int], bytes] = {}
        self._counts: dict[tuple[BusName, int], int] = {}

    # before the start

    def load(self, scenario: str) -> None:
        """Take a scenario of the library, or a file, as the ground that the commands act on."""
        self._not_yet("load")
        self._scenario = scenario

    def use(self, *, plant: Node | None = None, ecu: Node | None = None) -> None:
        """Put an object of your own into the place of a node (virtual time only)."""
        self._not_yet("use")
        self._nodes = {name: node for name, node in (("plant", plant), ("ecu", ecu)) if node is not None}

    # stimulus

    def drive(self, speed: str | float) -> None:
        """Hold a speed while the pedal is free; before the start also the speed the car starts with."""
        mps = speed_of(speed)
        if self._rig is None:
            self._speed_mps = mps
        self._command(lambda d: d.move(Channel.SPEED, mps))

    def coast(self) -> None:
        """Hold no speed any longer."""
        self._command(lambda d: d.leave(Channel.SPEED))

    def pedal(self, travel: float, within: float = 0.3) -> None:
        """Bring the brake pedal to a travel, 0 to 1, within some seconds."""
        if not 0.0 <= travel <= 1.0:
            raise SessionError(f"pedal: expected a travel from 0 to 1, got {travel!r}")

        def press(director: Director) -> None:
            if director.value(Channel.PEDAL) is None:
                director.move(Channel.PEDAL, 0.0)
            director.move(Channel.PEDAL, travel, within)

        self._command(press)

    def steer(self, angle_rad: float, within: float = 0.3) -> None:
        """Bring the steering wheel to an angle, positive to the left."""

        def turn(director: Director) -> None:
            if director.value(Channel.STEERING) is None:
                director.move(Channel.STEERING, 0.0)
            director.move(Channel.STEERING, angle_rad, within)

        self._command(turn)

    def road(
        self,
        friction: float | None = None,
        *,
        left: float | None = None,
        right: float | None = None,
        grade: float | None = None,
    ) -> None:
        """Change the road under the car: friction scale of both sides or of one, and rise over run."""
        sides = (friction if left is None else left, friction if right is None else right)
        for channel, value in zip((Channel.FRICTION_LEFT, Channel.FRICTION_RIGHT), sides, strict=True):
            if value is not None:
                self._command(lambda d, c=channel, v=value: d.move(c, v))  # type: ignore[misc]
        if grade is not None:
            self._command(lambda d: d.move(Channel.GRADE, grade))

    def blend(self, factor: float) -> None:
        """Share of the braking that is asked of the motors, 0 to 1."""
        if not 0.0 <= factor <= 1.0:
            raise SessionError(f"blend: expected a factor from 0 to 1, got {factor!r}")
        self._command(lambda d: d.move(Channel.BLENDING, factor))

    def inject(self, fault: str, wheel: str | Iterable[str] | None = None, after: float = 0.0) -> None:
        """Break something of the car ``after`` seconds from now."""
        self.fault_s = self._plan(fault, wheel, after, active=True)

    def clear(self, fault: str, wheel: str | Iterable[str] | None = None, after: float = 0.0) -> None:
        """Mend what `inject` broke."""
        self._plan(fault, wheel, after, active=False)

    def _plan(self, fault: str, wheel: str | Iterable[str] | None, after: float, active: bool) -> float:
        if fault not in FAULT_NAMES:
            raise SessionError(f"fault {fault!r}: expected one of {', '.join(FAULT_NAMES)}")
        kind, wheels = PhysicalFault[fault.upper()], wheels_of(wheel)
        at_s = (0.0 if self._rig is None else self._rig.director.next_s) + after
        self._command(lambda d: d.plan(FaultEvent(at_s, kind, wheels, active)))
        return at_s

    def send(self, *frames: Frame) -> None:
        """Send frames of anybody, as they are, on the bus they name."""
        self._command(lambda d: d.also_send(frames))

    def _command(self, command: Callable[[Director], None]) -> None:
        if self._rig is None:
            self._early.append(command)
        else:
            command(self._rig.director)

    # time

    @property
    def time_s(self) -> float:
        """Manoeuvre time, s; 0 before the start."""
        return 0.0 if self._rig is None else self._rig.director.time_s or 0.0

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.time_s + seconds - 1e-9
        self._advance(lambda: self.time_s >= end)

    def run_until(self, condition: Callable[["Session"], bool], timeout: float = 60.0) -> None:
        """Let time pass until ``condition(bench)`` is true; an error when it is not within ``timeout`` (bench time)."""
        end = self.time_s + timeout

        def over() -> bool:
            if self._rig is not None and self._rig.director.time_s is not None and condition(self):
                return True
            if self.time_s >= end:
                name = getattr(condition, "__name__", "the condition")
                raise SessionError(f"{name} did not come true within {timeout:g} s of the manoeuvre")
            return False

        self._advance(over)

    def _advance(self, over: Callable[[], bool]) -> None:
        rig = self._begin()
        with _interrupts() as asked:
            while not over():
                if asked:
                    raise KeyboardInterrupt
                if self._clock_ns() > self._deadline_ns:
                    raise SessionError(
                        f"wall-time limit of {self._limit_s:g} s reached at {self.time_s:.2f} s of the manoeuvre; "
                        "raise it with --brakebench-limit"
                    )
                if self._thread is None:
                    self._tick(rig)
                else:
                    with self._ticked:
                        self._ticked.wait(0.1)
                if self._error is not None:
                    raise self._error
                if rig.state is BenchState.BROKEN:
                    raise BenchError(rig.reason)
                if rig.state is BenchState.FINISHED and not over():
                    raise SessionError(f"the scenario ended at {self.time_s:.2f} s, before what was waited for")

    def _tick(self, rig: Rig) -> bool:
        going = rig.tick()
        for item in rig.director.inbox:
            if isinstance(item, Frame) and not item.extended:
                key = (item.bus, item.can_id)
                self._last[key] = item.data
                self._counts[key] = self._counts.get(key, 0) + 1
        return going

    def _begin(self) -> Rig:
        if self._rig is not None:
            return self._rig
        self._deadline_ns = self._clock_ns() + round(self._limit_s * 1e9)
        self.folder.mkdir(parents=True, exist_ok=True)
        name = self._scenario
        if name is None:
            path = self.folder / "session.toml"
            path.write_text(
                _SESSION.format(title=json.dumps(self._title, ensure_ascii=False), speed=self._speed_mps),
                encoding="utf-8",
            )
            name = str(path)
        rig = self._make_rig(load_scenario(name), self.folder, self.seed, self._nodes)
        for command in self._early:
            command(rig.director)
        self._rig = rig
        rig.start()
        if rig.state is BenchState.BROKEN:
            raise BenchError(rig.reason)
        if not isinstance(rig, VirtualBench):
            self._thread = Thread(target=self._keep_ticking, args=(rig,), name="brakebench", daemon=True)
            self._thread.start()
        return rig

    def _keep_ticking(self, rig: Rig) -> None:
        try:
            going = True
            while going:
                going = self._tick(rig)
                with self._ticked:
                    self._ticked.notify_all()
        except BaseException as error:
            self._error = error

    # results

    @property
    def log(self) -> Path:
        """The recording so far."""
        rig = self._started()
        if isinstance(rig, VirtualBench):
            rig.flush()
        return rig.log

    @property
    def signals(self) -> Signals:
        """All signals recorded so far."""
        return Signals(self.log)

    @property
    def result(self) -> RunResult:
        """The numbers of the run so far."""
        return measure(self.signals)

    @property
    def speed_mps(self) -> float:
        """True speed of the car now."""
        motion = self._started().director.motion
        return 0.0 if motion is None else motion.speed_mps or 0.0

    def latest(self, message_type: type[M]) -> M | None:
        """Last frame of a message, decoded; None where none was seen. Its protection is not checked."""
        spec = spec_of(message_type)
        data = self._last.get((spec.bus, spec.can_id))
        return None if data is None or len(data) != spec.length else spec.decode(data)

    def count(self, message_type: type[Message]) -> int:
        """How many frames of a message were seen."""
        spec = spec_of(message_type)
        return self._counts.get((spec.bus, spec.can_id), 0)

    def deceleration_dip(self, after: float = 0.0) -> float:
        """How far the deceleration fell below the demanded one, at most, m/s2.

        Looked at from ``after`` seconds after the fault injected last (the start where there was none), as long as the
        car is faster than 1 m/s. Negative where it always was above.
        """
        from_s = (self.fault_s or 0.0) + after
        signals = self.signals
        t_s, speed = signals.get("TRUTH_MOTION.SPEED")
        _, acceleration = signals.get("TRUTH_MOTION.ACCELERATION")
        slow = t_s[(t_s > from_s) & (speed < CRAWL_MPS)]
        inside = (t_s >= from_s - 1e-9) & (t_s < (slow[0] if len(slow) else np.inf))
        t_demand, demand = signals.get("BRAKE_STATUS.DEMANDED_DECELERATION")
        if not inside.any() or not len(t_demand):
            raise SessionError(f"deceleration_dip: nothing recorded from {from_s:g} s on; run the bench past it first")
        held = demand[np.clip(np.searchsorted(t_demand, t_s[inside], "right") - 1, 0, None)]
        return float(np.max(held + acceleration[inside]))

    # the end

    def stop(self) -> None:
        """End nodes and recorder; harmless when called again."""
        if self._rig is not None:
            rig = self._rig
            if self._thread is not None:
                rig.leave()
                self._thread.join()
            rig.stop()

    def conclude(self, provenance: dict[str, Any], failure: str = "") -> Outcome | None:
        """Stop, measure, and write figure and report; None where nothing was started."""
        self.stop()
        return None if self._rig is None else finish(self._rig, self.seed, provenance, failure)

    @property
    def started(self) -> bool:
        """Whether the bench was brought to life."""
        return self._rig is not None

    def _started(self) -> Rig:
        if self._rig is None:
            raise SessionError("the bench has not run yet; call run() or run_until() first")
        return self._rig

    def _not_yet(self, what: str) -> None:
        if self._rig is not None:
            raise SessionError(f"{what}: the bench runs already; call it before run() and run_until()")

    @staticmethod
    def _clock_ns() -> int:
        return WallClock().now_ns()
