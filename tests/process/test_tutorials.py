"""The tutorials followed literally: every command of a page in one folder; what the page shows is printed."""

import gzip
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from processes import RUN_LIMIT_S

from hil.log.samples import log_path, sample_names
from hil.validation.doc_pages.sample_log import write

DOCS = Path(__file__).parents[2] / "docs"
PROGRAMS = {"brakebench": [sys.executable, "-m", "hil.cli.main"], "pytest": [sys.executable, "-m", "pytest", "-v"]}
FAILS = ("--brakebench-out",)  # the step that shows a test that fails


def blocks(page):
    return re.findall(r"```(\w*)\n(.*?)```", (DOCS / page).read_text(), re.DOTALL)


def flat(text):
    return " ".join(text.split())


@pytest.mark.slow
@pytest.mark.parametrize("page", ["tutorial-test.md", "tutorial-decode.md", "tutorial-explain.md"])
def test_the_page_followed_literally(page, tmp_path):
    environment = os.environ | {"PYTHONPATH": str(DOCS.parent)}
    said, shown = "", 0
    for kind, text in blocks(page):
        if kind == "python":
            (tmp_path / "test_stop.py").write_text(text)
        elif kind == "sh":
            said = ""
            for line in text.splitlines():
                program, *words = shlex.split(line)
                done = subprocess.run(
                    [*PROGRAMS.get(program, [program]), *words], cwd=tmp_path, env=environment, capture_output=True,
                    text=True, timeout=RUN_LIMIT_S,
                )  # fmt: skip
                assert done.returncode == int(any(word in FAILS for word in words)), done.stdout + done.stderr
                said += flat(done.stdout) + "\n"
        else:
            for line in text.splitlines():
                assert flat(line) in said, f"{page}: {line}\n{said}"
                shown += 1
    assert shown > 3
    names = set(re.findall(r"\b(?:stop|piece)\.(?:html|csv|parquet|blf)\b|\bfound/[a-z.]+", (DOCS / page).read_text()))
    assert all((tmp_path / name).stat().st_size > 500 for name in names)


def test_samples_are_found_by_name_and_small():
    assert sample_names() == ["weak_brake"]
    assert log_path("sample:weak_brake").stat().st_size < 300_000
    assert log_path("a.log") == Path("a.log")


@pytest.mark.slow
def test_the_sample_is_what_its_program_writes(tmp_path):
    write(tmp_path / "again.log.gz")
    was, now = (
        gzip.decompress(path.read_bytes()) for path in (log_path("sample:weak_brake"), tmp_path / "again.log.gz")
    )
    assert was == now
