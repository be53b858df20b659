"""Lengths of frames beside those that can-utils' canbusload counts, bit stuffing included (`-e`)."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from collections.abc import Callable
from random import Random

import can
import pytest

from hil.bus.timed.frame_length import exact_bits
from hil.bus.timed.wire import WireFrame

LINE = re.compile(r"vcan0@500000\s+(\d+)\s+(\d+)")


def drawn(random: Random) -> WireFrame:
    extended = random.random() < 0.5
    remote = random.random() < 0.1
    n = 0 if remote else random.randint(0, 8)  # canbusload counts data of a remote frame, which sends none
    data = bytes(random.choice((0, 0xFF, 0x1F, 0x78, random.randrange(256))) for _ in range(n))
    return WireFrame(random.randrange(1 << (29 if extended else 11)), data, extended, remote)


def test_classical_frames_are_as_long_as_canbusload_counts(lab_vcan0: str, figure: Callable[[str], None]) -> None:
    """It prints frames and bits of each second: sums over all seconds agree to the bit."""
    if shutil.which("canbusload") is None:
        pytest.fail("no `canbusload` command (can-utils), although .ci/vcan-lab should have provided it")
    random = Random(7)
    frames = [drawn(random) for _ in range(500)]
    with (
        subprocess.Popen(["canbusload", "-e", f"{lab_vcan0}@500000"], stdout=subprocess.PIPE, text=True) as counting,
        can.Bus(interface="socketcan", channel=lab_vcan0) as bus,
    ):
        assert counting.stdout is not None
        counted_frames = counted_bits = 0
        try:
            while LINE.search(counting.stdout.readline()) is None:  # it listens from its first report on
                pass
            for frame in frames:
                bus.send(
                    can.Message(
                        arbitration_id=frame.can_id,
                        is_extended_id=frame.extended,
                        is_remote_frame=frame.remote,
                        data=frame.data,
                    )
                )
            until = time.monotonic() + 20.0
            while counted_frames < len(frames) and time.monotonic() < until:
                if found := LINE.search(counting.stdout.readline()):
                    counted_frames += int(found[1])
                    counted_bits += int(found[2])
        finally:
            counting.kill()
    ours = sum(exact_bits(frame).nominal for frame in frames)
    figure(f"{counted_frames} frames: {counted_bits} bits by canbusload -e, {ours} by ours")
    assert (counted_frames, counted_bits) == (len(frames), ours)
