"""The model as a whole: replays, cuts, batches, the inertial sensor on a grade, symmetry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plant.injection.bank import NO_TERMS
from plant.injection.plugin import NO_PLUGINS
from plant.injection.theta import THETA
from plant.integrate import EXPONENTIAL, RUNGE_KUTTA_4, SEMI_IMPLICIT
from plant.model import (
    NEUTRAL,
    Scene,
    advance,
    column_indices,
    compile_model,
    healthy,
    initial_state,
    pack,
    replay,
    simulate,
)
from plant.road import DRY, RoadSegment, road_table
from plant.vectors import BASE_RATES, CUT, INPUT, OUTPUT, PARAMETER, STATE, SWITCH, P, U, X, Y

ROWS = 300


@pytest.fixture
def stop(paper_car):
    """Start, inputs and parameters of three seconds of braking with brakes and motors."""
    inputs = np.zeros((ROWS, INPUT.size))
    inputs[30:, INPUT.slice("pressure_demand_pa")] = 25e5
    inputs[30:, INPUT.slice("motor_demand_nm")] = -80.0
    return initial_state(paper_car, 25.0, 423.15, 0.7), inputs, pack(paper_car)


def test_is_compiled_once_for_all_its_uses(stop):
    """A second kind of argument (a read-only vector, say) would double the first start."""
    if not hasattr(simulate, "signatures"):
        pytest.skip("numba is switched off: nothing is compiled")
    start, inputs, p = stop
    compile_model()
    replay(start, inputs[:3], p, ["speed_mps"])
    replay(start, inputs[:3], np.tile(p, (2, 1)), ["speed_mps"], Scene(theta=np.tile(NEUTRAL, (2, 1))))
    assert len(simulate.signatures) == 1


def test_own_pressure_at_the_pressure_cut_gives_the_same_stop(stop):
    """At the 10 ms of a log: what is left is the line drawn between its samples."""
    start, inputs, p = stop
    pressures = [f"pressure_pa_{w}" for w in ("fl", "fr", "rl", "rr")]
    first = replay(start, inputs, p, ["speed_mps", *pressures])[0]
    measured = inputs.copy()
    measured[:, INPUT.slice("pressure_demand_pa")] = 0.0
    measured[:, INPUT.slice("pressure_pa")] = first[:, 1:]
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0
    again = replay(start, measured, p, ["speed_mps"], Scene(cut=cut))[0]
    assert np.abs(again[:, 0] - first[:, 0]).max() < 2e-3


@pytest.mark.parametrize(("cut_name", "part", "source"), [
    ("motor_torque", "motor_torque_nm", "motor_torque_nm"),
    ("wheel_torque", "wheel_torque_nm", "wheel_torque_nm"),
    ("force", "longitudinal_force_n", "longitudinal_force_n"),
    ("motor_speed", "wheel_speed_rad_s", "state.wheel_speed_rad_s"),
])  # fmt: skip
def test_own_values_at_the_other_cuts(stop, cut_name, part, source):
    start, inputs, p = stop
    columns = [f"{source}_{w}" for w in ("fl", "fr", "rl", "rr")]
    first = replay(start, inputs, p, ["speed_mps", *columns])[0]
    measured = inputs.copy()
    measured[:, INPUT.slice(part)] = first[:, 1:]
    cut = CUT.zeros()
    cut[CUT.slice(cut_name)] = 1.0
    again = replay(start, measured, p, ["speed_mps"], Scene(cut=cut))[0]
    assert np.abs(again[:, 0] - first[:, 0]).max() < 0.02


def test_demand_still_makes_its_pressure_while_a_measured_one_brakes(stop):
    start, inputs, p = stop
    inputs[:, INPUT.slice("pressure_pa")] = 10e5
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0
    table = replay(start, inputs, p, ["pressure_pa_fl", "state.pressure_pa_fl"], Scene(cut=cut))[0]
    assert table[-1, 0] == 10e5
    assert table[-1, 1] == pytest.approx(25e5, rel=1e-3)


def test_motors_keep_to_their_limits_at_the_measured_speed(stop):
    start, inputs, p = stop
    inputs[:, INPUT.slice("motor_demand_nm")] = -500.0
    inputs[:, INPUT.slice("wheel_speed_rad_s")] = 1.0  # a measured crawl: braking has faded out
    cut = CUT.zeros()
    cut[CUT.slice("motor_speed")] = 1.0
    faded = replay(start, inputs, p, ["motor_torque_nm_fl"], Scene(cut=cut))[0]
    driven = replay(start, inputs, p, ["motor_torque_nm_fl"])[0]
    assert np.abs(faded).max() == 0.0
    assert driven.min() < -100.0


def test_one_wheel_can_be_cut_alone(stop):
    start, inputs, p = stop
    cut = CUT.zeros()
    cut[CUT.slice("pressure").start] = 1.0  # fl, its measured pressure stays 0
    table = replay(start, inputs, p, ["friction_torque_nm_fl", "friction_torque_nm_fr"], Scene(cut=cut))[0]
    assert table[-1, 0] == 0.0
    assert table[-1, 1] < -300.0


def test_batch_equals_single_runs_in_any_number_of_threads(stop, paper_car):
    start, inputs, p = stop
    heavy = pack(replace(paper_car, vehicle=replace(paper_car.vehicle, mass_kg=1600.0)))
    cars = np.stack([p, heavy, p])
    together = replay(start, inputs, cars, ["speed_mps", "pad_friction_rr"], workers=2)
    assert np.array_equal(together[0], replay(start, inputs, p, ["speed_mps", "pad_friction_rr"])[0])
    assert np.array_equal(together[0], together[2])
    assert together[1, -1, 0] > together[0, -1, 0] + 0.5


def test_replay_leaves_its_start_alone(stop):
    start, inputs, p = stop
    before = start.copy()
    replay(start, inputs, p, ["speed_mps"])
    assert np.array_equal(start, before)


def test_unknown_columns_are_named():
    with pytest.raises(KeyError, match="spede_mps"):
        column_indices(["speed_mps", "spede_mps"])


@pytest.mark.parametrize("method", [SEMI_IMPLICIT, RUNGE_KUTTA_4, EXPONENTIAL])
def test_a_straight_stop_stays_straight(stop, method):
    start, inputs, p = stop
    table = replay(start, inputs, p, ["lateral_speed_mps", "yaw_rate_rad_s", "y_m"], method=method)[0]
    assert np.abs(table).max() < 1e-9


def test_long_exponential_steps_beat_short_simple_ones(stop):
    """Demands without edges: twice the step of the semi-implicit method, a fifth of its error and less."""
    start, inputs, p = stop
    wave = 1.0 - np.cos(np.arange(ROWS) * 0.01 * 2.0 * math.pi)[:, None]
    smooth = inputs.copy()
    smooth[:, INPUT.slice("pressure_demand_pa")] = 8e5 * wave
    smooth[:, INPUT.slice("motor_demand_nm")] = -60.0 * wave
    columns = ["state.speed_mps", "state.wheel_speed_rad_s_fl", "state.pressure_pa_fl", "state.imu_longitudinal_mps2"]

    def driven(method, steps):
        return replay(start, smooth, p, columns, steps=steps, step_s=0.01 / steps, method=method)[0]

    exact = driven(RUNGE_KUTTA_4, 20)
    long_steps = np.sqrt(((driven(EXPONENTIAL, 2) - exact) ** 2).mean(axis=0))
    short_steps = np.sqrt(((driven(SEMI_IMPLICIT, 4) - exact) ** 2).mean(axis=0))
    assert (long_steps < 0.2 * short_steps).all(), (long_steps, short_steps)


def test_long_steps_of_a_rolling_car_keep_its_swing(stop):
    """Torque in steps, 5 ms at once: the wheel swings on its tyre at 25 Hz, and the body takes all the force."""
    start, inputs, p = stop
    inputs[:, INPUT.slice("motor_demand_nm")] = 0.0
    inputs[:, INPUT.slice("pressure_demand_pa")] = 0.0
    inputs[:, INPUT.slice("motor_torque_nm")] = np.where(np.arange(ROWS) // 40 % 2, -200.0, 0.0)[:, None]
    cut = CUT.zeros()
    cut[CUT.slice("motor_torque")] = 1.0
    columns = ["state.wheel_speed_rad_s_fl", "state.speed_mps", "state.imu_longitudinal_mps2"]

    def driven(method, steps):
        return replay(start, inputs, p, columns, Scene(cut=cut), steps=steps, step_s=0.01 / steps, method=method)[0]

    exact = driven(RUNGE_KUTTA_4, 20)
    error = np.abs(driven(EXPONENTIAL, 2) - exact)
    swing = exact[40:60, 0] - np.linspace(exact[40, 0], exact[59, 0], 20)
    assert np.ptp(swing) > 0.5
    assert error[:, 0].max() < 0.05 * np.ptp(swing)
    assert error[:, 1].max() < 1e-3
    assert error[:, 2].max() < 0.05 * np.ptp(exact[:, 2])


def test_a_light_wheel_does_not_go_wild_where_a_rolling_car_begins_to_creep(paper_car):
    """10 ms at once, through 3 m/s: steps that damp the wheel at speed let it grow below."""
    light = replace(paper_car, wheel=replace(paper_car.wheel, inertia_kg_m2=(0.35, 0.35)))
    inputs = np.zeros((150, INPUT.size))
    inputs[:, INPUT.slice("motor_torque_nm")] = -60.0
    cut = CUT.zeros()
    cut[CUT.slice("motor_torque")] = 1.0

    def driven(method, steps):
        start = initial_state(light, 3.3, 350.0, 0.7)
        columns = ["state.wheel_speed_rad_s_fl", "state.speed_mps"]
        return replay(
            start, inputs, pack(light), columns, Scene(cut=cut), steps=steps, step_s=0.01 / steps, method=method
        )[0]

    exact = driven(RUNGE_KUTTA_4, 20)
    assert exact[0, 1] > 3.0 > exact[-1, 1] > 0.5
    assert np.abs(driven(EXPONENTIAL, 1) - exact).max() < 0.05


@pytest.mark.parametrize("inertia", [1.0, 0.2])
@pytest.mark.parametrize(("slope", "speed_mps", "most"), [
    (0.0, 0.0, (1e-4, 1e-3)), (1e-4, 0.0, (1e-3, 1e-2)), (0.0, 0.3, (3e-3, 3e-2)),
])  # fmt: skip
def test_long_steps_of_a_car_that_stands_rest(paper_car, inertia, slope, speed_mps, most):
    """10 ms at once: pressures rise on a car that stands, creeps a little, or still rolls, after its wheels stood."""
    light = replace(paper_car, wheel=replace(paper_car.wheel, inertia_kg_m2=(inertia, inertia)))
    inputs = np.zeros((400, INPUT.size))
    inputs[100:, INPUT.slice("pressure_demand_pa")] = 20e5
    theta = NEUTRAL.copy()
    theta[THETA.slice("road_grade", "grade")] = slope

    def driven(method, steps):
        start = initial_state(light, speed_mps, 350.0, 0.7)
        columns = ["state.wheel_speed_rad_s_fl", "state.imu_longitudinal_mps2"]
        how = {"steps": steps, "step_s": 0.01 / steps, "method": method}
        return replay(start, inputs, pack(light), columns, Scene(theta=theta), **how)[0]

    error = np.abs(driven(EXPONENTIAL, 1) - driven(RUNGE_KUTTA_4, 20))[150:]
    assert (error.max(axis=0) < most).all(), error.max(axis=0)


def test_long_steps_keep_the_mark_of_a_soft_hub(stop):
    start, inputs, p = stop
    theta = NEUTRAL.copy()
    theta[THETA.slice("sus_compliance", "compliance_m_n")] = 2.5e-7

    def mark(method, steps):
        both = [
            replay(start, inputs, p, ["state.wheel_speed_rad_s_fl"], Scene(theta=one), steps=steps,
                   step_s=0.01 / steps, method=method)[0, :, 0]
            for one in (NEUTRAL, theta)
        ]  # fmt: skip
        return both[1] - both[0]

    exact = mark(RUNGE_KUTTA_4, 20)
    assert np.linalg.norm(mark(EXPONENTIAL, 4) - exact) < 0.1 * np.linalg.norm(exact)


@pytest.mark.parametrize("late_s", [0.0, 0.25e-3, 0.75e-3, 1.25e-3, 1.75e-3])
def test_a_limited_rate_of_pressure_leaves_its_limit_in_time(stop, late_s):
    """Wherever in a step it passes the limit; what it exceeded it by would keep it there."""
    start, inputs, p = stop
    demand = np.repeat([0.0, 30e5, 8e5, 45e5, 30e5, 0.0], [5, 15, 11, 21, 18, 30])
    inputs = inputs[: len(demand)].copy()
    inputs[:, INPUT.slice("pressure_demand_pa")] = demand[:, None]
    late = p.copy()
    late[P.ehb_dead_time_s] += late_s

    def pressure(method, steps):
        return replay(start, inputs, late, ["state.pressure_pa_fl"], steps=steps, step_s=0.01 / steps, method=method)

    exact = pressure(RUNGE_KUTTA_4, 20)
    for method, steps, rms_pa in ((EXPONENTIAL, 4, 1e3), (RUNGE_KUTTA_4, 10, 2e2)):
        error = pressure(method, steps) - exact
        assert math.sqrt(float(np.mean(error**2))) < rms_pa, (method, late_s)


def test_left_and_right_bends_mirror_each_other(stop):
    start, inputs, p = stop
    left, right = inputs.copy(), inputs.copy()
    left[:, INPUT.slice("steering_wheel_rad")] = 0.5
    right[:, INPUT.slice("steering_wheel_rad")] = -0.5
    columns = ["yaw_rate_rad_s", "y_m", "roll_rad", "imu_lateral_mps2", "wheel_load_n_fl"]
    one = replay(start, left, p, columns)[0]
    other = replay(start, right, p, [*columns[:4], "wheel_load_n_fr"])[0]
    assert one[:, :4] == pytest.approx(-other[:, :4], abs=1e-6)
    assert one[:, 4] == pytest.approx(other[:, 4], abs=1e-6)
    assert one[-1, 0] > 0.1  # a steering wheel turned left turns the car left


def test_inertial_sensor_on_a_grade(paper_car):
    """It feels the specific force: at rest on a grade g sin, whatever the wheels say."""
    inputs = np.zeros((600, INPUT.size))
    inputs[:, INPUT.slice("pressure_demand_pa")] = 40e5
    start = initial_state(paper_car, 0.0, 423.15, 0.7)
    road = road_table((RoadSegment(-1e9, grade=0.05),))
    table = replay(start, inputs, pack(paper_car), ["imu_longitudinal_mps2", "pitch_rad"], Scene(road=road))[0]
    felt, pitch = table[-1]
    assert felt == pytest.approx(9.81 * math.sin(math.atan(0.05) - pitch), abs=2e-3)
    assert pitch < 0.0  # nose up


def test_braking_dives_and_the_sensor_feels_more_than_the_car_does(stop):
    start, inputs, p = stop
    table = replay(start, inputs, p, ["pitch_rad", "imu_longitudinal_mps2", "acceleration_mps2"])[0]
    pitch, felt, true = table[-1]
    assert math.degrees(pitch) / (-true / 9.81) == pytest.approx(1.3, abs=0.2)  # deg/g, nose down
    assert felt == pytest.approx(true * math.cos(pitch) - 9.81 * math.sin(pitch), abs=0.05)


def test_dead_motor_and_refusing_battery(stop):
    start, inputs, p = stop
    switch = healthy()
    switch[SWITCH.slice("motor_alive").start] = 0.0
    table = replay(start, inputs, p, ["motor_torque_nm_fl", "motor_torque_nm_fr"], Scene(switch=switch))[0]
    assert table[-1].tolist() == pytest.approx([0.0, -80.0], abs=0.1)
    switch = healthy()
    switch[SWITCH.slice("battery_accepts")] = 0.0
    table = replay(start, inputs, p, ["motor_torque_nm_fl", "motor_available_nm_fl"], Scene(switch=switch))[0]
    assert np.abs(table).max() < 1e-9
    switch = healthy()
    switch[SWITCH.slice("battery_announces")] = 0.0
    columns = ["motor_torque_nm_fl", "motor_available_nm_fl", "charge_power_limit_w"]
    table = replay(start, inputs, p, columns, Scene(switch=switch))[0]
    assert table[-1, 0] == pytest.approx(-80.0, abs=0.1)
    assert table[-1, 1] > 80.0
    assert table[-1, 2] == 0.0


def test_dead_time_is_one(paper_car):
    inputs = np.zeros((20, INPUT.size))
    inputs[5:, INPUT.slice("pressure_demand_pa")] = 20e5
    start = initial_state(paper_car, 20.0, 423.15, 0.7)
    pressure = replay(start, inputs, pack(paper_car), ["pressure_pa_fl"])[0][:, 0]
    assert pressure[:8].max() == 0.0  # demanded at 50 ms, nothing up to 70 ms
    assert pressure[8] > 0.0


def test_split_friction_under_left_and_right_wheels(stop):
    start, inputs, p = stop
    road = road_table((RoadSegment(-1e9, 0.9, 0.3),))
    table = replay(
        start, inputs[:40], p, ["road_friction_fl", "road_friction_fr", "road_friction_rr"], Scene(road=road)
    )[0]
    assert table[0].tolist() == [0.9, 0.3, 0.3]


def test_nothing_goes_wild_far_from_the_road(paper_car):
    """Full steering, full brakes and motors at 60 m/s on ice: finite, and the car slows down."""
    inputs = np.zeros((1500, INPUT.size))
    inputs[:, INPUT.slice("pressure_demand_pa")] = 180e5
    inputs[:, INPUT.slice("motor_demand_nm")] = -700.0
    inputs[:, U.steering_wheel_rad] = 8.0
    start = initial_state(paper_car, 60.0, 423.15, 0.7)
    road = road_table((RoadSegment(-1e9, 0.3, 0.05), RoadSegment(200.0, 1.0, 0.6, 0.1)))
    for method, steps in ((SEMI_IMPLICIT, 10), (RUNGE_KUTTA_4, 10), (EXPONENTIAL, 2)):
        x, y = start.copy(), OUTPUT.zeros()
        for row in inputs:
            advance(x, row, pack(paper_car), y, steps, Scene(road=road), 0.01 / steps, method)
            assert np.isfinite(x).all()
            assert np.isfinite(y).all()
        assert math.hypot(x[X.speed_mps], x[X.lateral_speed_mps]) < 40.0
        assert y[OUTPUT.slice("wheel_load_n")].min() >= 0.0


def test_zero_steps_only_look(stop):
    start, inputs, p = stop
    x, y = start.copy(), OUTPUT.zeros()
    advance(x, inputs[0], p, y, 0, Scene())
    assert np.array_equal(x, start)
    assert y[Y.wheel_load_n] == pytest.approx(1463.0 * 9.81 * 1.39 / 2.59 / 2.0)
    assert STATE.size == x.size


def _run(start, inputs, p, step_s, steps, at_once, cut):
    x, table = start.copy(), np.empty((len(inputs), 1))
    columns = column_indices(["speed_mps"])
    simulate(
        x, inputs, cut, healthy(), p, road_table(DRY), step_s, steps, np.full(len(inputs), at_once, np.int64),
        EXPONENTIAL, columns, table, OUTPUT.zeros(), NEUTRAL, NO_TERMS, NO_PLUGINS,
    )  # fmt: skip
    return x


def test_steps_made_as_one_are_longer_steps(stop):
    """What is remembered of the demand counts steps, so there its mean over them acts."""
    start, inputs, p = stop
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0
    inputs[30:, INPUT.slice("pressure_pa")] = 25e5
    apart = slice(0, BASE_RATES.size)
    one = _run(start, inputs, p, 1e-3, 10, 5, cut)
    other = _run(start, inputs, p, 5e-3, 2, 1, cut)
    made = STATE.slice("pressure_pa").start, STATE.slice("pressure_rate_pa_s").start
    same = [k for k in range(BASE_RATES.size) if not any(m <= k < m + 4 for m in made)]
    assert one[same] == pytest.approx(other[same], rel=1e-12, abs=1e-12)
    assert one[apart] == pytest.approx(other[apart], rel=1e-3, abs=1e-3)
    short = _run(start, inputs, p, 1e-3, 10, 1, cut)
    assert one[X.speed_mps] == pytest.approx(short[X.speed_mps], abs=2e-3)


@pytest.mark.parametrize("at_once", [1, 2, 4])
def test_a_torque_bent_between_two_rows_does_what_its_mean_does(stop, at_once):
    start, inputs, p = stop
    cut = CUT.zeros()
    cut[CUT.slice("motor_torque")] = cut[CUT.slice("force")] = 1.0
    inputs = np.zeros((12, INPUT.size))
    straight = _run(start, inputs, p, 2.5e-3, 4, at_once, cut)
    inputs[5, INPUT.slice("motor_torque_bend_nm")] = -60.0
    bent = _run(start, inputs, p, 2.5e-3, 4, at_once, cut)
    turned = bent[STATE.slice("wheel_speed_rad_s")] - straight[STATE.slice("wheel_speed_rad_s")]
    assert turned == pytest.approx(np.full(4, -60.0 * 2.0 / 3.0 * 0.01 / p[P.wheel_inertia_kg_m2]), rel=3e-3)


def test_links_support_motors_with_their_own_tangent(stop):
    """Under motors alone more support for brakes changes nothing, more for motors takes off a third of the dive."""
    start, inputs, p = stop
    inputs[:, INPUT.slice("pressure_demand_pa")] = 0.0
    pitch = {}
    for of in ("brake", "drive"):
        carried = p.copy()
        carried[PARAMETER.slice(f"suspension_{of}_support_tangent")] += 0.2
        pitch[of] = replay(start, inputs, carried, ["pitch_rad"])[0][-1, 0]
    plain = replay(start, inputs, p, ["pitch_rad"])[0][-1, 0]
    assert pitch["brake"] == pytest.approx(plain, rel=1e-6)
    assert pitch["drive"] < 0.7 * plain


def test_drag_moves_load_as_the_force_that_stops_the_car_does(paper_car):
    """Lift and drag as a wind tunnel tells them, drag along the road: m h a between the axles, whatever makes a."""
    vehicle = replace(paper_car.vehicle, lift_coefficient=(0.0, 0.0), drag_coefficient=1.0)
    p = pack(replace(paper_car, vehicle=vehicle))
    loads = [f"wheel_load_n_{wheel}" for wheel in ("fl", "fr", "rl", "rr")]
    start, rest = initial_state(paper_car, 50.0, 423.15, 0.7), np.zeros((900, INPUT.size))
    table = replay(start, rest, p, [*loads, "acceleration_mps2"])[0]
    front_m, rear_m = vehicle.cog_to_axle_m
    moved = table[:, :2].sum(axis=1) - vehicle.mass_kg * 9.81 * rear_m / (front_m + rear_m)
    expected = -vehicle.mass_kg * vehicle.cog_height_m * table[:, 4] / (front_m + rear_m)
    assert expected[600] > 150.0
    assert moved[600:] == pytest.approx(expected[600:], rel=0.05)
