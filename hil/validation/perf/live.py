"""Whether the live page disturbs the loop: lateness with three pages, with three that stand still, and without.

The pages are connections as a browser's: they read all that comes, or stop reading once they are open.
"""

import contextlib
import json
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from hil.rt.clock import WallClock
from hil.validation.perf.row import Progress, Row, unseen

PAGES = 3
ROUNDS = 3
_WAYS = ("without", "three pages", "three pages, browser stopped")
_START_LIMIT_NS = 300_000_000_000  # a first start compiles the plant
_SCENARIO = """title = "A long stop, to see how late the nodes are"
[start]
speed_mps = 20.0
[driver]
pedal = [[1.0, 0.0], [1.5, 0.2]]
[end]
duration_s = 12.0
after_standstill_s = false
"""


class _Late(NamedTuple):
    """Lateness of the worse node, ms, and ticks skipped by both."""

    p50_ms: float
    p99_ms: float
    max_ms: float
    overruns: float


def measure(progress: Progress = unseen) -> list[Row]:
    """Measure all ways in turn, and hold the medians against those without a page."""
    found: dict[str, list[_Late]] = {way: [] for way in _WAYS}
    for number in range(ROUNDS):
        for k, way in enumerate(_WAYS):
            progress((number + k / len(_WAYS)) / ROUNDS)
            with tempfile.TemporaryDirectory() as folder:
                found[way].append(_drive(way, Path(folder), number))
    medians = {way: _Late(*map(statistics.median, zip(*runs, strict=True))) for way, runs in found.items()}
    plain, rows = medians[_WAYS[0]], []
    for way in _WAYS[1:]:
        for what, unit, ours, other in zip(
            ("p50", "p99", "largest", "ticks skipped"), ("ms", "ms", "ms", ""), medians[way], plain, strict=True
        ):
            ratio = other / ours if ours else math.nan
            rows.append(Row(f"{way}: {what}", ours, other, "the same run without --live", ratio, unit))
    return rows


def _drive(way: str, folder: Path, number: int) -> _Late:
    """One run in real time; its lateness by its own word."""
    scenario, out = folder / "late.toml", folder / "out"
    scenario.write_text(_SCENARIO)
    bus = f"loopback:perf-live-{folder.name}-{number}"
    command = [sys.executable, "-m", "hil.cli.main", "run", str(scenario), "--realtime", "--json", "--bus", bus]
    command += ["--out", str(out), *(["--live"] if way != _WAYS[0] else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    with contextlib.ExitStack() as stack:
        stack.callback(process.kill)
        if way != _WAYS[0]:
            url = _address(out / "live.txt", process)
            for _ in range(PAGES):
                page = stack.enter_context(_page(url))
                if way == _WAYS[1]:
                    Thread(target=_read, args=(page,), daemon=True).start()
        text, _ = process.communicate()
    result: dict[str, Any] = json.loads(text)
    late = result["lateness_ms"]
    return _Late(late["p50"], late["p99"], late["max"], result["overruns"])


def _address(words: Path, process: "subprocess.Popen[str]") -> str:
    clock = WallClock()
    deadline_ns = clock.now_ns() + _START_LIMIT_NS
    while clock.now_ns() < deadline_ns and process.poll() is None:
        if words.exists() and (text := words.read_text()).endswith("\n"):
            return text.strip()
        clock.sleep_until(clock.now_ns() + 20_000_000)
    raise RuntimeError(f"the run did not serve its page; exit code {process.poll()}")


def _page(url: str) -> ClientConnection:
    """A page that is open and takes no more than a few messages by itself."""
    origin, _, token = url.partition("/?")
    address = f"{origin.replace('http', 'ws')}/socket?{token}"
    return connect(
        address, origin=Origin(origin), compression=None, proxy=None, max_size=None, max_queue=1, close_timeout=0.1,
        ping_interval=None,
    )  # fmt: skip


def _read(page: ClientConnection) -> None:
    with contextlib.suppress(ConnectionClosed):
        for _ in page:
            pass
