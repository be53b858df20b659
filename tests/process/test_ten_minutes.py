"""The page for attaching an ECU, followed literally; the ECU is at another adapter, on a line between the two."""

import re
import shlex
import signal
import threading
from pathlib import Path

import pytest
from processes import RUN_LIMIT_S, wait_until
from slcan_device import SlcanDevice

pytest.importorskip("serial", reason="python-can's slcan needs pyserial")
PAGE = (Path(__file__).parents[2] / "docs" / "adapters.md").read_text()


def commands():
    """Commands of the numbered steps, as words."""
    steps = PAGE.split("## Attach your ECU in ten minutes")[1].split("\n## ")[0]
    return [shlex.split(block)[1:] for block in re.findall(r"```sh\n(.*?)```", steps, re.DOTALL)]


class Line:
    """Two adapters on one bus."""

    def __init__(self, *devices):
        self._on = True
        self._threads = [
            threading.Thread(target=self._pass, args=pair, daemon=True) for pair in (devices, devices[::-1])
        ]
        for thread in self._threads:
            thread.start()

    def _pass(self, one, other):
        while self._on:
            try:
                frame = one.receive(0.1)
            except TimeoutError:
                continue
            if other.is_open:
                other.send(frame)

    def close(self):
        self._on = False
        for thread in self._threads:
            thread.join()


@pytest.fixture
def devices():
    with SlcanDevice() as here, SlcanDevice() as there:
        line = Line(here, there)
        yield here, there
        line.close()


@pytest.mark.slow
def test_the_page_followed_literally(start, brakebench, devices, short, tmp_path):
    here, there = devices
    doctor, listen, plant, run, latency = (
        [word.replace("/dev/ttyACM0", f"{here.port}").replace("stop72", short) for word in words]
        for words in commands()
    )
    assert "adapters" in brakebench(*doctor).stdout
    ecu = start("ecu", short, "--bus", f"slcan:{there.port}", "--transmit")
    there.wait_open(timeout_s=RUN_LIMIT_S)
    table = brakebench(*listen).stdout
    assert re.search(r"EHB_DEMAND_FRONT +vehicle +\d+ +10 ", table)
    assert not [command for command in here.commands if command[:1] == "t"]
    car = start(*plant)
    wait_until(lambda: any(command[:1] == "t" for command in here.commands), "frames of the plant")
    car.send_signal(signal.SIGINT)
    assert car.wait(RUN_LIMIT_S) == 0
    done = brakebench(*run, check=(0, 4))
    assert "one process has the adapter" in done.stderr
    assert (tmp_path / "first" / "adapter.txt").exists()
    measured = brakebench(*latency).stdout
    age = re.search(r"WHEEL_SPEED_FRONT to EHB_DEMAND_FRONT +age +(\d+) +([\d.]+)", measured)
    assert int(age[1]) > 100
    assert 0.0 <= float(age[2]) < 20.0
    ecu.send_signal(signal.SIGINT)
    assert ecu.wait(RUN_LIMIT_S) == 0
    print(measured.splitlines()[1:5])
