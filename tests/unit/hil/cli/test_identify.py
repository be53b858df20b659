"""``brakebench identify friction`` from its words to its files."""

import argparse
import json

import pytest

from hil.cli import identify
from hil.errors import BrakebenchError
from hil.identify.study import shipped_records
from hil.scenario.parameters import load_set
from plant.parameters.brakes import OstermeyerParameters


def run(*words):
    parser = argparse.ArgumentParser()
    identify.add_parser(parser.add_subparsers())
    args = parser.parse_args(["identify", "friction", *map(str, words)])
    return args.run(args)


def test_json_stands_alone_and_files_are_written(tmp_path, capsys):
    first, second = shipped_records()
    assert run(first, "--validate", second, "--heating", "printed", "--json", "--out", tmp_path / "new" / "dir") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["heating"] == "printed"
    written = {path.name for path in (tmp_path / "new" / "dir").iterdir()}
    figures = {"figure3_inputs.png", "figure4_identification.png", "figure5_validation.png"}
    assert written == figures | {"report.html", "result.json", "pad.toml"}
    assert json.loads((tmp_path / "new" / "dir" / "result.json").read_text()) == told
    assert load_set(tmp_path / "new" / "dir" / "pad.toml", OstermeyerParameters).heating_with_mu == 0.0


def test_without_a_record_the_shipped_ones_are_taken_and_named_synthetic(capsys):
    assert run("--heating", "printed") == 0
    assert "dyno_test1.csv (synthetic)" in capsys.readouterr().out


def test_brake_can_be_given(capsys):
    first, _ = shipped_records()
    words = ("--pads", 1, "--piston-area-cm2", 51, "--radius-mm", 120, "--ambient-degc", 30, "--axle", "rear")
    assert run(first, "--heating", "printed", "--json", *words) == 0
    brake = json.loads(capsys.readouterr().out)["brake"]
    assert brake == {
        "piston_area_m2": pytest.approx(0.0051),
        "effective_radius_m": pytest.approx(0.12),
        "threshold_pressure_pa": 50000.0,
        "efficiency": 0.97,
        "ambient_k": pytest.approx(303.15),
        "pads": 1,
    }


@pytest.mark.slow
def test_coverage_is_counted(capsys):
    assert run("--coverage", 1, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["level"] == 0.99
    assert [row["seeds"] for row in told["rows"]] == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--validate", "x.csv"), "--validate without a record"),
        (("--coverage", "3", "x.csv"), "makes its own records"),
        (("--coverage", "0"), "at least 1 record"),
        (("absent.csv",), "absent.csv: cannot be read"),
        (("--parameters", "absent.toml"), "absent.toml: cannot be read"),
    ],
)
def test_wrong_use_is_refused(words, said):
    with pytest.raises(BrakebenchError, match=said):
        run(*words)


@pytest.mark.parametrize("value", ["-3", "nan", "0", "inf"])
def test_sizes_are_positive(value, capsys):
    with pytest.raises(SystemExit) as end:
        run("--piston-area-cm2", value)
    assert end.value.code == 2
    assert "expected a positive number" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    first, _ = shipped_records()
    with pytest.raises(SystemExit):
        run(first, "--heating", "printed", "--out", tmp_path / "file" / "dir")
