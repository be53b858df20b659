"""The DBC really is the contract: another factor on the wire changes nothing about the stop."""

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

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
import sys
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
        print(motion.distance_m)
        break
    assert step.now_ns < 30_000_000_000
"""


def doubled(folder, name):
    """A copy of the package ``dbc`` in which one signal has twice its factor; what to put on PYTHONPATH."""
    message, signal = name.split(".")
    shutil.copytree(PACKAGE, folder / "dbc", ignore=shutil.ignore_patterns("__pycache__"))
    path = folder / "dbc" / "brake.dbc"
    head, body = path.read_text().split(f" {message}: ", 1)
    line = re.search(rf" SG_ {signal} : \S+ \(([^,]+),", body)
    factor = f"({2 * float(line[1]):.10g},"
    body = body[: line.start()] + line[0].replace(f"({line[1]},", factor) + body[line.end() :]
    path.write_text(f"{head} {message}: {body}")
    return {"PYTHONPATH": str(folder)}


def virtual_stop(env):
    command = [sys.executable, "-c", STOP]
    done = subprocess.run(command, env=os.environ | env, capture_output=True, text=True, timeout=150)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


@pytest.fixture(scope="module")
def plain_stop_m():
    return virtual_stop({})


@pytest.mark.slow
@pytest.mark.parametrize("name", SIGNALS)
def test_a_doubled_factor_changes_nothing_in_virtual_time(tmp_path, plain_stop_m, name):
    assert virtual_stop(doubled(tmp_path, name)) == pytest.approx(plain_stop_m, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "WHEEL_SPEED_REAR.WHEEL_SPEED_RL"])
def test_a_doubled_factor_changes_nothing_in_real_time(brakebench, tmp_path, channel, name):
    def median_m(env):
        runs = [json.loads(brakebench("run", "--json", "--bus", channel, env=env).stdout) for _ in range(3)]
        return statistics.median(run["stop_distance_m"] for run in runs)

    assert median_m(doubled(tmp_path, name)) == pytest.approx(median_m({}), rel=5e-3)
