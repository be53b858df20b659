"""The verdict over all drawn cases: one that is missed fails nothing, too many do, and so does one that was not run.

Each case notes how it came out (fixture ``outcome``); the process that runs the session collects and decides.
"""

import os
from collections.abc import Callable

import passed
import pytest

COUNT, MOST_MISSES, MOST_ALARMS = 12, 2, 1
"""Cases of each kind; how many single causes may be missed, and in how many cases with nothing hidden one be named."""
SEED = "BRAKEBENCH_DRAWN_SEED"
SINGLE, NULL = "single", "null"
_ALLOWED = {SINGLE: MOST_MISSES, NULL: MOST_ALARMS}
Outcomes = dict[tuple[str, int], str]
"""What is wrong with each case, by kind and number; an empty text where nothing is."""


def seed() -> int:
    """From the state of the sources; the environment's `SEED` repeats another one."""
    return int(os.environ.get(SEED) or int(passed.state("drawn")[:6], 16))


def faults(outcomes: Outcomes) -> list[str]:
    """Why the drawn cases do not pass; empty where they do."""
    found = []
    for kind, allowed in _ALLOWED.items():
        cases = [number for number in range(COUNT) if (kind, number) in outcomes]
        wrong = [number for number in cases if outcomes[kind, number]]
        if len(cases) < COUNT:
            found.append(f"{kind}: {len(cases)} of {COUNT} cases ran to their end: no verdict")
        if len(wrong) > allowed:
            found.append(f"{kind}: {len(wrong)} of {COUNT} wrong, at most {allowed} may be")
    return found


@pytest.fixture
def outcome(record_property: Callable[[str, object], None]) -> Callable[[str, int, str], None]:
    """Take what is wrong with a case, or an empty text."""

    def note(kind: str, number: int, wrong: str) -> None:
        record_property("drawn", [kind, number, wrong])

    return note


class Verdict:
    """Collects outcomes in the process that runs the session, and fails it where they do not pass."""

    def __init__(self, write_passed: bool) -> None:
        self._began = passed.state("drawn") if write_passed else ""
        self._outcomes: Outcomes = {}
        self._met = False
        self._lines: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the outcome of a case."""
        if not report.nodeid.partition("::")[0].endswith("test_drawn.py"):
            return
        self._met = True
        if report.when == "call" and report.passed:
            for name, value in report.user_properties:
                if name == "drawn":
                    kind, number, wrong = value
                    self._outcomes[kind, number] = wrong

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Decide, where a drawn case was to be run."""
        if not self._met:
            return
        wrong = {key: text for key, text in self._outcomes.items() if text}
        why = faults(self._outcomes)
        self._lines = [f"{kind} {number}: {text}" for (kind, number), text in sorted(wrong.items())]
        self._lines += [f"seed {seed()}; to repeat: {SEED}={seed()} pytest tests/hidden/test_drawn.py", *why]
        if why and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        if session.exitstatus == pytest.ExitCode.OK:
            self._lines.append("the drawn cases pass")
            if self._began and SEED not in os.environ:  # a seed of one's choice is no draw
                counts = {kind: sum(key[0] == kind for key in wrong) for kind in _ALLOWED}
                facts = {"seed": seed(), "missed": counts[SINGLE], "alarms": counts[NULL]}
                self._lines.append(passed.write("drawn", self._began, facts))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print misses, alarms and the verdict."""
        if self._lines:
            terminalreporter.section("drawn cases")
            for line in self._lines:
                terminalreporter.write_line(line)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a passing run be noted."""
    parser.addoption("--write-passed", action="store_true", help="note that what CI may leave out from now on passes")


def pytest_configure(config: pytest.Config) -> None:
    """Decide where all reports come together, not in a worker of pytest-xdist."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Verdict(config.getoption("--write-passed")), "drawn-verdict")
