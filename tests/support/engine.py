"""Tests that explain whole logs: they depend on the engine alone, and CI runs them where it has changed.

pytest -n 2 --dist worksteal -m 'engine and not long' --write-passed
"""

import passed
import pytest

ALL = "engine and not long"
_FOLDERS = (
    "tests/pinned/", "tests/hidden/", "tests/unit/hil/diagnosis/detection/", "tests/unit/hil/diagnosis/estimation/",
    "tests/unit/hil/diagnosis/sensor_consistency/", "tests/unit/hil/diagnosis/test_",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark them, before tests are chosen by their marks."""
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("drawn") and _explains(item):
            item.add_marker(pytest.mark.engine)


def _explains(item: pytest.Item) -> bool:
    return item.path.is_relative_to(passed.ROOT) and item.path.relative_to(passed.ROOT).as_posix().startswith(_FOLDERS)


class Passed:
    """Notes that all of them pass, where that is asked for and all of them ran."""

    def __init__(self, config: pytest.Config) -> None:
        self._whole = config.getoption("-m") == ALL and not config.getoption("-k")
        self._began = passed.state("engine")
        self._line = ""

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the file."""
        stats = session.config.pluginmanager.get_plugin("terminalreporter").stats  # type: ignore[union-attr]
        asked = session.config.args_source is pytest.Config.ArgsSource.TESTPATHS
        if self._whole and asked and session.exitstatus == pytest.ExitCode.OK and not stats.get("skipped"):
            self._line = passed.write("engine", self._began, {"tests": len(stats["passed"])})

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say so."""
        if self._line:
            terminalreporter.write_line(self._line)


def pytest_configure(config: pytest.Config) -> None:
    """Note it where all reports come together, not in a worker of pytest-xdist."""
    if config.getoption("--write-passed") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Passed(config), "engine-passed")
