"""Hooks of a conftest whose tests run in a lab: what it is, what was measured, and that all of it passed."""

import platform
from pathlib import Path

import passed
import pytest


class Lab:
    """One lab and what its tests measured.

    Parameters
    ----------
    name : as in `passed`.  kind : what the lab's script says it is; None outside.
    what, drivers : of the report's first lines: what is tested, and how the names of its kernel modules begin.
    measured : what the figures are measured on.
    """

    def __init__(self, name: str, kind: str | None, what: str, drivers: tuple[str, ...], measured: str) -> None:
        self._name, self._kind, self._what, self._drivers, self._measured = name, kind, what, drivers, measured
        self._began: str | None = None
        self.figures: list[str] = []

    def report_header(self) -> str | None:
        """Name the kernel and its CAN drivers where the tests on them are meant to run."""
        if self._kind is None:
            return None
        modules = [line.split()[0] for line in Path("/proc/modules").read_text().splitlines()]
        found = ", ".join(sorted(name for name in modules if name.startswith(self._drivers)))
        return f"{self._what}: Linux {platform.release()} ({self._kind}), modules {found or 'built in'}"

    def sessionstart(self, session: pytest.Session) -> None:
        """Note the state of the sources that are tested."""
        if self._kind is not None and session.config.getoption("--write-passed"):
            self._began = passed.state(self._name)

    def sessionfinish(self, session: pytest.Session) -> None:
        """Note that the lab's tests pass, where that is asked for and all of them ran."""
        if self._began is None:
            return
        stats = session.config.pluginmanager.get_plugin("terminalreporter").stats  # type: ignore[union-attr]
        whole = not any(stats.get(kind) for kind in ("skipped", "deselected", "xfailed"))
        ran = {report.nodeid.partition("::")[0] for report in stats.get("passed", [])}
        if session.exitstatus == pytest.ExitCode.OK and whole and ran >= passed.lab_tests(self._name):
            facts = {"kernel": f'"{platform.release()} ({self._kind})"', "tests": session.testscollected}
            self.figures.append(passed.write(self._name, self._began, facts))

    def terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print what was measured, whether the tests passed or not."""
        if self.figures:
            terminalreporter.section(f"measured on {self._measured}")
            for figure in self.figures:
                terminalreporter.write_line(figure)
