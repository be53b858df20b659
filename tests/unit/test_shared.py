"""An answer is computed once for all workers of a session."""

import pytest

TESTS = """
import time
from pathlib import Path
import pytest

@pytest.mark.parametrize("number", range(4))
def test_it(shared, number):
    def make(folder):
        with (folder / "made").open("a") as file:
            file.write("x")
        time.sleep(0.2)
        return {"made": str(folder / "made")}
    assert Path(shared("one", make)["made"]).read_text() == "x"
"""
pytest_plugins = ["pytester"]


@pytest.mark.slow
def test_two_workers_compute_an_answer_once(pytester):
    pytester.makeconftest('pytest_plugins = ["shared"]')
    pytester.makepyfile(TESTS)
    for options in (("-n", "2"), ()):
        pytester.runpytest_inprocess("-p", "no:cacheprovider", *options).assert_outcomes(passed=4)
