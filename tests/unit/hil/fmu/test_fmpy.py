"""Exported FMUs in FMPy: valid, equal to our own run, state, clocks, and an end that hangs nobody."""

import os
import re
import signal
import sys
import zipfile
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy", reason="FMUs are tried with FMPy: pip install 'brakebench[fmu]'")

from ecu_alone import Alone, on_bus  # noqa: E402
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402
from fmu_instance import instance  # noqa: E402

from hil.fmu.export import export  # noqa: E402
from hil.fmu.ls_bus import Configuration, FormatError, Transmit, decode, encode_all  # noqa: E402
from hil.fmu.plant_unit import PlantUnit, Start  # noqa: E402
from hil.fmu.variables import RX_CLOCK, RX_DATA, TX_CLOCK, TX_DATA  # noqa: E402
from hil.scenario.scenario import load_scenario  # noqa: E402

pytestmark = pytest.mark.slow
SCENARIO = load_scenario("stop72")
START = {"start.speed_mps": 25.0, "vehicle.mass_kg": 1500.0}
PRESSURE = "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FR"
TORQUE = "MOTOR_DEMAND_REAR.TORQUE_DEMAND_RL", "MOTOR_DEMAND_REAR.TORQUE_DEMAND_RR"
BLOCK_MS = 320  # inputs change that often: a whole number of steps of 1, 10 and 32 ms


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    for kind in ("plant", "ecu"):
        export(kind, SCENARIO, folder / f"{kind}.fmu")
    return folder


@pytest.fixture(autouse=True)
def _python(monkeypatch):
    monkeypatch.setenv("BRAKEBENCH_PYTHON", sys.executable)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[4]))


def inputs(block):
    return dict.fromkeys(PRESSURE, 1e6 * (block + 1)) | dict.fromkeys(TORQUE, -50.0 * block)


@pytest.mark.parametrize("kind", ["plant", "ecu"])
def test_fmpy_finds_nothing_wrong_and_no_path_of_this_machine_is_inside(fmus, kind, tmp_path):
    path = fmus / f"{kind}.fmu"
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            assert not re.search(rb"/(tmp|home|root|work|usr/(local|src))/", archive.read(name)), name
    export(kind, SCENARIO, tmp_path / "again.fmu")
    assert (tmp_path / "again.fmu").read_bytes() == path.read_bytes()


def own_run(names, end_ms):
    one = PlantUnit(SCENARIO.plant, Start(25.0, 423.15, 0.7))
    for name, value in START.items():
        one.table.reals[one.table.references[name]] = value
    one.initialise()
    rows, began = [], perf_counter()
    for block in range(end_ms // BLOCK_MS):
        for name, value in inputs(block).items():
            one.table.reals[one.table.references[name]] = value
        for time_ms in range(block * BLOCK_MS, (block + 1) * BLOCK_MS, 10):
            one.advance_to((time_ms + 10) * 1e-3)
        rows.append([one.table[name] for name in names])
    return np.array(rows), (perf_counter() - began) * 1e6 / (end_ms / 10)


def test_the_plant_in_fmpy_is_our_own_run_at_every_step(fmus, capsys):
    end_ms = 3 * BLOCK_MS
    with instance(fmus / "plant.fmu") as one:
        names = one.names("output")
        assert len(names) == 50
        expected, own_us = own_run(names, end_ms)
        for step_ms in (1, 10, 32):
            one.fmu.reset()
            one.start(START)
            rows, began = [], perf_counter()
            for time_ms in range(0, end_ms, step_ms):
                if time_ms % BLOCK_MS == 0:
                    one.set(inputs(time_ms // BLOCK_MS))
                one.step(time_ms * 1e-3, step_ms * 1e-3)
                if (time_ms + step_ms) % BLOCK_MS == 0:
                    rows.append(one.get(names))
            us = (perf_counter() - began) * 1e6 / (end_ms / step_ms)
            with capsys.disabled():
                print(f"\nplant, steps of {step_ms} ms: {us:.0f} us in FMPy; ours of 10 ms {own_us:.0f} us")
            np.testing.assert_allclose(np.array(rows), expected, rtol=1e-9, atol=1e-9)


def test_fmpys_own_run_over_ten_seconds_with_the_step_it_chooses(fmus):
    names = ["TRUTH_MOTION.SPEED", "TRUTH_MOTION.DISTANCE"]
    result = fmpy.simulate_fmu(
        str(fmus / "plant.fmu"), stop_time=9.6, output_interval=0.32, output=names, start_values=START,
        input=np.array([(0.0, 1e6)], dtype=[("time", "f8"), (PRESSURE[0], "f8")]),
    )  # fmt: skip
    one = PlantUnit(SCENARIO.plant, Start(25.0, 423.15, 0.7))
    for name, value in (START | {PRESSURE[0]: 1e6}).items():
        one.table.reals[one.table.references[name]] = value
    one.initialise()
    one.advance_to(result["time"][-1])
    assert result["time"][-1] == pytest.approx(9.6)
    assert [result[name][-1] for name in names] == pytest.approx([one.table[name] for name in names], rel=1e-9)


def test_state_is_taken_set_and_carried_to_another_instance(fmus):
    with instance(fmus / "plant.fmu") as one:
        names = one.names("output")
        one.start(START)
        one.set(inputs(2))
        one.step(0.0, 0.5)
        state = one.fmu.getFMUState()
        carried = one.fmu.serializeFMUState(state)
        one.step(0.5, 0.123)
        first = one.get(names)
        one.set(inputs(9))
        one.step(0.623, 0.4)
        one.fmu.setFMUState(state)  # with what was set then
        one.step(0.5, 0.123)
        assert one.get(names) == first
        one.fmu.reset()
        one.start()
        assert one.get(["TRUTH_MOTION.SPEED"]) == [SCENARIO.manoeuvre.initial_speed_mps]
    with instance(fmus / "plant.fmu") as other:
        other.start()
        other.fmu.setFMUState(other.fmu.deserializeFMUState(carried))
        other.step(0.5, 0.123)
        assert other.get(names) == first


def test_a_number_out_of_bounds_is_refused_with_its_name_and_bounds(fmus):
    with instance(fmus / "plant.fmu") as one:
        with pytest.raises(FMICallException):
            one.start({"vehicle.mass_kg": 1.0})
        assert one.said == ["FMU.vehicle.mass_kg: expected 300 to 5000 kg, got 1.0"]


def test_a_process_that_dies_ends_the_run_with_words(fmus):
    with instance(fmus / "plant.fmu") as one:
        one.start()
        children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
        (child,) = [pid for pid in children if b"hil.fmu.serve" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        os.kill(int(child), signal.SIGKILL)
        with pytest.raises(FMICallException):
            one.step(0.0, 0.01)
        assert one.said == ["the process of brakebench behind one has ended; its last words are on the standard error"]
    assert not Path(f"/proc/{child}").exists()


def take(fmu):
    """What the controller says at an event."""
    return list(decode(fmu.getBinary([TX_DATA])[0])) if fmu.getClock([TX_CLOCK])[0] else []


def test_the_controller_on_a_bus_by_clocks_and_bytes(fmus):
    alone, unit = Alone(), on_bus()
    with instance(fmus / "ecu.fmu", event_mode=True) as one:
        fmu = one.fmu
        one.start()
        assert [type(operation) for operation in take(fmu)] == [Configuration, Configuration]
        unit.event(b"")
        fmu.updateDiscreteStates()
        for tick in range(1, 111):
            alone.now_ns = tick * 10_000_000 - 5_000_000
            frames = encode_all([Transmit(f.can_id, f.data) for f in alone.frames()])
            fmu.setClock([RX_CLOCK], [True])
            fmu.setBinary([RX_DATA], [frames])
            assert not fmu.updateDiscreteStates()[0]
            unit.event(frames)
            fmu.enterStepMode()
            event_needed, *_ = one.step((tick - 1) * 0.01, 0.01)
            unit.advance_to(tick * 0.01)
            assert event_needed
            fmu.enterEventMode()
            assert take(fmu) == list(decode(unit.outgoing))
        assert one.get(["EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL"])[0] > 1e6

        fmu.setClock([RX_CLOCK], [True])
        fmu.setBinary([RX_DATA], [b"\x99" * 9])
        assert fmu.updateDiscreteStates()[0]  # there is more at this event
        assert take(fmu) == [FormatError(b"\x99" * 9)]
        assert not fmu.updateDiscreteStates()[0]
        assert take(fmu) == []
        state = fmu.getFMUState()
        again = []
        for _ in range(2):
            fmu.setFMUState(state)
            fmu.enterStepMode()
            one.step(1.1, 0.05)
            again.append(fmu.getBinary([TX_DATA])[0])
        assert again[0] == again[1] != b""


def test_plant_and_controller_together_stop_the_car(fmus):
    pedal = dict.fromkeys(("BRAKE_PEDAL.PEDAL_TRAVEL_1", "BRAKE_PEDAL.PEDAL_TRAVEL_2"), 0.6)
    with instance(fmus / "plant.fmu") as car, instance(fmus / "ecu.fmu") as ecu:
        both = [name for name in car.names("output") if name in ecu.names("input")]
        demands = [name for name in ecu.names("output") if name in car.names("input")]
        whole = [name for name in car.names("output", "Int32") if name in ecu.names("input", "Int32")]
        assert (len(both), len(demands), len(whole)) == (21, 8, 6)
        car.start({"start.speed_mps": 15.0})
        ecu.start()
        for tick in range(500):
            ecu.set(dict(zip(both, car.get(both), strict=True)) | (pedal if tick > 150 else {}))
            states = car.fmu.getInt32([car.references[name] for name in whole])
            ecu.fmu.setInt32([ecu.references[name] for name in whole], states)
            car.set(dict(zip(demands, ecu.get(demands), strict=True)))
            car.step(tick * 0.01, 0.01)
            ecu.step(tick * 0.01, 0.01)
        assert ecu.fmu.getInt32([ecu.references["BRAKE_STATUS.MODE"]]) == [1]
        assert car.get(["TRUTH_MOTION.SPEED"])[0] < 5.0
