"""The bench in real time: recorder, plant and ECU as processes on their buses."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dbc.frame import BusName, Frame, Received
from hil.bench.bench_run import BenchError, BenchRun, BenchState, RecordingError, Say, silent
from hil.bench.node_process import ECU, NODE_PERIOD_NS, PLANT, grants_in
from hil.bench.port import names_of, owned_by
from hil.bench.stimulus import BENCH_PHASE_NS
from hil.bus.bus import JOINABLE, Bus, BusError, parse_spec
from hil.bus.channel import bench_channel, claim_channel, shared_channel
from hil.bus.listen import refuse_others
from hil.bus.open import open_bus
from hil.bus.transmit import check_transmit
from hil.errors import in_words
from hil.rt.clock import WallClock
from hil.rt.loop import Loop, Tick
from hil.rt.process import Child, StopSignal, interrupts_held, wait_for_end
from hil.rt.realtime import realtime_refusal
from hil.scenario.scenario import Scenario

READY_TIMEOUT_NS = 120_000_000_000  # a first start compiles the plant
_LOOK_NS = 50_000_000  # how often a stop is looked at meanwhile
_TRACEBACK = "Traceback (most recent call last)"
RECORDER = "recorder"
VIEWER = "live"
OTHERS_TIMEOUT_NS = 120_000_000_000  # how long we wait for a node that somebody else starts
PAGE_TIMEOUT_NS = 30_000_000_000  # how long a run waits for somebody to open its live page: a stop takes 10 s
SETTLE_NS = 500_000_000  # how long a bench keeps recording after a process died, so that the reaction is on record
NODES = ("plant", "ecu")


class HeldWords:
    """Says lines, or keeps them while something else has the terminal."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._kept: list[str] | None = None

    def __call__(self, line: str) -> None:
        """Say a line, now or later."""
        if self._kept is None:
            self._say(line)
        else:
            self._kept.append(line)

    def hold(self) -> None:
        """Keep lines from now on."""
        self._kept = []

    def go_on(self) -> None:
        """Say what was kept, and lines as they come again."""
        kept, self._kept = self._kept, None
        for line in kept or ():
            self._say(line)


class RealBench(BenchRun):
    """Starts, watches and stops recorder, plant and ECU for one scenario.

    Parameters
    ----------
    scenario, out, seed, say, stop : as of `BenchRun`.
    bus : vehicle bus, or ``auto``.
    realtime : as of the commands ``plant`` and ``ecu``.
    without : nodes that somebody else puts on the bus: ``plant``, ``ecu``.
    transmit : whether a bus with hardware may be sent to; it is refused else.
    live : whether a page shows the run and commands it (`hil.live`).
    terminal : whether it is shown on standard error; what is to be said meanwhile follows when it has ended.

    Attributes
    ----------
    punctuality : what the nodes run with, for people; empty before they are started.

    Raises
    ------
    BrakebenchError : the channel is taken, the folder cannot be written.
    """

    def __init__(
        self,
        scenario: Scenario,
        bus: str,
        out: Path,
        seed: int = 1,
        realtime: bool = False,
        say: Say = silent,
        stop: StopSignal | None = None,
        without: Sequence[str] = (),
        transmit: bool = False,
        live: bool = False,
        terminal: bool = False,
    ) -> None:
        self._held = HeldWords(say)
        check_transmit(bus, transmit, "a run sends")
        with contextlib.ExitStack() as stack:
            claim = stack.enter_context(claim_channel(bus))
            super().__init__(scenario, out, seed, self._held, stop)
            self._stack = stack.pop_all()
        self.spec, self.note = claim.spec, claim.note
        self._joined = self.spec  # what recorder and nodes join
        self._sharer: list[Child] = []  # none, or the one that has the adapter
        self.state = BenchState.CLAIMED
        self._viewer: list[Child] = []  # none, or the one that serves the page: whatever becomes of it, the run goes on
        self._live = live
        self._terminal = terminal
        self._realtime = realtime
        self._node_options = ["--transmit", *(["--realtime"] if realtime else [])]
        self._without = frozenset(without)
        self.punctuality = ""
        self._children: list[Child] = []
        self._buses: dict[BusName, Bus] = {}
        self._ticks: Iterator[Tick] = iter(())
        self._waiting: list[tuple[int, Child]] = []
        self._stopped = False
        if self._without:
            self.hold_timeout_ns = OTHERS_TIMEOUT_NS

    @property
    def processes(self) -> tuple[Child, ...]:
        """The processes started so far: recorder, plant, ECU, and who has the adapter."""
        return (*self._children, *self._sharer)

    def _begin(self) -> None:
        try:
            if parse_spec(self.spec).kind not in JOINABLE and not self._share():
                return
            self._join(BusName.BENCH, bench_channel(self.spec))
            self._join(BusName.VEHICLE, self._joined)
            self._listen()
        except BusError:  # wrong use: nothing was begun, nothing is left
            for child in self._sharer:
                child.stop()
                child.error_path.unlink(missing_ok=True)
            self._sharer.clear()
            raise
        self._spawn(RECORDER, ["record", str(self.log)], self._children, self._joined)
        if not self._await_ready(self._children):
            return
        self._children[0].release()
        self.state = BenchState.RECORDING
        self._say("starting plant and ECU (the first start on a machine compiles the plant: some 15 s)")
        order = {"plant": self.scenario.start_order.plant_s, "ecu": self.scenario.start_order.ecu_s}
        for name in NODES:
            if name in self._without:
                self._say(f"waiting for somebody's {name} on {self.spec}")
                continue
            words = [name, self.scenario.source, "--seed", str(self._seed), *self._node_options]
            self._spawn(name, words, self._children, self._joined)
            self._waiting.append((round(order[name] * 1e9), self._children[-1]))
        if not self._await_ready(self._children[1:]) or (self._live and not self._open_page()):
            return
        if self._terminal and not self._open_terminal():
            return
        self.punctuality = self._granted()
        self._say(self.punctuality)
        self._release(0)
        self._ticks = Loop(WallClock(), NODE_PERIOD_NS, BENCH_PHASE_NS).ticks()

    def _share(self) -> bool:
        """Have a process of its own open the adapter; False where somebody asks to stop before."""
        self._spawn("adapter", ["share", *self._node_options], self._sharer, self.spec)
        child = self._sharer[0]
        deadline_ns = WallClock().now_ns() + READY_TIMEOUT_NS
        while not child.wait_ready(_LOOK_NS * 1e-9):
            if self._asked_to_stop:
                return False
            if child.ended or WallClock().now_ns() > deadline_ns:
                raise BusError(child.last_words() or child.why())
        child.release()
        self._joined = shared_channel(self.spec)
        self._say(f"one process has the adapter; it is shared on {self._joined}")
        return True

    def _open_page(self) -> bool:
        """Have a process of its own serve the live page; False where somebody asks to stop before."""
        words = self.out / f"{VIEWER}.txt"
        words.touch(0o600)  # it holds the page's token, which is for nobody else on this machine
        wait_s = f"{PAGE_TIMEOUT_NS * 1e-9:g}"
        arguments = ["watch", "--scenario", self.scenario.source, "--wait", wait_s]
        self._spawn(VIEWER, arguments, self._viewer, self._joined)
        told = False

        def tell() -> None:
            nonlocal told
            if not told and (text := words.read_text()).endswith("\n"):
                self._say(f"live page: {text.strip()}\nthe run begins once it is open, or after {wait_s} s")
                told = True

        if not self._await_ready(self._viewer, tell):
            return False
        tell()
        self._viewer[0].release()
        return True

    def _open_terminal(self) -> bool:
        """Have a process of its own draw the run on standard error; False where somebody asks to stop before."""
        arguments = ["watch", "--terminal", "--scenario", self.scenario.source]
        self._held.hold()
        self._spawn(VIEWER, arguments, self._viewer, self._joined, output=2)
        if not self._await_ready(self._viewer):
            return False
        self._viewer[0].release()
        return True

    def _listen(self) -> None:
        """Refuse a bus on which somebody sends what is ours to send."""
        senders = [sender for role in (PLANT, ECU) if role.name not in self._without for sender in role.senders]
        refuse_others(
            [self._buses[BusName.VEHICLE], self._buses[BusName.BENCH]],
            names_of(owned_by([*senders, "BENCH"])),
            lambda: self._asked_to_stop,
            "this run",
            "leave its place free with --without",
        )

    def _granted(self) -> str:
        """What the nodes run with, for people."""
        if not self._realtime:
            if not realtime_refusal():
                return "scheduled as any program: --realtime is recommended, this process may have SCHED_FIFO"
            return "scheduled as any program: --realtime asks for more, `brakebench doctor` says what it would get"
        return f"real time: {grants_in(child.error_path.read_text() for child in self._children[1:])}"

    def _join(self, name: BusName, spec: str) -> None:
        self._buses[name] = self._stack.enter_context(open_bus(spec, name))

    def _spawn(self, name: str, arguments: list[str], into: list[Child], spec: str, output: int | None = None) -> None:
        words = self.out / f"{name}.txt"
        try:
            with interrupts_held():  # else a process could be started that nobody ends
                into.append(Child(name, [*arguments, "--bus", spec], words, output))
        except OSError as error:
            raise BenchError(f"{name} cannot be started: {in_words(error)}") from error

    def _await_ready(self, children: Sequence[Child], meanwhile: Callable[[], None] = lambda: None) -> bool:
        """Wait until all are ready; False where somebody asks to stop before."""
        deadline_ns = WallClock().now_ns() + READY_TIMEOUT_NS
        for child in children:
            while not child.wait_ready(_LOOK_NS * 1e-9):
                if self._asked_to_stop:
                    return False
                meanwhile()
                for bus in self._buses.values():  # what comes before the start is of no use, and must not pile up
                    bus.receive(0.0)
                if child.ended or WallClock().now_ns() > deadline_ns:
                    raise self._fallen(child, "did not start: ")
        return True

    def _fallen(self, child: Child, what: str = "") -> BenchError:
        """The error of a process that is gone, with its traceback where it left one."""
        kind = RecordingError if child.name == RECORDER else BenchError
        words = child.error_path.read_text(errors="replace")
        trace = words[words.rfind(_TRACEBACK) :].rstrip() if _TRACEBACK in words else ""
        return kind(f"{what}{child.why()}; see {child.error_path.name}", trace)

    def _release(self, now_ns: int) -> None:
        """Let the nodes begin whose time has come."""
        for due_ns, child in self._waiting:
            if due_ns <= now_ns:
                child.release()
        self._waiting = [(due_ns, child) for due_ns, child in self._waiting if due_ns > now_ns]

    def _pass_period(self) -> int:
        now_ns = self._direct()
        dead = [child for child in self.processes if child.ended]
        if dead:
            while self._direct() < now_ns + SETTLE_NS:
                pass
            raise self._fallen(dead[0])
        return now_ns

    def _direct(self) -> int:
        """One tick of the stimulus node; its time, ns."""
        tick = next(self._ticks)
        self._release(tick.now_ns)
        received: list[Received] = [item for bus in self._buses.values() for item in bus.receive(0.0)]
        if self._live:
            self.stimulus_node.give_way(tick.now_ns, received)
        frames: list[Frame] = self.stimulus_node.step(tick.now_ns, received)
        for name, bus in self._buses.items():
            mine = [frame for frame in frames if frame.bus is name]
            if mine:
                bus.send(mine)
        return tick.now_ns

    def _end(self) -> None:
        """Stop the nodes first, the recorder last; whoever fails to end well breaks the run."""
        nodes, recorder = self._children[1:], self._children[:1]
        if not self._stopped:
            self.alive_at_end = sum(not child.ended for child in nodes)
        self._stopped = True
        waiting, self._waiting = self._waiting, []
        for _, child in waiting:  # who waits for its release does not hear us
            child.release()
        for group in (nodes, self._viewer, recorder, self._sharer):
            for child in group:
                child.ask_to_stop()
            wait_for_end(group)
            for child in group:
                child.stop()
        self._held.go_on()
        for child in self.processes:
            if child.failed:
                self._break(self._fallen(child))
        self._stack.close()
