"""For all tests: how long one takes says nothing on a shared machine, and the first one compiles."""

import os

import pytest
from hypothesis import HealthCheck, settings

pytest_plugins = ["drawn", "shared"]
SLOW_LIMIT_S = 3600.0  # ends what hangs; a busy machine takes ten times as long as an idle one

for name in ("COLUMNS", "LINES"):  # readline, which pytest imports, sets them for child processes, terminal or not
    os.environ.pop(name, None)
    os.unsetenv(name)

settings.register_profile(
    "brakebench",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=bool(os.environ.get("CI")),  # a change is judged by the same examples every time
)
settings.load_profile("brakebench")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give every slow test the same limit."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(SLOW_LIMIT_S), append=False)
