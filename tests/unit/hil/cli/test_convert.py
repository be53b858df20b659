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


def test_text_counts_both_sides_and_the_exit_code_tells_what_is_missing(log, tmp_path, capsys):
    assert run(log, tmp_path / "b.log") == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "2 frames read, 2 written, equal" in out
    assert "2 pieces of" in out
    assert "at byte 20: bad" in out
    assert "cut off at byte" in out
    assert run(tmp_path / "b.log", tmp_path / "c.log") == 0


def test_json_is_one_object_alone_on_stdout(log, tmp_path, capsys):
    assert run(log, tmp_path / "a.blf", "--json") == 1
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert (result["frames_read"], result["frames_written"], result["rejected"]) == (2, 2, 2)
    assert result["truncated_at"] is not None
    assert any("vehicle is channel 2" in note for note in result["notes"])
    assert "vehicle is channel 2" in captured.err


def test_an_existing_file_needs_force_and_the_source_is_never_replaced(log, tmp_path):
    target = tmp_path / "b.log"
    target.write_text("mine")
    with pytest.raises(BrakebenchError, match="--force"):
        run(log, target)
    assert target.read_text() == "mine"
    assert run(log, target, "--force") == 1
    before = log.read_bytes()
    link = tmp_path / "link.log"
    link.symlink_to(log)
    for same in (log, link):
        with pytest.raises(BrakebenchError, match="read by this command"):
            run(log, same, "--force")
    assert log.read_bytes() == before


def test_a_zone_that_is_none_is_refused(log, tmp_path, capsys):
    with pytest.raises(SystemExit):
        run(log, tmp_path / "b.log", "--timezone", "Mars/Olympus")
    assert "is no time zone" in capsys.readouterr().err


def test_an_unknown_suffix_is_refused(log, tmp_path):
    with pytest.raises(BrakebenchError, match="known are"):
        run(log, tmp_path / "a.xyz")
