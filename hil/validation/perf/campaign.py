"""A campaign beside one plain loop of the same stops: rate, processor time of all its processes, memory, two workers.

`tiny` sends tasks that do nothing, or wait, through a real Dask scheduler on 127.0.0.1, for more cores than there are.
"""

import contextlib
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event

from hil.campaign.dask_workers import ClusterError, DaskWorkers
from hil.campaign.engine import LocalWorkers, Workers, work
from hil.campaign.perform import perform
from hil.campaign.plan import Plan, load_plan
from hil.campaign.store import Store
from hil.errors import BrakebenchError
from hil.rt.clock import monotonic_ns
from hil.validation.perf.row import Progress, Row, unseen

STOPS = 200
ROUNDS = 3
_FEW = 2  # stops of the campaign whose time is what starting and ending takes
TASK_S = 0.02
_CORES = 64  # that are played by threads which wait
_WORKERS = 2  # processes that hold them
_START_S = 60
_CAMPAIGN = """title = "stops beside a plain loop"
scenarios = ["stop72"]
method = "latin_hypercube"
count = {count}
recordings = "none"
[[vary]]
key = "plant.vehicle.mass_kg"
low = 1350.0
high = 1750.0
"""


@dataclass(frozen=True, slots=True)
class _Spent:
    """What some stops took: time and processor time of this process and its children, s; memory at a tenth of the
    parts and at the end, MiB."""

    wall_s: float
    cpu_s: float
    early_mib: float
    late_mib: float


def measure(progress: Progress = unseen, stops: int = STOPS) -> list[Row]:
    """The loop, and the campaign with one worker and with two, in turn; starting and ending are subtracted."""
    with tempfile.TemporaryDirectory() as folder:
        many, few = (_plan(Path(folder), count) for count in (stops, _FEW))
        _loop(few)  # compiles, loads
        names = ("loop", "one", "two")
        found: dict[str, list[_Spent]] = {name: [] for name in (*names, "few one", "few two")}
        for number in range(ROUNDS):
            progress(number / ROUNDS)
            for name, workers in (("one", 1), ("two", 2)):
                found[name].append(_campaign(many, Path(folder) / f"{name}{number}", workers))
                found[f"few {name}"].append(_campaign(few, Path(folder) / f"few{name}{number}", workers))
            found["loop"].append(_loop(many))
    rest = stops - _FEW
    wall = {"loop": [one.wall_s / stops for one in found["loop"]]}
    cpu = {"loop": [one.cpu_s / stops for one in found["loop"]]}
    for name in names[1:]:
        pairs = list(zip(found[name], found[f"few {name}"], strict=True))
        wall[name] = [(all_.wall_s - start.wall_s) / rest for all_, start in pairs]
        cpu[name] = [(all_.cpu_s - start.cpu_s) / rest for all_, start in pairs]
    loop_is, early_is = "a plain loop in one process", "the same after a tenth"
    starts = [one.wall_s for one in found["few one"]]
    late, early = ([getattr(one, name) for one in found["two"]] for name in ("late_mib", "early_mib"))
    return [
        _rates("stops a second, 1 worker", wall["one"], wall["loop"], loop_is),
        _rates("stops a second, 2 workers", wall["two"], wall["one"], "1 worker"),
        _times("processor time of a stop, 1 worker", cpu["one"], cpu["loop"], loop_is),
        _times("processor time of a stop, 2 workers", cpu["two"], cpu["loop"], loop_is),
        _row("memory of the command at the end", "MiB", late, early, early_is),
        _row("start and end, 1 worker", "s", starts, [one * stops for one in wall["loop"]], f"{stops} of the loop"),
    ]


def tiny(count: int, progress: Progress = unseen) -> list[Row]:
    """So many tasks through Dask: empty, and of `TASK_S` on `_CORES` played cores; one to a batch."""
    tasks = [[number] for number in range(count)]
    rows = []
    own = _tasks(tasks, 0.0, LocalWorkers(_WORKERS))
    with _cluster() as (address, scheduler, children):
        workers = DaskWorkers(address)
        _tasks(tasks[:_CORES], 0.0, workers)
        for k, (name, task_s) in enumerate((("empty", 0.0), (f"{TASK_S * 1e3:g} ms", TASK_S))):
            progress((k + 1) / 3)
            before, cpu, mine = _memory_mib(scheduler), _cpu_s(scheduler), _own_cpu_s()
            took_s = _tasks(tasks, task_s, workers)
            used = 1e3 * (_cpu_s(scheduler) - cpu) / count
            client = 1e3 * (_own_cpu_s() - mine) / count
            rate = count / took_s
            if task_s:
                other, other_is = _CORES / task_s, f"{_CORES} cores that never wait"
            else:
                other, other_is = count / own, "own processes"
            each_ms, each_is = 1e3 / rate, "time between two tasks"
            rows += [
                Row(f"tasks a second, {name}", rate, other, other_is, rate / other, "1/s"),
                Row(f"scheduler's time of a task, {name}", used, each_ms, each_is, each_ms / used, "ms"),
                Row(f"command's time of a task, {name}", client, each_ms, each_is, each_ms / client, "ms"),
                _row(f"scheduler's memory after, {name}", "MiB", [_memory_mib(scheduler)], [before], "before"),
            ]
        rows.append(_row("memory of a worker", "MiB", [_memory_mib(children[0])], [before], "the scheduler"))
        workers.leave()
    return rows


def _plan(folder: Path, count: int) -> Plan:
    path = folder / f"stops{count}.toml"
    path.write_text(_CAMPAIGN.format(count=count), encoding="utf-8")
    return load_plan(path)


def _loop(plan: Plan) -> _Spent:
    """What one would write without a campaign."""
    run = plan.runner
    return _spent(run(plan.run(number)) for number in range(plan.size))


def _campaign(plan: Plan, folder: Path, workers: int) -> _Spent:
    return _spent(perform(plan, Store(folder, plan), lambda _: LocalWorkers(workers)))


def _spent(steps: Iterator[object]) -> _Spent:
    cpu_s, began_ns = sum(os.times()[:4]), monotonic_ns()
    memory = [_memory_mib(os.getpid()) for _ in steps]
    wall_s = (monotonic_ns() - began_ns) * 1e-9
    return _Spent(wall_s, sum(os.times()[:4]) - cpu_s, memory[len(memory) // 10], memory[-1])


def _tasks(tasks: list[list[int]], task_s: float, workers: Workers) -> float:
    """Time of all tasks once the first has come back, s."""
    results = work(tasks, partial(wait_for, task_s), workers)
    next(results)
    began_ns = monotonic_ns()
    if sum(1 for _ in results) != len(tasks) - 1:
        raise BrakebenchError("a task was lost")
    return (monotonic_ns() - began_ns) * 1e-9


def wait_for(task_s: float, _number: int) -> None:
    """In a worker: take time, but no processor."""
    if task_s:
        Event().wait(task_s)


@contextlib.contextmanager
def _cluster() -> Iterator[tuple[str, int, list[int]]]:
    """A scheduler and its workers in processes of their own: address, its process, theirs."""
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        file = Path(folder) / "scheduler.json"
        words = [sys.executable, "-m", "dask"]
        quiet = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        host = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
        found = []
        for command in (
            [*words, "scheduler", "--port", "0", *host],
            *([*words, "worker", *host, "--no-nanny", "--nthreads", str(_CORES // _WORKERS)] for _ in range(_WORKERS)),
        ):
            process = subprocess.Popen(command, **quiet)  # type: ignore[call-overload]
            stack.callback(process.wait)
            stack.callback(process.kill)
            found.append(process)
            _until(file.exists, "its scheduler")
        address = str(json.loads(file.read_text())["address"])
        _until(lambda: _cores(address) == _CORES, "its workers")
        yield address, found[0].pid, [process.pid for process in found[1:]]


def _until(true: Callable[[], bool], what: str) -> None:
    for _ in range(10 * _START_S):
        if true():
            return
        Event().wait(0.1)
    raise BrakebenchError(f"Dask: {what} did not start within {_START_S} s")


def _cores(address: str) -> int:
    try:
        workers = DaskWorkers(address)
    except ClusterError:
        return 0
    workers.leave()
    return int(workers.count)


def _memory_mib(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def _cpu_s(pid: int) -> float:
    """Processor time of a process so far, s (proc(5): utime and stime)."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _own_cpu_s() -> float:
    return sum(os.times()[:2])


def _rates(name: str, ours_s: list[float], other_s: list[float], other_is: str) -> Row:
    return _row(name, "1/s", [1.0 / one for one in ours_s], [1.0 / one for one in other_s], other_is, larger=True)


def _times(name: str, ours_s: list[float], other_s: list[float], other_is: str) -> Row:
    return _row(name, "ms", [1e3 * one for one in ours_s], [1e3 * one for one in other_s], other_is)


def _row(name: str, unit: str, ours: list[float], other: list[float], other_is: str, larger: bool = False) -> Row:
    ratios = [a / b if larger else b / a for a, b in zip(ours, other, strict=True)]
    return Row(name, statistics.median(ours), statistics.median(other), other_is, statistics.median(ratios), unit)
