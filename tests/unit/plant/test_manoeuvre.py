import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant import driver
from plant.manoeuvre import DirectDemands, Manoeuvre, SpeedPhase, value_at

RAMP = ((1.0, 0.0), (2.0, 10.0), (2.0, 20.0), (3.0, 0.0))


@pytest.mark.parametrize(
    ("time_s", "value"),
    [(-1.0, 0.0), (1.0, 0.0), (1.5, 5.0), (1.999, 9.99), (2.0, 20.0), (2.5, 10.0), (3.0, 0.0), (9.0, 0.0)],
)
def test_trace(time_s, value):
    assert value_at(RAMP, time_s) == pytest.approx(value)


def test_empty_trace_is_nothing():
    assert value_at((), 1.0) == 0.0


@given(st.floats(-10.0, 10.0))
def test_trace_stays_between_its_values(time_s):
    assert 0.0 <= value_at(RAMP, time_s) <= 20.0


def test_pedal_is_a_travel():
    assert driver.pedal_travel(Manoeuvre(20.0, 1.0, pedal=((0.0, 1.7),)), 0.0) == 1.0
    assert driver.pedal_travel(Manoeuvre(20.0, 1.0, pedal=((0.0, -1.0),)), 0.0) == 0.0


def test_target_speed_by_phase():
    manoeuvre = Manoeuvre(20.0, 9.0, speed_phases=(SpeedPhase(1.0, 2.0, 15.0), SpeedPhase(3.0, 4.0, 5.0)))
    assert [driver.target_speed(manoeuvre, t) for t in (0.5, 1.0, 2.0, 3.9, 4.0)] == [None, 15.0, None, 5.0, None]


def test_driver_feels_resistance_and_grade():
    level = driver.drive_force(20.0, 20.0, 1463.0, 300.0, 0.0)
    uphill = driver.drive_force(20.0, 20.0, 1463.0, 300.0, 0.05)
    assert level == 300.0
    assert uphill - level == pytest.approx(1463.0 * 9.81 * math.sin(math.atan(0.05)))
    assert driver.drive_force(80.0, 20.0, 1000.0, 0.0, 0.0) == 3000.0


def test_direct_demands_are_complete_only_for_all_wheels():
    one = ((0.0, 1.0),)
    assert not DirectDemands().complete
    assert not DirectDemands(pressure_pa=(one,) * 4).complete
    assert DirectDemands((one,) * 4, (one,) * 4).complete
