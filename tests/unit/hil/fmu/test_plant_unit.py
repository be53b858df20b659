"""The plant between communication points: the same as the plant's node, whatever the importer's step."""

from dataclasses import replace

import numpy as np
import pytest

from hil.fmu.plant_unit import PlantUnit, Start, StateError
from hil.scenario.scenario import load_scenario
from plant.manoeuvre import DirectDemands, Manoeuvre, value_at
from plant.node import PlantNode
from plant.vectors import X

SCENARIO = load_scenario("stop72")
SPEED_MPS, CHARGE = 20.0, 0.6
PRESSURE = ((0.0, 0.0), (0.3, 4e6), (0.6, 1e6))
TORQUE = ((0.0, 0.0), (0.2, -150.0))
STEERING = ((0.0, 0.0), (0.5, 0.6))
WHEELS = ("FL", "FR", "RL", "RR")


def unit():
    one = PlantUnit(SCENARIO.plant, Start(SPEED_MPS, 423.15, CHARGE))
    one.preview()
    one.initialise()
    return one


def set_inputs(one, time_s):
    at = {"STEERING.STEERING_WHEEL_ANGLE": STEERING}
    for wheel in WHEELS:
        axle = "FRONT" if wheel[0] == "F" else "REAR"
        at[f"EHB_DEMAND_{axle}.PRESSURE_DEMAND_{wheel}"] = PRESSURE
        at[f"MOTOR_DEMAND_{axle}.TORQUE_DEMAND_{wheel}"] = TORQUE
    for name, trace in at.items():
        one.table.reals[one.table.references[name]] = value_at(trace, time_s)


def test_it_is_the_plants_node_bit_for_bit():
    one = unit()
    manoeuvre = Manoeuvre(
        SPEED_MPS, 10.0, steering_wheel_rad=STEERING, initial_state_of_charge=CHARGE, wait_for_demands=False,
        direct=DirectDemands((PRESSURE,) * 4, (TORQUE,) * 4),
    )  # fmt: skip
    node = PlantNode(SCENARIO.plant, manoeuvre, seed=1)
    node.step(0, [])
    for tick in range(1, 80):
        set_inputs(one, (tick - 1) * 10_000_000 * 1e-9)  # the node's own times, to the last bit
        one.advance_to(tick * 0.01)
        node.step(tick * 10_000_000, [])
        x = node.model_state
        assert one.table["TRUTH_MOTION.SPEED"] == x[X.speed_mps]
        assert one.table["TRUTH_DISC_TEMPERATURE.DISC_TEMPERATURE_RR"] == x[X.disc_temperature_k + 3]
    assert x[X.speed_mps] < 0.9 * SPEED_MPS
    measured = node._reports._batch.values  # not rounded as on the bus
    assert one.table["WHEEL_SPEED_FRONT.WHEEL_SPEED_FL"] in measured.tolist()
    assert one.table["BODY_MOTION.YAW_RATE"] in measured.tolist()


def run(steps_ms, one=None):
    one = one or unit()
    values, done = [], 0
    for step in steps_ms:
        set_inputs(one, done // 320 * 0.32)
        done += step
        one.advance_to(done * 1e-3)
        if done % 320 == 0:
            values.append(one.table.reals.copy())
    return np.array(values)


@pytest.mark.parametrize("step_ms", [10, 32])
def test_the_results_do_not_hang_on_the_importers_step(step_ms):
    assert (run([1] * 640) == run([step_ms] * (640 // step_ms))).all()


def test_half_steps_of_the_importer_are_whole_ones_of_the_car():
    halves, wholes = unit(), unit()
    for k in range(1, 41):
        halves.advance_to(k * 0.0005)
    wholes.advance_to(0.02)
    assert (halves.table.reals == wholes.table.reals).all()


def test_a_step_done_again_gives_the_same_bits():
    one = unit()
    run([32] * 20, one)
    state, other = one.state(), unit()
    for each in (one, other):
        each.restore(state)
        set_inputs(each, 0.64)
        each.advance_to(0.7)
    first = one.state()
    assert other.state() == first != state
    one.advance_to(1.5)
    one.restore(state)
    set_inputs(one, 0.64)
    one.advance_to(0.7)
    assert one.state() == first


def test_other_bytes_are_no_state():
    with pytest.raises(StateError, match="expected"):
        unit().restore(b"bbplant1" + bytes(100))


def test_parameters_and_start_take_effect():
    one = PlantUnit(SCENARIO.plant, Start(SPEED_MPS, 423.15, CHARGE))
    one.table.reals[one.table.references["vehicle.mass_kg"]] = 2000.0
    one.table.reals[one.table.references["start.speed_mps"]] = 30.0
    one.initialise()
    assert one.table["TRUTH_MOTION.SPEED"] == 30.0
    heavier = replace(SCENARIO.plant, vehicle=replace(SCENARIO.plant.vehicle, mass_kg=2000.0))
    other = PlantUnit(heavier, Start(30.0, 423.15, CHARGE))
    other.initialise()
    one.advance_to(0.1)
    other.advance_to(0.1)
    assert (one.table.reals == other.table.reals).all()


def test_a_demand_that_is_not_available_is_none_and_a_road_that_is_not_is_dry():
    one, other = unit(), unit()
    for name in ("EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "STIMULUS_ROAD.FRICTION_LEFT"):
        one.table.reals[one.table.references[name]] = np.nan
    one.advance_to(0.1)
    other.advance_to(0.1)
    assert one.table["TRUTH_MOTION.SPEED"] == other.table["TRUTH_MOTION.SPEED"]


def test_the_road_is_an_input():
    one = unit()
    one.table.reals[one.table.references["STIMULUS_ROAD.GRADE"]] = 0.1
    one.advance_to(1.0)
    assert one.table["TRUTH_MOTION.SPEED"] < SPEED_MPS - 0.8  # g sin(atan(0.1)) for a second
