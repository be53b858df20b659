"""The DBC really is the contract: other factors on the wire change nothing about the stop."""

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

import pytest
from processes import RUN_LIMIT_S

import dbc
from dbc.contract import contract
from dbc.frame import BusName

PACKAGE = Path(dbc.__file__).parent
SIGNALS = [
    f"{spec.name}.{field.signal}"
    for spec in contract(BusName.VEHICLE).by_id.values()
    for field in spec.fields
    if field.enum is None and field.signal != "ACTIVE_FAULTS" and not field.signal.startswith("CONFIDENCE")
]
STOP = """
import dbc
from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.exchange import Receiver
from ecu.node import EcuNode
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode
scenario = load_scenario("stop72")
plant, ecu = PlantNode(scenario.plant, scenario.manoeuvre, 1), EcuNode(scenario.ecu)
members = [Member(plant, 10_000_000), Member(ecu, 10_000_000, 5_000_000)]
receiver = Receiver([TruthMotion])
for step in lockstep(members):
    receiver.accept(step.now_ns, step.frames)
    motion = receiver.latest(TruthMotion)
    if motion and motion.manoeuvre is ManoeuvreState.FINISHED:
        print(dbc.__file__, motion.distance_m)
        break
    assert step.now_ns < 30_000_000_000
"""


def doubled(folder, names):
    """Copy the package ``dbc`` so that signals have twice their factor; the environment in which it is imported."""
    shutil.rmtree(folder / "dbc", ignore_errors=True)
    shutil.copytree(PACKAGE, folder / "dbc", ignore=shutil.ignore_patterns("__pycache__"))
    path = folder / "dbc" / "brake.dbc"
    text = path.read_text()
    for name in names:
        message, signal = name.split(".")
        head, body = text.split(f" {message}: ", 1)
        line = re.search(rf" SG_ {signal} : \S+ \(([^,]+),", body)
        factor = f"({2 * float(line[1]):.10g},"
        body = body[: line.start()] + line[0].replace(f"({line[1]},", factor) + body[line.end() :]
        text = f"{head} {message}: {body}"
    path.write_text(text)
    return {"PYTHONPATH": os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])}


def virtual_stop_m(folder, names=()):
    """Stopping distance where the package ``dbc`` is the copy in ``folder``; its folder is the process's own."""
    env = os.environ | doubled(folder, names)
    command = [sys.executable, "-c", STOP]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=RUN_LIMIT_S)
    assert done.returncode == 0, done.stderr
    path, distance_m = done.stdout.split()
    assert Path(path).is_relative_to(folder)
    return float(distance_m)


def to_blame(names, changes):
    """The signals that change the stop, as few as halving finds; several where they do so only together."""
    middle = len(names) // 2
    for half in (names[:middle], names[middle:]):
        if half and half != names and changes(half):
            return to_blame(half, changes)
    return names


@pytest.mark.slow
def test_doubled_factors_change_nothing_in_virtual_time(tmp_path):
    """All at once, and every second one, so that no two errors make up for each other."""
    plain_m = virtual_stop_m(tmp_path)

    def changes(names):
        return virtual_stop_m(tmp_path, names) != pytest.approx(plain_m, rel=3e-4)

    assert len(SIGNALS) > 40
    for names in (SIGNALS, SIGNALS[::2], SIGNALS[1::2]):
        assert not changes(names), to_blame(names, changes)


def test_what_changes_the_stop_is_found_by_halving():
    assert to_blame(SIGNALS, lambda names: SIGNALS[7] in names) == [SIGNALS[7]]
    assert to_blame(SIGNALS[:4], lambda names: {SIGNALS[0], SIGNALS[3]} <= set(names)) == SIGNALS[:4]


@pytest.mark.slow
def test_doubled_factors_change_nothing_in_real_time(brakebench, tmp_path, channel):
    """A busy machine moves single runs: where the first ones differ, medians of three decide."""
    names = ["EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "WHEEL_SPEED_REAR.WHEEL_SPEED_RL"]
    plain_m, doubled_m = [], []

    def differ():
        return statistics.median(doubled_m) != pytest.approx(statistics.median(plain_m), rel=5e-3)

    while not plain_m or (differ() and len(plain_m) < 3):
        for stops_m, changed in ((plain_m, ()), (doubled_m, names)):
            done = brakebench("run", "--json", "--bus", channel, env=doubled(tmp_path, changed))
            stops_m.append(json.loads(done.stdout)["stop_distance_m"])
    assert not differ(), (plain_m, doubled_m)
