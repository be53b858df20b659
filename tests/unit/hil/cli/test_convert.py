import argparse
import json

import pytest

from hil.cli import convert
from hil.errors import BrakebenchError


def run(*words):
    parser = argparse.ArgumentParser()
    convert.add_parser(parser.add_subparsers())
    args = parser.parse_args(["convert", *map(str, words)])
    return args.run(args)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("(1.0) can0 001#0101\nbad\n(1.5) vehicle 7FF#00\n(1.5) can0 7")
    return path


def test_text_counts_both_sides(log, tmp_path, capsys):
    assert run(log, tmp_path / "a.csv") == 0
    out = capsys.readouterr().out
    assert "2 frames read, 2 written, equal" in out
    assert "2 lines or objects" in out
    assert "at byte 20: bad" in out
    assert "cut off at byte" in out


def test_json_is_one_object_alone_on_stdout(log, tmp_path, capsys):
    assert run(log, tmp_path / "a.blf", "--json") == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert (result["frames_read"], result["frames_written"], result["rejected"]) == (2, 2, 2)
    assert result["truncated_at"] is not None
    assert any("vehicle is channel 2" in note for note in result["notes"])
    assert "vehicle is channel 2" in captured.err


def test_an_existing_file_needs_force(log, tmp_path):
    (tmp_path / "a.asc").write_text("mine")
    with pytest.raises(BrakebenchError, match="--force"):
        run(log, tmp_path / "a.asc")
    assert run(log, tmp_path / "a.asc", "--force") == 0


def test_an_unknown_suffix_is_refused(log, tmp_path):
    with pytest.raises(BrakebenchError, match="known are"):
        run(log, tmp_path / "a.xyz")
