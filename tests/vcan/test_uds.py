"""The controller's process on a bus of the kernel's, asked by udsoncan over can-isotp."""

from __future__ import annotations

import subprocess
from pathlib import Path

import can
from started import COMMAND
from uds_whole_list import STANDING, plugged_in, run_the_whole_list, until_normal


def test_the_whole_list_on_vcan(lab_vcan0: str, tmp_path: Path) -> None:
    scenario = tmp_path / "standing.toml"
    scenario.write_text(STANDING)
    started = [
        subprocess.Popen([*COMMAND, role, scenario.name, "--bus", f"socketcan:{lab_vcan0}"], cwd=tmp_path)
        for role in ("plant", "ecu")
    ]
    try:
        with can.Bus(interface="socketcan", channel=lab_vcan0) as bus:
            until_normal(bus)
            with plugged_in(bus) as client:
                run_the_whole_list(client)
    finally:
        for process in started:
            process.terminate()
            process.wait(60.0)
