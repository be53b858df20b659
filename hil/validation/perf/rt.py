"""Time and buses: the loopback against a bare socket and python-can's ways, the loop against cyclictest.

Peers that are not installed are named on stderr and left out: gcc or cc (the floor), python-can-remote, cyclictest
(Debian's rt-tests).
"""

import json
import os
import re
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dbc.frame import BusName, Frame
from hil.bus import open_bus
from hil.rt.clock import monotonic_ns
from hil.rt.realtime import PRIORITY
from hil.validation.perf.row import Progress, Row, paired, unseen
from hil.validation.perf.rt_child import END_ID

ROUND_TRIPS = 4_000
PAIRS = 5
SECONDS = 2.0

FLOOR = r"""
#define _GNU_SOURCE
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>
static int64_t now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec * 1000000000LL + t.tv_nsec; }
static int by_value(const void *a, const void *b) { int64_t x = *(int64_t *)a, y = *(int64_t *)b; return (x > y) - (x < y); }
static void pin(int core) { cpu_set_t s; CPU_ZERO(&s); CPU_SET(core, &s); sched_setaffinity(0, sizeof s, &s); }
int main(int argc, char **argv) {
    int n = atoi(argv[1]), ends[2]; char frame[16] = {0}, back[16]; int64_t *took = malloc(8 * n);
    socketpair(AF_UNIX, SOCK_DGRAM, 0, ends);
    if (!fork()) { pin(atoi(argv[3])); for (int i = 0; i < n; i++) { recv(ends[1], frame, 16, 0); send(ends[1], frame, 16, 0); } _exit(0); }
    pin(atoi(argv[2]));
    for (int i = 0; i < n; i++) {
        memcpy(frame + 8, &i, 4); int64_t t = now(); send(ends[0], frame, 16, 0); recv(ends[0], back, 16, 0); took[i] = now() - t;
        if (memcmp(frame, back, 16)) return 1;
    }
    qsort(took, n, 8, by_value); printf("%f %f\n", took[n / 2] / 1e3, took[n * 99 / 100] / 1e3); return 0;
}
"""  # noqa: E501 - a line of C reads as one


def measure(progress: Progress = unseen) -> list[Row]:
    """Return the rows of ``brakebench perf rt``."""
    before = os.sched_getaffinity(0)
    here, there = min(before), max(before)  # two processes on two cores, on our side and on the others'
    os.sched_setaffinity(0, {here})
    try:
        rows = list(_against_floor(here, there))
        progress(0.25)
        rows += _against_remote(there)
        progress(0.5)
        rows.append(_in_process())
        progress(0.75)
    finally:
        os.sched_setaffinity(0, before)
    return rows + _against_cyclictest()


def _missing(what: str) -> None:
    print(f"perf rt: {what} is not installed; its rows are left out", file=sys.stderr)


@contextmanager
def _child(*arguments: str) -> Iterator[None]:
    command = [sys.executable, "-m", "hil.validation.perf.rt_child", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        if process.stdout.readline() != "ready\n":
            raise RuntimeError(f"perf rt: {' '.join(command)} did not start")
        try:
            yield
        finally:
            process.terminate()


def _times_us(exchange: Callable[[bytes], bytes]) -> np.ndarray:
    """Time round trips; what comes back must be what was sent."""
    times_ns = np.empty(ROUND_TRIPS)
    for number in range(ROUND_TRIPS):
        data = number.to_bytes(8, "little")
        start_ns = monotonic_ns()
        back = exchange(data)
        times_ns[number] = monotonic_ns() - start_ns
        if back != data:
            raise RuntimeError(f"perf rt: {data.hex()} came back as {back.hex()}")
    return times_ns * 1e-3


def _loopback_us(there: int) -> np.ndarray:
    spec = f"loopback:perf-{os.getpid()}"
    with _child("echo", str(there), spec), open_bus(spec, BusName.VEHICLE) as bus:

        def exchange(data: bytes) -> bytes:
            bus.send([Frame(BusName.VEHICLE, 1, data)])
            (frame,) = bus.receive(10.0)
            return frame.data if isinstance(frame, Frame) else b""

        times_us = _times_us(exchange)
        bus.send([Frame(BusName.VEHICLE, END_ID, b"")])
    return times_us


def _against_floor(here: int, there: int) -> list[Row]:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        _missing("a C compiler")
        return []
    with tempfile.TemporaryDirectory() as place:
        source, program = Path(place, "floor.c"), Path(place, "floor")
        source.write_text(FLOOR)
        subprocess.run([compiler, "-O2", "-w", "-o", program, source], check=True)

        def floor_us() -> tuple[float, float]:
            command = [str(program), str(ROUND_TRIPS), str(here), str(there)]
            p50, p99 = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
            return float(p50), float(p99)

        pairs = [(np.percentile(_loopback_us(there), [50, 99]), floor_us()) for _ in range(PAIRS)]
    other = "a Unix datagram in C, echoed: the floor"
    return [_row(f"loopback round trip p{q}", [(o[i], f[i]) for o, f in pairs], other) for i, q in enumerate((50, 99))]


def _row(name: str, pairs: list[tuple[float, float]], other_is: str) -> Row:
    ours, others = (statistics.median(side) for side in zip(*pairs, strict=True))
    return Row(name, ours, others, other_is, statistics.median(other / our for our, other in pairs), "us")


def _against_remote(there: int) -> list[Row]:
    import can

    if "remote" not in can.VALID_INTERFACES:
        _missing("python-can-remote")
        return []
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"ws://127.0.0.1:{port}/"
    command = [sys.executable, "-m", "can_remote", "-i", "virtual", "-c", "perf", "-H", "127.0.0.1", "-p", str(port)]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdout=quiet, stderr=quiet) as server:
        try:
            _listening(port)
            with _child("remote-echo", str(there), url), can.Bus(url, interface="remote", bitrate=500_000) as bus:

                def exchange(data: bytes) -> bytes:
                    bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=data))
                    while (message := bus.recv(10.0)) is not None:
                        if message.arbitration_id == 2:
                            return bytes(message.data)
                    return b""

                def theirs() -> float:
                    return float(np.median(_times_us(exchange)))

                def ours() -> float:
                    return float(np.median(_loopback_us(there)))

                return [paired("loopback round trip p50", ours, theirs, "python-can-remote", "us", pairs=PAIRS)]
        finally:
            server.terminate()


def _listening(port: int) -> None:
    give_up_ns = monotonic_ns() + 10_000_000_000
    while monotonic_ns() < give_up_ns:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
    raise RuntimeError("perf rt: python-can-remote's server does not listen")


def _in_process() -> Row:
    """Hand the same frames over between two members of one process, by the tick: 12 frames, then read."""
    import can

    ticks, batch = 300, 12
    numbers = range(batch)
    received: dict[str, list[tuple[int, bytes]]] = {}

    def ours() -> float:
        spec = f"loopback:perf-{os.getpid()}"
        with open_bus(spec, BusName.VEHICLE) as here, open_bus(spec, BusName.VEHICLE) as there:
            there.receive()
            start_ns, got = monotonic_ns(), []
            for tick in range(ticks):
                here.send([Frame(BusName.VEHICLE, n, tick.to_bytes(8, "little")) for n in numbers])
                got += there.receive()
            took_ns = monotonic_ns() - start_ns
        received["ours"] = [(f.can_id, f.data) for f in got if isinstance(f, Frame)]
        return took_ns / ticks / batch * 1e-3

    def theirs() -> float:
        with can.Bus("perf", interface="virtual") as here, can.Bus("perf", interface="virtual") as there:
            start_ns, got = monotonic_ns(), []
            for tick in range(ticks):
                for n in numbers:
                    here.send(can.Message(arbitration_id=n, is_extended_id=False, data=tick.to_bytes(8, "little")))
                while (message := there.recv(0.0)) is not None:
                    got.append(message)
            took_ns = monotonic_ns() - start_ns
        received["theirs"] = [(m.arbitration_id, bytes(m.data)) for m in got]
        return took_ns / ticks / batch * 1e-3

    row = paired("frame from one member to another, one process", ours, theirs, "python-can virtual", "us", pairs=PAIRS)
    if received["ours"] != received["theirs"] or len(received["ours"]) != ticks * batch:
        raise RuntimeError("perf rt: the loopback and python-can's virtual bus gave different frames")
    return row


def _against_cyclictest() -> list[Row]:
    if shutil.which("cyclictest") is None:
        _missing("cyclictest (rt-tests)")
        return []
    rows = []
    for rate_hz, spin_ns, how in ((1000, 0, "1 kHz"), (1000, 100_000, "1 kHz, spinning 100 us"), (100, 0, "100 Hz")):
        pairs = []
        for _ in range(PAIRS):
            fifo, ours_us = _loop_us(rate_hz, spin_ns)
            pairs.append((ours_us, _cyclictest_us(rate_hz, fifo)))
        policy = "SCHED_FIFO" if fifo else "SCHED_OTHER"
        for i, q in enumerate((50, 99)):
            figures = [(ours[i], theirs[i]) for ours, theirs in pairs]
            rows.append(_row(f"loop lateness p{q}, {how}, {policy}", figures, f"cyclictest, {policy}"))
    return rows


def _loop_us(rate_hz: int, spin_ns: int) -> tuple[bool, tuple[float, float]]:
    count = str(int(SECONDS * rate_hz))
    command = [
        sys.executable,
        "-m",
        "hil.validation.perf.rt_child",
        "ticks",
        str(1_000_000_000 // rate_hz),
        count,
        str(spin_ns),
    ]
    result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    p50, p99 = np.percentile(np.array(result["lateness_ns"]) * 1e-3, [50, 99])
    return result["fifo"], (p50, p99)


def _cyclictest_us(rate_hz: int, fifo: bool) -> tuple[float, float]:
    policy = ["-m", "-p", str(PRIORITY)] if fifo else ["--policy=other"]
    count, longest_us = int(SECONDS * rate_hz), 50_000
    command = ["cyclictest", "-q", "-t1", "-i", str(1_000_000 // rate_hz), "-l", str(count), "-h", str(longest_us)]
    done = subprocess.run([*command, *policy, "--laptop"], check=True, capture_output=True, text=True)
    bins = np.zeros(longest_us + 1, dtype=np.int64)
    for late_us, times in re.findall(r"^(\d{6}) (\d{6})", done.stdout, re.MULTILINE):
        bins[int(late_us)] = int(times)
    bins[longest_us] += count - bins.sum()  # later than the histogram reaches
    reached = bins.cumsum() / count
    return float(np.searchsorted(reached, 0.5)), float(np.searchsorted(reached, 0.99))
