"""Wrong uses of a first hour: each ends in one line that says what to do, before anything long is done."""

import importlib.metadata
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hil.cli import main as main_module
from hil.cli.columns import listing
from hil.cli.main import COMMANDS, build_parser, main
from hil.extras import pip_install

REPOSITORY = Path(__file__).parents[4]
HEAVY = ("numpy", "numba", "scipy", "can", "pyarrow", "matplotlib")
LISTS = ("scenarios", "effects", "inject")


def run(*words):
    try:
        return main(words)
    except SystemExit as error:
        return error.code


@pytest.mark.parametrize("words", [["--help"], ["--version"]])
def test_help_loads_nothing_heavy(words):
    asked = f"import sys; from hil.cli.main import main\ntry: main({words})\nexcept SystemExit: pass\n"
    asked += f"sys.exit(str([name for name in {HEAVY} if name in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, cwd=REPOSITORY)
    assert done.stderr.strip() == "[]"
    assert done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_what_it_does(command):
    (commands,) = (a.choices for a in build_parser([command])._actions if isinstance(a.choices, dict))
    assert list(commands) == [command]
    assert commands[command].description
    assert f"    {command} " in build_parser().format_help().replace("\n", " \n")


def test_a_python_that_is_too_old_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 9, 18))
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(main_module.__file__)
    assert str(ended.value).startswith("brakebench needs Python 3.11 or newer; this is ")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["runn"], "no command 'runn'; did you mean 'run'?"),
        (["zzz"], "`brakebench --help` lists all"),
        (["run", "stop7", "--virtual"], "no scenario 'stop7'; did you mean stop72"),
        (["effects", "road_grad"], "did you mean road_grade"),
        (["inject", "motor_ded"], "did you mean 'motor_dead'?"),
        (["record", "r.log", "--bus", "nosuch:1"], "bus nosuch:1: there is no kind 'nosuch'"),
    ],
)
def test_a_name_that_is_none_is_answered_by_those_that_are(capsys, words, hint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(*words) == 2
    said = capsys.readouterr().err
    assert hint in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ["campaign", "plan.toml"],
        ["compare"],
        ["explain", "some.log"],
        ["faults"],
        ["hide", "--effect", "pad_temp_fade"],
        ["identify", "friction"],
        ["reproduce"],
        ["run", "--virtual"],
        ["sensitivities", "stop72"],
        ["trials"],
        ["verify", "plant"],
    ],
    ids=lambda words: words[0],
)
def test_an_unwritable_out_is_refused_before_the_work(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    for out in ("file", "file/folder", "n" * 300):
        assert run(*words, "--out", out) == 2
        assert "cannot be written" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    "words", [["run", "--virtual"], ["compare"], ["trials"], ["hide"], ["faults"], ["inject", "lost"]]
)
@pytest.mark.parametrize("seed", ["-1", "x", "1.5"])
def test_a_seed_that_is_none_is_refused(words, seed, capsys):
    assert run(*words, f"--seed={seed}") == 2
    assert "expected a whole number, 0 or more" in capsys.readouterr().err


@pytest.mark.parametrize("command", LISTS)
def test_lists_fit_a_narrow_terminal(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert run(command) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "/" not in line]
    assert len(lines) > 20
    assert max(map(len, lines)) <= 60


def test_a_list_breaks_between_words():
    assert listing([("a", "one two three"), ("bcd", "four")], 14) == ["a    one two", "     three", "bcd  four"]
    assert listing([("a" * 12, "one two")], 16) == ["a" * 12, "    one two"]


def test_a_list_goes_into_a_reader_that_leaves():
    begun = subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", "inject"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=REPOSITORY
    )
    begun.stdout.close()
    assert (begun.communicate()[1], begun.returncode) == (b"", 0)


def test_a_missing_extra_is_installed_by_the_names_of_its_packages(monkeypatch):
    extras = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = {
        extra
        for path in (REPOSITORY / "hil").rglob("*.py")
        for extra in re.findall(r"pip_install\(['\"](\w+)['\"]\)", path.read_text())
    }
    assert named <= set(extras)
    assert len(named) >= 4
    monkeypatch.setattr(
        importlib.metadata.Distribution, "requires", ["numpy>=1", "asammdf>=8; extra == 'mdf'"], raising=False
    )
    assert pip_install("mdf").endswith("-m pip install 'asammdf>=8'")
    monkeypatch.setattr(importlib.metadata.Distribution, "requires", [], raising=False)
    assert pip_install("mdf").endswith("-m pip install --editable '.[mdf]'")
