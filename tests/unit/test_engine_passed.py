"""The note that all explanations of whole logs pass: only of a session that ran all of them, and passed."""

import passed
import pytest

TESTS = """
import pytest

@pytest.mark.slow
def test_explains():
    {body}

def test_quick():
    pass
"""
ALL = ("-m", "engine and not long")
pytest_plugins = ["pytester"]


@pytest.fixture
def session(pytester, monkeypatch):
    """Run a session; its outcomes, and the file that notes a pass."""
    monkeypatch.setattr(passed, "state", lambda name: "0123456789abcdef")
    monkeypatch.setattr(passed, "ROOT", pytester.path)
    monkeypatch.setattr(passed, "FILES", {"engine": "engine.passed"})
    pytester.makeini("[pytest]\ntestpaths = tests\nmarkers =\n    slow: x\n    engine: x\n    drawn: x")
    pytester.makeconftest('pytest_plugins = ["drawn", "engine"]')

    def run(*options, body="pass", folder="pinned"):
        file = pytester.mkpydir("tests") / folder / "test_it.py"
        file.parent.mkdir()
        file.write_text(TESTS.format(body=body), "utf-8")
        done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "--write-passed", *options)
        return done.parseoutcomes(), pytester.path / "engine.passed"

    return run


def test_all_that_pass_are_noted(session):
    outcomes, file = session(*ALL)
    assert outcomes == {"passed": 1, "deselected": 1}
    assert file.read_text("utf-8").splitlines() == ['state = "0123456789abcdef"', "tests = 1"]


@pytest.mark.parametrize(
    ("options", "body"),
    [
        (ALL, "assert 0"),
        (ALL, "pytest.skip('not here')"),
        ((*ALL, "-k", "explains"), "pass"),
        ((*ALL, "tests/pinned"), "pass"),
        (("-m", "engine"), "pass"),
        ((), "pass"),
    ],
)
def test_nothing_else_is(session, options, body):
    _, file = session(*options, body=body)
    assert not file.exists()


def test_other_slow_tests_are_none_of_them(session):
    outcomes, file = session(*ALL, folder="process")
    assert outcomes == {"deselected": 2}
    assert not file.exists()
