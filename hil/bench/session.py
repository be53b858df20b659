"""A bench to be driven step by step: what a test, or a person at a prompt, does with a run."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Condition, Thread
from typing import Any

from dbc.frame import Node
from hil.bench.bench_run import BenchRun, BenchState, prepare_folder
from hil.bench.controls import SessionError
from hil.bench.monitor import RunMonitor
from hil.bench.real import RealBench
from hil.bench.run import Outcome, finish
from hil.bench.virtual import VirtualBench
from hil.bench.watch import Finding
from hil.rt.clock import WallClock
from hil.rt.process import interrupts_held
from hil.scenario.scenario import Scenario, load_scenario

MakeBenchRun = Callable[[Scenario, Path, int, Mapping[str, Node]], BenchRun]
_SESSION = """title = {title}

[start]
speed_mps = {speed!r}

[end]
duration_s = 3600.0
after_standstill_s = false
"""


def virtual_run(scenario: Scenario, folder: Path, seed: int, nodes: Mapping[str, Node]) -> BenchRun:
    """A run in virtual time."""
    return VirtualBench(scenario, folder, seed, plant=nodes.get("plant"), ecu=nodes.get("ecu"))


def real_run(bus: str, without: Sequence[str] = (), realtime: bool = False, transmit: bool = False) -> MakeBenchRun:
    """Rigs in real time on a bus; the nodes in ``without`` are somebody else's; the rest as of `RealBench`."""

    def make(scenario: Scenario, folder: Path, seed: int, nodes: Mapping[str, Node]) -> BenchRun:
        if nodes:
            raise SessionError("use: a node as an object runs in virtual time only; put a process on the bus instead")
        return RealBench(scenario, bus, folder, seed, realtime, without=without, transmit=transmit)

    return make


class Session(RunMonitor):
    """One run under command.

    Commands given before the first `run` act at the start of the manoeuvre, later ones at once (after, at the next tick
    of 10 ms). In virtual time the car stands still between two calls; in real time it does not: use ``after``.

    Parameters
    ----------
    make_run : builds the run of a scenario: folder, seed, and objects in the places of nodes.
    folder : takes all files of the run.
    title : what the run is called in its report.
    limit_s : wall time that the session may take in all.

    Attributes
    ----------
    seed : of all noise; to be set before the first `run`.
    """

    def __init__(self, make_run: MakeBenchRun, folder: Path, title: str, limit_s: float = 120.0) -> None:
        super().__init__()
        self.seed = 1
        self.folder = folder
        self._make_run = make_run
        self._title = "".join(c if c.isprintable() else "?" for c in title)
        self._limit_s = limit_s
        self._deadline_ns = 0
        self._scenario: str | None = None
        self._nodes: dict[str, Node] = {}
        self._thread: Thread | None = None
        self._ticked = Condition()
        self._error: BaseException | None = None

    # before the start

    def load(self, scenario: str) -> None:
        """Take a scenario of the library, or a file, as the ground that the commands act on."""
        self._not_yet("load")
        self._scenario = scenario

    def use(self, *, plant: Node | None = None, ecu: Node | None = None) -> None:
        """Put an object of your own into the place of a node (virtual time only)."""
        self._not_yet("use")
        self._nodes = {name: node for name, node in (("plant", plant), ("ecu", ecu)) if node is not None}

    def _not_yet(self, what: str) -> None:
        if self.started:
            raise SessionError(f"{what}: the bench runs already; call it before run() and run_until()")

    # time

    @property
    def time_s(self) -> float:
        """Manoeuvre time, s; 0 before the start."""
        return 0.0 if self._bench_run is None else self._bench_run.stimulus_node.time_s or 0.0

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.time_s + seconds - 1e-9
        self._advance(lambda: self.time_s >= end)

    def run_until(self, condition: Callable[["Session"], bool], timeout: float = 60.0) -> None:
        """Let time pass until ``condition(bench)`` is true; an error when it is not within ``timeout`` (bench time)."""
        end = self.time_s + timeout

        def over() -> bool:
            if self._bench_run is not None and self._bench_run.stimulus_node.time_s is not None and condition(self):
                return True
            if self.time_s >= end:
                name = getattr(condition, "__name__", "the condition")
                raise SessionError(f"{name} did not come true within {timeout:g} s of the manoeuvre")
            return False

        self._advance(over)

    def _advance(self, over: Callable[[], bool]) -> None:
        bench_run = self._begin()
        while not over():
            if WallClock().now_ns() > self._deadline_ns:
                raise SessionError(
                    f"wall-time limit of {self._limit_s:g} s reached at {self.time_s:.2f} s of the manoeuvre; "
                    "raise it with --brakebench-limit"
                )
            if self._thread is None:
                with interrupts_held():  # a run ends between two ticks
                    self._tick(bench_run)
            else:
                with self._ticked:
                    self._ticked.wait(0.1)
            if self._error is not None:
                raise self._error
            self._raise_what_broke(bench_run)
            if bench_run.state is BenchState.FINISHED and not over():
                raise SessionError(f"the scenario ended at {self.time_s:.2f} s, before what was waited for")

    def _raise_what_broke(self, bench_run: BenchRun) -> None:
        """Raise what ended the run, on top of what caused it."""
        if bench_run.error is not None:
            raise type(bench_run.error)(bench_run.error.reason, bench_run.error.details) from bench_run.error.__cause__

    def _tick(self, bench_run: BenchRun) -> bool:
        going = bench_run.tick()
        self._listen(bench_run)
        return going

    # the start

    def _begin(self) -> BenchRun:
        if self._bench_run is not None:
            return self._bench_run
        self._deadline_ns = WallClock().now_ns() + round(self._limit_s * 1e9)
        prepare_folder(self.folder)
        bench_run = self._make_run(
            load_scenario(self._scenario or self._own_scenario()), self.folder, self.seed, self._nodes
        )
        self._take(bench_run.stimulus_node)
        self._bench_run = bench_run
        bench_run.start()
        self._raise_what_broke(bench_run)
        if bench_run.real_time:
            self._thread = Thread(target=self._keep_ticking, args=(bench_run,), name="brakebench", daemon=True)
            self._thread.start()
        return bench_run

    def _own_scenario(self) -> str:
        """File of a scenario in which nothing happens but what is commanded."""
        path = self.folder / "session.toml"
        title = json.dumps(self._title, ensure_ascii=False)
        path.write_text(_SESSION.format(title=title, speed=self._first_speed_mps), encoding="utf-8")
        return str(path)

    def _keep_ticking(self, bench_run: BenchRun) -> None:
        try:
            going = True
            while going:
                going = self._tick(bench_run)
                with self._ticked:
                    self._ticked.notify_all()
        except BaseException as error:
            self._error = error

    # the end

    @property
    def findings(self) -> list[Finding]:
        """What speaks against a run in real time so far: silence, overruns, other senders (`hil.bench.watch`).

        None in virtual time, where objects of the test's own do what the test wants.
        """
        return self._bench_run.watch.findings() if self._bench_run is not None and self._bench_run.real_time else []

    @property
    def punctuality(self) -> str:
        """What the nodes of a run in real time run with, for people; empty where there are none."""
        return self._bench_run.punctuality if isinstance(self._bench_run, RealBench) else ""

    def stop(self) -> None:
        """End nodes and recorder; harmless when called again."""
        if self._bench_run is not None:
            bench_run = self._bench_run
            if self._thread is not None:
                bench_run.leave()
                self._thread.join()
            bench_run.stop()

    def conclude(self, provenance: dict[str, Any], failure: str = "") -> Outcome | None:
        """Stop, measure, and write figure and report; None where nothing was started."""
        self.stop()
        return None if self._bench_run is None else finish(self._bench_run, self.seed, provenance, failure)
