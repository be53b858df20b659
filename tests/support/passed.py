"""Long runs that passed, by the state of the sources: CI leaves them out while that state lasts.

    python tests/support/passed.py drawn    # exit code 0 where the drawn cases passed with the sources as they are

Only a run that passes writes its file, and only with ``--write-passed``:

    pytest -n 2 -m drawn --write-passed tests/hidden/test_drawn.py
    pytest -n 2 --dist worksteal -m 'engine and not long' --write-passed
    .ci/vcan-lab python -m pytest tests/vcan tests/contract/test_bus.py tests/contract/test_clock.py --write-passed
    .ci/adapter-lab python -m pytest tests/adapter --write-passed
"""

import sys
import tomllib
from pathlib import Path
from typing import Any

from hil.validation.blind_trials.sources import digest

ROOT = Path(__file__).parents[2]
FILES = {
    "drawn": "tests/hidden/drawn.passed",
    "engine": "tests/pinned/engine.passed",
    "lab": "tests/vcan/lab.passed",
    "adapter": "tests/adapter/adapter.passed",
}
SOURCES = {
    "drawn": (
        "dbc", "plant", "hil/diagnosis", "hil/validation/reference_car", "hil/validation/blind_trials/run.py",
        "hil/validation/blind_trials/separable.py",
        "hil/validation/blind_trials/separability.toml", "tests/hidden/test_drawn.py", "tests/support/drawn.py",
    ),
    "engine": (
        "dbc", "plant", "hil/diagnosis", "hil/log", "hil/report", "hil/validation/reference_car",
        "hil/validation/strangers", "tests/hidden", "tests/pinned", "tests/unit/hil/diagnosis",
        "tests/support/engine.py", "tests/support/motion_logs.py", "tests/support/one_log.py",
        "tests/support/outsider.py", "tests/support/pinned.py", "tests/support/plant_logs.py",
        "tests/support/pulses.py", "tests/support/shared.py", "tests/support/single_track.py",
        *sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("tests/pinned/records/*.json")),
    ),
    "lab": (
        "dbc", "hil/bus", "hil/rt", "hil/bench/node_process.py", "hil/bench/real.py", "hil/bench/bench_run.py",
        "hil/bench/port.py", "hil/bench/recorder.py", "tests/vcan", "tests/contract/test_bus.py",
        "tests/contract/test_clock.py", "tests/support/candump.py", "tests/support/lab.py",
        "tests/support/processes.py", "tests/support/slcan_device.py", "tests/support/started.py",
        ".ci/vcan-lab", ".ci/vcan-lab-init",
    ),
    "adapter": (
        "dbc", "ecu/node.py", "ecu/diagnostics", "ecu/law/trouble_codes.py", "plant/demands.py", "hil/bus", "hil/rt",
        "hil/bench/node_process.py", "hil/bench/real.py", "hil/bench/bench_run.py", "hil/bench/hold.py",
        "hil/bench/port.py", "hil/bench/recorder.py", "hil/cli/ecu.py", "hil/cli/plant.py", "hil/cli/run.py",
        "tests/adapter", "tests/support/candump.py", "tests/support/lab.py", "tests/support/processes.py",
        "tests/support/started.py",
        ".ci/adapter-lab", ".ci/adapter-lab-init",
    ),
}  # fmt: skip
"""What the outcome of each run depends on."""


def lab_tests(name: str) -> set[str]:
    """Files whose tests run in the lab of a real SocketCAN, or in that of emulated adapters."""
    files = [ROOT / path for path in SOURCES[name] if path.startswith("tests/")]
    return {
        path.relative_to(ROOT).as_posix()
        for file in files
        for path in (file.rglob("test_*.py") if file.is_dir() else (file,))
        if path.name.startswith("test_")
    }


def state(name: str) -> str:
    """Sixteen hexadecimal digits that differ when the outcome of a run may."""
    return digest(ROOT / path for path in SOURCES[name])[:16]


def passed(name: str) -> bool:
    """Whether the run passed with the sources as they are."""
    file = ROOT / FILES[name]
    return file.exists() and tomllib.loads(file.read_text("utf-8")).get("state") == state(name)


def write(name: str, began: str, facts: dict[str, Any]) -> str:
    """Note that a run passes which began with a state; ``facts`` are for people. Says what was done."""
    if state(name) != began:
        return f"{FILES[name]} is not written: the sources changed during the run"
    lines = {"state": f'"{began}"', **facts}
    (ROOT / FILES[name]).write_text("".join(f"{key} = {value}\n" for key, value in lines.items()), "utf-8")
    return f"{FILES[name]} is written"


if __name__ == "__main__":
    sys.exit(not passed(sys.argv[1]))
