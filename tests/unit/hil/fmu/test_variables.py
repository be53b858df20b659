"""Names, units, bounds and places of an FMU's variables."""

import numpy as np
import pytest

from ecu.parameters.ecu import EcuParameters
from hil.fmu import ecu_unit, plant_unit
from hil.fmu.plant_unit import Start
from hil.fmu.units import exponents
from hil.fmu.variables import BOOLEANS, INTEGERS, Table, parameter_variables, with_parameters
from hil.scenario.parameters import ParameterError
from hil.scenario.scenario import load_scenario

SCENARIO = load_scenario("stop72")


def of(name, variables):
    return next(v for v in variables if v.name == name)


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("N m", {"kg": 1, "m": 2, "s": -2}),
        ("Nm/A", {"kg": 1, "m": 2, "s": -2, "A": -1}),
        ("1/(K s)", {"K": -1, "s": -1}),
        ("W s/(m K)", {"kg": 1, "m": 1, "s": -2, "K": -1}),
        ("W/(N m)2", {"kg": -1, "m": -2, "s": 1}),
        ("rad s2/m", {"rad": 1, "s": 2, "m": -1}),
        ("kg m2", {"kg": 1, "m": 2}),
        ("J/J", {}),
    ],
)
def test_units_come_down_to_base_units(unit, expected):
    assert exponents(unit) == expected


def test_an_unknown_unit_is_refused():
    with pytest.raises(ValueError, match="unknown symbol 'bar'"):
        exponents("bar/s")


def test_every_unit_of_both_fmus_is_known():
    variables = [*plant_unit.variables(SCENARIO.plant, Start(20.0, 300.0, 0.5)), *ecu_unit.variables(SCENARIO.ecu)]
    assert len({v.unit for v in variables if v.unit and exponents(v.unit)}) > 30


def test_names_are_those_of_dbc_and_parameter_sets_in_si():
    variables = plant_unit.variables(SCENARIO.plant, Start(20.0, 300.0, 0.5))
    pressure = of("EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", variables)
    assert (pressure.unit, pressure.causality, pressure.start) == ("Pa", "input", 0.0)
    assert of("BATTERY_STATUS.CHARGE_POWER_LIMIT", variables).unit == "W"
    assert of("MOTOR_STATUS_FRONT.FAULT_FL", variables).kind == "Int32"
    mass = of("vehicle.mass_kg", variables)
    assert (mass.start, mass.unit, mass.low, mass.high) == (SCENARIO.plant.vehicle.mass_kg, "kg", 300.0, 5000.0)
    assert of("vehicle.track_m_rear", variables).start == SCENARIO.plant.vehicle.track_m[1]
    assert len({v.name for v in variables}) == len(variables)


def test_the_controllers_whole_numbers_are_integers():
    assert of("supervision.frames_to_upgrade", ecu_unit.variables(SCENARIO.ecu)).kind == "Int32"


def test_a_changed_number_comes_into_the_set_and_all_others_stay():
    table = Table(list(parameter_variables(SCENARIO.ecu)))
    assert with_parameters(SCENARIO.ecu, table).vehicle == SCENARIO.ecu.vehicle
    table.reals[table.references["vehicle.track_m_rear"]] = 1.6
    table.integers[table.references["supervision.frames_to_upgrade"] - INTEGERS] = 12
    changed: EcuParameters = with_parameters(SCENARIO.ecu, table)
    assert changed.vehicle.track_m == (SCENARIO.ecu.vehicle.track_m[0], 1.6)
    assert changed.supervision.frames_to_upgrade == 12
    assert changed.compensation == SCENARIO.ecu.compensation


def test_a_number_out_of_bounds_is_refused_by_name():
    table = Table(list(parameter_variables(SCENARIO.plant)))
    table.reals[table.references["vehicle.mass_kg"]] = np.nan
    with pytest.raises(ParameterError, match=r"FMU\.vehicle\.mass_kg: expected"):
        with_parameters(SCENARIO.plant, table)


def test_references_of_kinds_do_not_meet():
    references = list(Table(ecu_unit.variables(SCENARIO.ecu)).references.values())
    assert len(set(references)) == len(references)
    assert max(r for r in references if r < INTEGERS) < INTEGERS < BOOLEANS <= max(references)
