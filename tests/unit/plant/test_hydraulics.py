import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant.hydraulics import pad_force, pedal_map_pa, pressure_jerk, sliding_torque, windup_held

LOOP = {"frequency_hz": 6.0, "damping": 0.9, "build_pa_s": 2.5e7, "release_pa_s": 4e7}
MAP = {"free_travel": 0.05, "linear_pa": 7.6e5, "square_pa": 4.08e6, "cubic_pa": 2.59e6}


def test_pressure_rests_at_its_demand(plain):
    assert plain(pressure_jerk)(30e5, 30e5, 0.0, **LOOP) == 0.0


def test_rate_does_not_grow_beyond_its_limits(plain):
    jerk = plain(pressure_jerk)
    assert jerk(180e5, 0.0, 2.5e7, **LOOP) == 0.0
    assert jerk(0.0, 180e5, -4e7, **LOOP) == 0.0
    assert jerk(180e5, 0.0, 2.4e7, **LOOP) > 0.0
    assert jerk(0.0, 180e5, 2.5e7, **LOOP) < 0.0  # back from the limit it may


@pytest.mark.parametrize(
    ("pressure_pa", "force_n"), [(0.0, 0.0), (5e4, 0.0), (-1e5, 0.0), (35e5, 0.97 * 2.55e-3 * 34.5e5)]
)
def test_clamping_force(plain, pressure_pa, force_n):
    assert plain(pad_force)(pressure_pa, 2.55e-3, 5e4, 0.97) == pytest.approx(force_n)


def test_sliding_torque_is_two_faces(plain):
    assert plain(sliding_torque)(0.38, 1000.0, 0.108) == pytest.approx(2 * 0.38 * 1000.0 * 0.108)


@given(st.floats(-1.0, 1.0), st.floats(-200.0, 200.0), st.floats(0.0, 0.1))
def test_brake_never_exceeds_its_friction(windup, speed, limit):
    held = getattr(windup_held, "py_func", windup_held)(windup, speed, 0.005, limit)
    assert -limit <= held <= limit
    if abs(speed) * 0.005 > abs(windup) + limit:
        assert abs(held) == limit
        assert held * speed >= 0.0


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_pedal_map_rises(one, other):
    low, high = sorted((one, other))
    assert 0.0 <= pedal_map_pa(low, **MAP) <= pedal_map_pa(high, **MAP)


def test_pedal_map_of_the_paper_car(paper_car):
    e = paper_car.ehb
    numbers = (e.pedal_free_travel, e.pedal_map_linear_pa, e.pedal_map_square_pa, e.pedal_map_cubic_pa)
    assert pedal_map_pa(0.05, *numbers) == 0.0
    # the map of the design asks for 3.04 m/s2 at 60 % travel, and 34 bar give 4.5 m/s2
    assert pedal_map_pa(0.60, *numbers) == pytest.approx(34e5 * 3.04 / 4.5, rel=0.02)
