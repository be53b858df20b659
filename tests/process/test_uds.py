"""The controller's process on the loopback, asked by udsoncan over can-isotp: all in real time, all in processes."""

import threading
import time

import can
import numpy as np
import pytest
from uds_whole_list import STANDING, plugged_in, run_the_whole_list, until_normal

from dbc.bench_messages import EcuTiming
from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus


@pytest.fixture
def standing(tmp_path, start, channel):
    """A bus with a standing car and its controller in NORMAL; python-can's bus beside them."""
    (tmp_path / "standing.toml").write_text(STANDING)
    for role in ("plant", "ecu"):
        start(role, "standing.toml", "--bus", channel)
    with can.Bus(interface="brakebench", channel=channel.partition(":")[2]) as bus:
        until_normal(bus)
        yield bus


def timing_of(bench, seconds):
    """Numbers, lateness, s, and skipped ones so far of the controller's ticks, as it reports them."""
    spec, found, end = spec_of(EcuTiming), [], time.monotonic() + seconds
    while time.monotonic() < end:
        for frame in bench.receive(0.1):
            if isinstance(frame, Frame) and frame.can_id == spec.can_id:
                found.append(spec.decode(frame.data))
    return zip(*found, strict=True)


@pytest.mark.slow
def test_the_whole_list_on_the_loopback(standing, channel):
    for params in ({}, {"stmin": 10, "blocksize": 4}):
        with plugged_in(standing, **params) as client:
            run_the_whole_list(client)
            time.sleep(2.0)  # the law has begun anew
    with plugged_in(standing) as client, open_bus(bench_channel(channel), BusName.BENCH) as bench:
        alone = timing_of(bench, 5.0)
        asked, stop = [], threading.Event()

        def hammer():
            while not stop.is_set():
                asked.append(client.read_data_by_identifier([0xF190, 0x0205]).positive)
                client.get_supported_dtc()

        thread = threading.Thread(target=hammer)
        thread.start()
        hammered = timing_of(bench, 5.0)
        stop.set()
        thread.join()
    assert len(asked) > 20
    assert all(asked)
    for what, (ticks, lateness_s, skipped) in (("alone", alone), (f"{2 * len(asked)} requests", hammered)):
        p50, p99 = np.percentile(lateness_s, (50, 99)) * 1e6
        print(f"lateness of {len(ticks)} ticks, {what}: median {p50:.0f} us, p99 {p99:.0f} us")
        assert np.all(np.diff(ticks) > 0)
        # requests leave the law its ticks; a busy machine takes some of them, not half
        assert skipped[-1] - skipped[0] < 0.5 * (ticks[-1] - ticks[0])
