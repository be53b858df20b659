"""The verdict over drawn cases: some may be wrong, too many not, and none may be left out."""

import drawn
import passed
import pytest

CASES = """
import drawn, pytest
WRONG = {wrong}

@pytest.mark.drawn
@pytest.mark.parametrize("number", range(drawn.COUNT))
@pytest.mark.parametrize("kind", [drawn.SINGLE, drawn.NULL])
def test_case(kind, number, outcome):
    {before}
    outcome(kind, number, "wrong" if (kind, number) in WRONG else "")
"""
NO_MORE = [("single", 3), ("single", 7), ("null", 11)]
pytest_plugins = ["pytester"]


@pytest.fixture
def session(pytester, monkeypatch):
    """Run a session of cases; its exit code, what it prints and the file that notes a pass."""
    monkeypatch.delenv(drawn.SEED, raising=False)
    monkeypatch.setattr(passed, "state", lambda name: "0123456789abcdef")
    monkeypatch.setattr(passed, "ROOT", pytester.path)
    monkeypatch.setattr(passed, "FILES", {"drawn": "drawn.passed"})
    pytester.makeini("[pytest]\nmarkers = drawn: x")
    pytester.makeconftest('pytest_plugins = ["drawn"]')

    def run(*options, wrong=(), before="pass"):
        pytester.makepyfile(test_drawn=CASES.format(wrong=list(wrong), before=before))
        done = pytester.runpytest_inprocess("-p", "no:cacheprovider", *options)
        return done.ret, done.stdout.str(), pytester.path / "drawn.passed"

    return run


@pytest.mark.parametrize("options", [(), pytest.param(("-n", "2"), marks=pytest.mark.slow)])
def test_as_many_as_allowed_may_be_wrong(session, options):
    code, out, file = session("--write-passed", *options, wrong=NO_MORE)
    assert code == 0
    assert "single 7: wrong" in out
    assert file.read_text() == 'state = "0123456789abcdef"\nseed = 74565\nmissed = 2\nalarms = 1\n'


@pytest.mark.parametrize("one_more", [("single", 0), ("null", 0)])
def test_one_more_fails_the_session(session, one_more):
    code, out, file = session("--write-passed", wrong=[*NO_MORE, one_more])
    assert code == 1
    assert f"{one_more[0]}: " in out
    assert "at most" in out
    assert not file.exists()


@pytest.mark.parametrize(
    ("options", "before"),
    [
        (("-k", "not null-5"), "pass"),
        ((), "if number == 4: pytest.skip('not today')"),
        ((), "if number == 4: pytest.xfail('not today')"),
        ((), "if number == 4: raise ValueError"),
    ],
)
def test_a_case_that_did_not_run_fails_the_session(session, options, before):
    code, out, file = session("--write-passed", *options, before=before)
    assert code == 1
    assert "11 of 12 cases ran to their end: no verdict" in out
    assert not file.exists()


def test_only_a_drawn_seed_is_noted_and_only_when_asked_for(session, monkeypatch):
    code, _, file = session()
    assert (code, file.exists()) == (0, False)
    monkeypatch.setenv(drawn.SEED, "4")
    code, out, file = session("--write-passed")
    assert (code, file.exists()) == (0, False)
    assert "seed 4" in out


def test_a_session_without_drawn_cases_has_no_verdict(session):
    code, out, _ = session("-k", "nothing")
    assert code == 5
    assert "drawn cases" not in out


def test_a_run_passed_while_its_sources_stay(tmp_path, monkeypatch):
    for path in ("dbc/brake.dbc", "tests/vcan/test_stop.py"):
        (tmp_path / path).parent.mkdir(parents=True)
        (tmp_path / path).write_text("")
    monkeypatch.setattr(passed, "ROOT", tmp_path)
    monkeypatch.setattr(passed, "SOURCES", {"lab": ("dbc", "tests/vcan")})
    assert not passed.passed("lab")
    began = passed.state("lab")
    passed.write("lab", began, {"tests": 3})
    assert passed.passed("lab")
    (tmp_path / "dbc" / "brake.dbc").write_text("BU_: ECU")
    assert not passed.passed("lab")
    assert "not written" in passed.write("lab", began, {"tests": 3})
    assert not passed.passed("lab")


@pytest.mark.parametrize("path", sorted({path for paths in passed.SOURCES.values() for path in paths}))
def test_every_source_is_there(path):
    assert (passed.ROOT / path).exists()
