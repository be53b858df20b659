"""A campaign that is disturbed: nothing is lost, nothing is different, and what kills is named."""

import hashlib
import json
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from killing import fatal, performed
from processes import wait_until

from hil.campaign.engine import LocalWorkers
from hil.campaign.plan import load_plan
from hil.errors import INTERRUPTED_EXIT_CODE, Verdict

pytestmark = pytest.mark.slow
FATAL_MPS = 4.25
CAMPAIGN = """title = "short stops"
scenarios = ["short.toml"]
[[vary]]
key = "start.speed_mps"
low = 3.0
high = 5.0
steps = {steps}
"""
PAGE = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text()


@pytest.fixture
def campaign(tmp_path, short):
    def write(steps, name="many.toml"):
        (tmp_path / name).write_text(CAMPAIGN.format(steps=steps))
        return name

    return write


def content(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (folder / "results").iterdir()}


def parts(folder):
    results = folder / "results"
    return [path for path in results.iterdir() if path.name.startswith("part")] if results.exists() else []


def workers_of(pid):
    """Processes of a campaign's pool."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
            words = (stat.parent / "cmdline").read_text()
        except OSError:
            continue
        if int(fields[1]) == pid and fields[0] != "Z" and "spawn_main" in words:
            found.append(int(stat.parent.name))
    return found


def test_results_do_not_hang_on_the_number_of_workers_nor_on_who_was_killed(brakebench, start, campaign, tmp_path):
    many = campaign(60)
    told = json.loads(brakebench("campaign", many, "--out", "calm", "--workers", "1", "--json").stdout)
    assert (told["verdict"], told["runs"]["Runs passed"]) == ("passed", 60)
    disturbed = start("campaign", many, "--out", "disturbed", "--workers", "2", "--json")
    wait_until(lambda: parts(tmp_path / "disturbed"), "the first results")
    os.kill(workers_of(disturbed.pid)[0], signal.SIGKILL)
    out, words = disturbed.communicate(timeout=240)
    assert disturbed.returncode == 0, words
    assert json.loads(out)["runs"]["Runs"] == 60
    assert content(tmp_path / "disturbed") == content(tmp_path / "calm")


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, INTERRUPTED_EXIT_CODE), (signal.SIGTERM, 5)]
)
def test_the_same_command_goes_on(brakebench, start, campaign, tmp_path, number, code):
    many = campaign(60)
    first = start("campaign", many, "--out", "out")
    wait_until(lambda: len(parts(tmp_path / "out")) > 3, "some results")
    pool = workers_of(first.pid)
    first.send_signal(number)
    out, words = first.communicate(timeout=240)
    assert first.returncode == code, words
    if number != signal.SIGKILL:
        assert "runs are done" in out
        assert "the same command goes on" in out
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pool), "the end of the workers", 30)
    kept = {path.name: path.stat().st_mtime_ns for path in parts(tmp_path / "out")}
    assert 3 < len(kept) < 60
    done = brakebench("campaign", many, "--out", "out")
    assert f"{len(kept)} of 60 parts stand in out; going on" in done.stderr
    assert "60 passed" in done.stdout
    assert all((tmp_path / "out" / "results" / name).stat().st_mtime_ns == at for name, at in kept.items())


def test_a_full_disk_ends_it_with_what_was_written_and_it_goes_on(brakebench, campaign, tmp_path):
    many = campaign(20)
    (tmp_path / "out" / "results").mkdir(parents=True)
    mounted = tmp_path / "limited.sh"
    # files of at most 1 kB: what a disk that fills up does to one file
    mounted.write_text('ulimit -f 1; exec "$@"\n')
    command = ["bash", str(mounted), sys.executable, "-m", "hil.cli.main", "campaign", many, "--out", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == Verdict.INCOMPLETE.exit_code, done.stderr
    assert "cannot be written" in done.stderr
    assert "File too large; what was written before stands, and the same command goes on" in done.stderr
    assert not parts(tmp_path / "out")
    assert "20 passed" in brakebench("campaign", many, "--out", "out").stdout


def test_a_run_that_kills_its_workers_is_named_and_the_others_finish(campaign, tmp_path):
    plan = load_plan(tmp_path / campaign(9))
    log = tmp_path / "killed.txt"
    rows = performed(plan, fatal(plan.runner, FATAL_MPS, log), LocalWorkers(2))
    assert [row["verdict"] for row in rows] == ["passed"] * 5 + ["killed"] + ["passed"] * 3
    assert rows[5]["reason"] == "its worker process ended 4 times in this run"
    assert 4 <= len(log.read_text().splitlines()) <= 6  # beside others once or twice before it is known


def test_dask_workers_give_the_same_and_what_kills_them_is_named(campaign, tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install 'brakebench[campaign]'")
    from hil.campaign.dask_workers import DaskWorkers

    plan = load_plan(tmp_path / campaign(9))
    own = performed(plan, plan.runner, LocalWorkers(1))
    log = tmp_path / "killed.txt"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        workers = DaskWorkers(cluster.scheduler_address)
        assert workers.count == 2
        assert performed(plan, plan.runner, workers) == own
        rows = performed(plan, fatal(plan.runner, FATAL_MPS, log), workers)
        workers.leave()
    assert [row["verdict"] for row in rows] == ["passed"] * 5 + ["killed"] + ["passed"] * 3
    assert len(log.read_text().splitlines()) == 8  # four among others, four alone


def test_a_killed_scheduler_ends_it_in_words_and_the_same_command_goes_on(brakebench, start, campaign, tmp_path):
    pytest.importorskip("distributed", reason="pip install 'brakebench[campaign]'")
    many, address = campaign(60), f"tcp://127.0.0.1:{free_port()}"

    def cluster():
        """A scheduler and its worker, as the page starts them."""
        dask = [sys.executable, "-m", "dask"]
        host, port = ("--host", "127.0.0.1"), address.rpartition(":")[2]
        scheduler = start("scheduler", *host, "--port", port, "--no-dashboard", program=dask)
        return scheduler, start("worker", address, *host, "--nthreads", "1", "--no-dashboard", program=dask)

    words = ("campaign", many, "--out", "out", "--scheduler", address)
    scheduler, _ = cluster()
    wait_until(lambda: has_worker(address), "the worker", 60)
    first = start(*words)
    wait_until(lambda: len(parts(tmp_path / "out")) > 3, "some results", 120)
    scheduler.kill()
    _, said = first.communicate(timeout=120)
    assert first.returncode == Verdict.INCOMPLETE.exit_code, said
    assert f"--scheduler {address}: has ended, or cannot be reached any more; what was written before stands" in said
    assert "Traceback" not in said
    kept = {path.name: path.stat().st_mtime_ns for path in parts(tmp_path / "out")}
    assert 3 < len(kept) < 60
    cluster()
    wait_until(lambda: has_worker(address), "the new worker", 60)
    done = brakebench(*words)
    assert f"{len(kept)} of 60 parts stand in out; going on" in done.stderr
    assert all((tmp_path / "out" / "results" / name).stat().st_mtime_ns == at for name, at in kept.items())
    brakebench("campaign", many, "--out", "calm", "--workers", "1")
    assert content(tmp_path / "out") == content(tmp_path / "calm")


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def has_worker(address):
    from distributed import Client

    try:
        with Client(address, timeout=1, set_as_default=False) as client:
            return bool(client.nthreads())
    except OSError:
        return False


def test_nobody_at_the_scheduler_is_said(brakebench, campaign):
    pytest.importorskip("distributed", reason="pip install 'brakebench[campaign]'")
    done = brakebench("campaign", campaign(3), "--scheduler", "tcp://127.0.0.1:1", check=2)
    assert "--scheduler tcp://127.0.0.1:1: nobody answers there" in done.stderr
    assert "dask scheduler" in done.stderr


def test_a_run_is_repeated_with_its_recording(brakebench, campaign, tmp_path):
    many = campaign(3)
    brakebench("campaign", many, "--out", "out")
    done = brakebench("campaign", many, "--repeat", "2", "--out", "again")
    assert "PASSED" in done.stdout
    assert (tmp_path / "again" / "recording.log").stat().st_size > 100_000
    assert "has runs 0 to 2" in brakebench("campaign", many, "--repeat", "3", check=2).stderr


def test_the_page_followed_literally(brakebench, tmp_path):
    """With a few of its runs."""
    text = re.search(r"```toml\n(title = .*?)```", PAGE, re.DOTALL)[1]
    few, times = re.subn(r"count = \d+", "count = 8", text)
    assert times == 1
    (tmp_path / "stops.toml").write_text(few)
    lines = "\n".join(re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)).splitlines()
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("brakebench") and "--scheduler" not in line]
    assert len(commands) >= 2
    for words in commands:
        brakebench(*words, check=(0, 1))
    assert list((tmp_path / "campaigns" / "stops" / "results").glob("part-*.parquet"))
    assert (tmp_path / "campaigns" / "stops" / "report.html").exists()
