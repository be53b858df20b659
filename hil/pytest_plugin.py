"""The bench as pytest fixtures: tests that read like the requirement, in virtual or real time, or against hardware.

    from hil.pytest_plugin import stopped

    def test_motor_loss(bench):
        bench.blend(0.7)
        bench.drive("72 km/h")
        bench.pedal(0.6)
        bench.inject("motor_dead", wheel="fl", after=1.0)
        bench.run_until(stopped)
        assert bench.deceleration_dip(after=0.15) < 0.3

Everything heavy is imported when a test first asks for a bench: every pytest run of the environment loads this file.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from dbc.contract import Message
    from dbc.frame import Frame
    from hil.bench.result import Floats, Signals
    from hil.bench.session import Session

STOPPED_MPS = 0.05
_SESSION: "pytest.StashKey[Session]" = pytest.StashKey()
_OPEN: "pytest.StashKey[list[Session]]" = pytest.StashKey()
_REQUIREMENT = "requirement"
_VERDICT, _PUNCTUALITY = "brakebench verdict", "brakebench real time"
_SHOWN = (("log", "recording"), ("figure", "figure"), ("page", "report"))


def stopped(bench: "Session") -> bool:
    """Whether the car stands: for ``bench.run_until(stopped)``."""
    return abs(bench.speed_mps) < STOPPED_MPS


class BusAccess:
    """Fixture ``bus``: frames on the test's bench."""

    def __init__(self, bench: "Session") -> None:
        self._bench = bench

    def latest(self, message_type: "type[Message]") -> Any:
        """Last frame of a message, decoded; None where none was seen."""
        return self._bench.latest(message_type)

    def count(self, message_type: "type[Message]") -> int:
        """How many frames of a message were seen."""
        return self._bench.count(message_type)

    def send(self, *frames: "Frame") -> None:
        """Send frames of anybody, as they are, on the bus they name."""
        self._bench.send(*frames)


class ClockAccess:
    """Fixture ``clock``: time of the manoeuvre."""

    def __init__(self, bench: "Session") -> None:
        self._bench = bench

    @property
    def now_s(self) -> float:
        """Time since the start of the manoeuvre, s."""
        return self._bench.time_s

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self._bench.run(seconds)


class FaultAccess:
    """Fixture ``faults``: what can break."""

    def __init__(self, bench: "Session") -> None:
        self.inject = bench.inject
        self.clear = bench.clear

    @property
    def names(self) -> tuple[str, ...]:
        """Faults by name."""
        from hil.faults.catalogue import names

        return names()


class RecordingAccess:
    """Fixture ``recording``: both buses of the test's bench, so far."""

    def __init__(self, bench: "Session") -> None:
        self._bench = bench

    @property
    def path(self) -> Path:
        """The recording's file (candump)."""
        return self._bench.log

    @property
    def signals(self) -> "Signals":
        """All signals, decoded."""
        return self._bench.signals

    def get(self, name: str) -> "tuple[Floats, Floats]":
        """Times (s, of the manoeuvre) and values (SI) of ``MESSAGE.SIGNAL``."""
        return self._bench.signals.get(name)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options, all with the name of the project in front."""
    group = parser.getgroup("brakebench", "hardware-in-the-loop bench")
    group.addoption(
        "--brakebench-bus",
        metavar="BUS",
        help="run benches in real time on this bus: loopback:NAME, socketcan:vcan0, or INTERFACE:CHANNEL of python-can",
    )
    group.addoption(
        "--brakebench-realtime",
        action="store_true",
        help="run benches in real time on a bus that is free (vcan0, else a loopback) instead of in virtual time, and "
        "ask for real-time scheduling; the summary says what was granted",
    )
    group.addoption(
        "--brakebench-transmit",
        action="store_true",
        help="send on a bus with hardware, where it reaches a real ECU or a real brake; refused there without",
    )
    group.addoption(
        "--brakebench-no-ecu",
        action="store_true",
        help="start no ECU: a real one, or somebody else's, is on the bus",
    )
    group.addoption(
        "--brakebench-limit",
        type=float,
        default=120.0,
        metavar="SECONDS",
        help="wall time that one bench may take (default: 120)",
    )
    group.addoption(
        "--brakebench-out",
        metavar="DIR",
        help="folder for the files of all benches (default: pytest's temporary folder)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", f"{_REQUIREMENT}(id, ...): requirements that the test verifies")
    config.stash[_OPEN] = []


def pytest_report_header(config: pytest.Config) -> str | None:
    """Say what benches run on where they do not run in virtual time."""
    options = config.option
    if not (options.brakebench_bus or options.brakebench_realtime or options.brakebench_no_ecu):
        return None
    asked = "asked for, see the summary" if options.brakebench_realtime else "not asked for (--brakebench-realtime)"
    return f"brakebench: real time on {options.brakebench_bus or 'a free bus'}; real-time scheduling {asked}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Requirement ids go into the reports (JUnit XML: properties of the test case)."""
    for item in items:
        for marker in item.iter_markers(_REQUIREMENT):
            item.user_properties += [(_REQUIREMENT, str(name)) for name in marker.args]


@pytest.fixture
def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> "Iterator[Session]":
    """A bench of the test's own: see `hil.bench.session.Session`."""
    from hil.bench.session import Session, real_run, virtual_run

    options = request.config.option
    bus, no_ecu = options.brakebench_bus, options.brakebench_no_ecu
    real = bool(bus or options.brakebench_realtime or no_ecu)
    others = ("ecu",) if no_ecu else ()
    make = (
        real_run(bus or "auto", others, options.brakebench_realtime, options.brakebench_transmit)
        if real
        else virtual_run
    )
    session = Session(make, _folder(request, tmp_path_factory), f"Test {request.node.nodeid}", options.brakebench_limit)
    request.node.stash[_SESSION] = session
    running = request.config.stash[_OPEN]
    running.append(session)
    try:
        yield session
    finally:
        running.remove(session)
        session.stop()


def _folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new folder for the test's files."""
    name = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in request.node.name)[:60]
    chosen = request.config.option.brakebench_out
    if chosen is None:
        return Path(tmp_path_factory.mktemp(name))
    number = 1
    while True:  # tests of one name, or of one run after the other
        folder = Path(chosen).absolute() / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
            continue
        return folder


@pytest.fixture
def bus(bench: "Session") -> BusAccess:
    """Frames of the test's bench."""
    return BusAccess(bench)


@pytest.fixture
def clock(bench: "Session") -> ClockAccess:
    """Time of the test's bench."""
    return ClockAccess(bench)


@pytest.fixture
def faults(bench: "Session") -> FaultAccess:
    """Faults of the test's bench."""
    return FaultAccess(bench)


@pytest.fixture
def recording(bench: "Session") -> RecordingAccess:
    """Recording of the test's bench."""
    return RecordingAccess(bench)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """Give the test its verdict; on all but *passed* write recording, figure and report, and name them in the output.

    A test that passes in real time is looked at as a run is: with a node that fell silent, too many overruns or another
    sender it has not passed.
    """
    report = yield
    session = item.stash.get(_SESSION, None)
    if session is None or report.when != "call" or report.skipped:
        return report
    reason = str(call.excinfo.value).strip().partition("\n")[0] if call.excinfo else ""
    verdict = "passed"
    if report.failed:
        verdict, shown = _conclude(session, item, reason or "the test failed")
        report.sections.append(("brakebench", shown))
    elif session.findings:
        verdict, shown = _conclude(session, item, "")
        report.outcome = "failed"
        report.longrepr = f"brakebench: the test's own checks hold, but its run is {verdict}\n{shown}"
    properties = [(_VERDICT, verdict)] + [(_PUNCTUALITY, session.punctuality)] * bool(session.punctuality)
    item.user_properties += properties
    report.user_properties += properties
    return report


def _conclude(session: "Session", item: pytest.Item, reason: str) -> tuple[str, str]:
    """The verdict of a test that did not pass, and what to look at."""
    ids = [value for name, value in item.user_properties if name == _REQUIREMENT]
    try:
        outcome = session.conclude({"test": item.nodeid, "requirements": ids}, reason)
    except Exception as error:  # the test's own failure must still be shown
        return "failed", f"no report: {type(error).__name__}: {error}\nfiles: {session.folder}"
    if outcome is None:
        return "failed", "the bench was not started"
    lines = [f"verdict: {outcome.verdict}"]
    lines += [f"{found['verdict']}: {found['text']}" for found in outcome.facts["findings"] if found["text"] != reason]
    late = outcome.result.overruns
    lines += [f"overruns: {late} ticks skipped, the machine was too busy for real time"] if late else []
    lines += [session.punctuality] if session.punctuality else []
    lines += [f"{shown}: {Path(str(outcome.facts[key])).resolve()}" for key, shown in _SHOWN if outcome.facts[key]]
    lines += [f"missing: {line}" for line in outcome.facts["missing"]]
    lines += [f"requirements: {', '.join(map(str, ids))}"] if ids else []
    return outcome.verdict.value, "\n".join(lines)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """End the benches that an interruption left running, and say where their recordings are."""
    terminal = session.config.pluginmanager.get_plugin("terminalreporter")
    benches = session.config.stash[_OPEN]
    for bench in [*benches]:
        bench.stop()
        if terminal is not None and bench.started:
            terminal.write_line(f"\nbrakebench: stopped before its end; recording: {bench.log}")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say of each requirement how its tests went, of all benches how they are judged, and what was granted."""
    outcomes: dict[str, list[str]] = defaultdict(list)
    benches: dict[str, Counter[str]] = {_VERDICT: Counter(), _PUNCTUALITY: Counter()}
    for outcome in ("passed", "failed", "error", "skipped"):
        for report in terminalreporter.stats.get(outcome, []):
            for name, value in getattr(report, "user_properties", []):
                if name == _REQUIREMENT:
                    outcomes[value].append(outcome)
                elif name in benches and report.when == "call":
                    benches[name][value] += 1
    verdicts, granted = benches[_VERDICT], benches[_PUNCTUALITY]
    if granted or verdicts.keys() - {"passed"}:
        terminalreporter.section("brakebench")
        terminalreporter.line(", ".join(f"{number} {verdict}" for verdict, number in sorted(verdicts.items())))
        for words, number in granted.items():
            terminalreporter.line(f"{words} ({number} bench{'es' if number > 1 else ''})")
    if outcomes:
        terminalreporter.section("requirements")
        for name, found in sorted(outcomes.items()):
            worst = next(o for o in ("failed", "error", "skipped", "passed") if o in found)
            terminalreporter.line(f"{name}: {worst} ({len(found)} test{'s' if len(found) > 1 else ''})")
