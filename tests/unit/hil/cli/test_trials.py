"""``brakebench trials`` from its words to its files, on cases that are on file already."""

import argparse
import json

import pytest

from hil.cli import trials
from hil.errors import BrakebenchError
from hil.validation.blind_trials.run import plan


def run(*words):
    parser = argparse.ArgumentParser()
    trials.add_parser(parser.add_subparsers())
    args = parser.parse_args(["trials", *map(str, words)])
    return args.run(args)


def keep(folder, *families, count=2, state="abc"):
    """Cases on file, every cause found at 15 and 8."""
    grade = {"effect": "road_grade", "location": "car", "parameters": {"grade": {"value": 0.01, "unit": ""}}}
    records = {}
    for family in families:
        for drawn, index, size in plan(family, count):
            named = ["road_grade"] if (size or 0.0) >= 8.0 else []
            records[drawn, index, size] = {
                "family": drawn, "index": index, "size": size, "seed": 1, "sources": state,
                "reached": True, "noise": "low",
                "hidden": [grade],
                "verdict": "named" if named else "none", "named": named, "rivals": [], "undetectable_effects": [],
                "held_out_error": {},
                "causes": [{"effect": e, "parameters": {}, "location": "car", "probability": 0.9} for e in named],
            }  # fmt: skip
    lines = "".join(json.dumps(record) + "\n" for record in records.values())
    with (folder / "cases.jsonl").open("a", encoding="utf-8") as file:
        file.write(lines)


def test_json_stands_alone_and_files_are_written(tmp_path, capsys):
    keep(tmp_path, "single")
    assert run("--family", "single", "--count", 2, "--out", tmp_path, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["seed"] == 1
    single = printed["families"]["single"]
    assert single["n"] == 8
    assert single["metrics"]["top1_snr8"]["value"] == 1.0
    assert single["detection_limits"] == {"road_grade": 8.0}
    assert json.loads((tmp_path / "table.json").read_text()) == printed
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<td class=s>top1 snr8</td>" in page
    assert "<td class=s>road_grade</td><td class=s>8</td>" in page
    assert (tmp_path / "confusion.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("option", ["--own-error", "--apart"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_measured(option, tmp_path, monkeypatch):
    def never(*_):
        raise AssertionError("measured")

    monkeypatch.setattr("hil.validation.blind_trials.discrepancy_table.measure", never)
    monkeypatch.setattr("hil.validation.blind_trials.separability.measure", never)
    path = tmp_path / "nowhere" / "measured.toml"
    with pytest.raises(BrakebenchError, match=r"measured.toml.*cannot be written"):
        run(option, path)


def test_a_measurement_that_breaks_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    def breaks(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("hil.validation.blind_trials.separability.measure", breaks)
    path = tmp_path / "measured.toml"
    path.write_text("before")
    with pytest.raises(KeyboardInterrupt):
        run("--apart", path)
    assert [p.read_text() for p in tmp_path.iterdir()] == ["before"]


def test_families_run_one_by_one_share_a_table(tmp_path, capsys):
    keep(tmp_path, "null", "single", count=3)
    run("--family", "calibration", "--count", 2, "--out", tmp_path)
    run("--family", "null", "--count", 3, "--out", tmp_path)
    table = json.loads((tmp_path / "table.json").read_text())
    assert list(table["families"]) == ["null", "calibration"]
    assert table["families"]["null"]["n"] == 3


def test_the_text_says_what_was_asked_and_what_was_missed(tmp_path, capsys):
    keep(tmp_path, "single")
    run("--family", "single", "--count", 2, "--out", tmp_path)
    text = capsys.readouterr().out
    assert "top1_snr15                   1.000  [0.342, 1.000]  mark 0.97  met" in text
    assert "named from 8                 road_grade" in text
    assert "missed" not in text
    run("--family", "gain", "--count", 2, "--out", tmp_path)
    assert "no case tells" in capsys.readouterr().out


def test_cases_of_several_states_of_the_program_are_printed(tmp_path, capsys):
    keep(tmp_path, "null", count=2)
    keep(tmp_path, "twin", count=1, state="def")
    assert run("--family", "null", "--count", 2, "--out", tmp_path) == 0
    assert "several states" not in capsys.readouterr().out
    changed = (tmp_path / "cases.jsonl").read_text().replace('"abc"', '"def"', 1)
    (tmp_path / "cases.jsonl").write_text(changed)
    assert run("--family", "null", "--count", 2, "--out", tmp_path) == 0
    assert "of several states of the program: def 1, abc 1" in capsys.readouterr().out


def test_a_missed_case_is_printed_with_its_number(tmp_path, capsys):
    keep(tmp_path, "null", count=2)
    alarm = '"causes": [{"effect": "headwind", "location": "car", "parameters": {}}]'
    raised = (tmp_path / "cases.jsonl").read_text().replace('"causes": []', alarm, 1)
    (tmp_path / "cases.jsonl").write_text(raised)
    run("--family", "null", "--count", 2, "--out", tmp_path)
    assert "  missed 0: road_grade@car 0.01; answered headwind@car" in capsys.readouterr().out


@pytest.mark.parametrize("count", ["0", "-3", "many"])
def test_a_count_of_no_cases_is_refused(count, capsys):
    with pytest.raises(SystemExit):
        run("--count", count)
    assert "expected a whole number, 1 or more" in capsys.readouterr().err
