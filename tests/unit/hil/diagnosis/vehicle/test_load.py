"""Vehicle sets: six values are enough, unknown keys are reported, tolerances become standard deviations."""

import numpy as np
import pytest

from hil.diagnosis.data.log import MOTOR_DEMAND, Log, UnusableError, make_log
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.latency import LATENCY_NODES
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, INSTRUMENTS, Nuisance, recording_nuisances
from hil.diagnosis.vehicle.spec import Vehicle, rest_friction
from plant.injection.theta import THETA
from plant.model import Scene, advance, initial_state
from plant.vectors import CUT, INPUT, OUTPUT, PARAMETER, P

SIX = {
    "mass_kg": 1800.0,
    "wheelbase_m": 2.8,
    "cog_to_front_axle_m": 1.3,
    "rolling_radius_m": 0.33,
    "brake_gain_front_nm_pa": 2.5e-4,
    "brake_gain_rear_nm_pa": 1.2e-4,
}


def test_six_values_make_a_car_with_a_constant_brake_gain() -> None:
    car = load_vehicle(SIX)
    brake, p = car.parameters.friction_brake, car.parameters
    assert p.vehicle.mass_kg == 1800.0
    assert p.vehicle.cog_to_axle_m == pytest.approx((1.3, 1.5))
    for temperature in (280.0, 293.15):
        mu = rest_friction(p, 293.15)
        gain = 2.0 * mu * brake.efficiency * brake.piston_area_m2[0] * brake.effective_radius_m[0]
        assert gain == pytest.approx(2.5e-4)
        assert temperature > 0.0
    assert not car.pad_temperature_matters
    assert any("wide prior" in text for text in car.remarks)


def test_a_constant_friction_is_constant_at_any_power() -> None:
    """A share lost at high speed and pressure would pass for a friction that rises with the speed."""
    car = load_vehicle(SIX | {"threshold_pressure_pa": 0.0})
    torques, u, cut = [], INPUT.zeros(), CUT.zeros()
    u[INPUT.slice("pressure_pa")], cut[CUT.slice("pressure")] = 4e6, 1.0
    for speed in (5.0, 40.0):
        x, y = initial_state(car.parameters, speed, car.parameters.friction_brake.ambient_k, 0.5), OUTPUT.zeros()
        advance(x, u, car.p, y, 300, Scene(cut=cut))
        torques.append(y[OUTPUT.slice("friction_torque_nm")][0])
    assert torques == pytest.approx([-2.5e-4 * 4e6] * 2, rel=1e-5)
    assert not [one.name for one in car.nuisances if one.name.startswith("pad_") and one.kind == "vehicle"]


def test_an_unknown_key_is_reported_not_refused() -> None:
    assert any("'colour'" in text for text in load_vehicle({**SIX, "colour": 3.0}).remarks)
    near = load_vehicle({**SIX, "wheel_inertia_kg_m": 1.0, "cog_hight_m_tolerance": 0.02}).remarks
    assert any("'wheel_inertia_kg_m' is left out; did you mean 'wheel_inertia_kg_m2'?" in text for text in near)
    assert any("did you mean 'cog_height_m'?" in text for text in near)


def test_a_tolerance_is_two_standard_deviations() -> None:
    car = load_vehicle({**SIX, "mass_kg_tolerance": 60.0, "brake_gain_front_nm_pa_tolerance": 2.5e-5})
    nuisances = {n.name: (n.step[0], car.p[n.at[0]]) for n in car.nuisances if n.kind == "vehicle"}
    assert nuisances["vehicle_mass_kg"][0] == pytest.approx(HALF_WIDTH_TO_SIGMA * 60.0)
    step, area = nuisances["brake_gain_front"]
    assert step == pytest.approx(HALF_WIDTH_TO_SIGMA * 0.1 * area, rel=1e-3)


def test_a_list_for_one_value_per_car_gives_mean_and_tolerance() -> None:
    car = load_vehicle({**SIX, "cog_height_m": [0.5, 0.6], "cog_height_m_tolerance": 0.02})
    assert car.parameters.vehicle.cog_height_m == pytest.approx(0.55)
    (height,) = [n for n in car.nuisances if n.name == "vehicle_cog_height_m"]
    assert height.step[0] == pytest.approx(HALF_WIDTH_TO_SIGMA * 0.05)
    assert any("cog_height_m is one value per car: the mean 0.55" in text for text in car.remarks)


def test_wheels_of_an_axle_with_motors_may_be_heavier() -> None:
    """The mean of 0.95 and 2.6 kg m2 would show as a soft rear axle of a car with nothing hidden."""
    car = load_vehicle({**SIX, "wheel_inertia_kg_m2": [0.95, 2.6], "wheel_inertia_kg_m2_tolerance": 0.12})
    assert car.parameters.wheel.inertia_kg_m2 == (0.95, 2.6)
    (inertia,) = [n for n in car.nuisances if n.name == "wheel_inertia_kg_m2"]
    assert inertia.step == (HALF_WIDTH_TO_SIGMA * 0.12, HALF_WIDTH_TO_SIGMA * 0.12)
    both = load_vehicle({**SIX, "wheel_inertia_kg_m2": 1.2})
    assert both.parameters.wheel.inertia_kg_m2 == (1.2, 1.2)


@pytest.mark.parametrize(("stated", "taken", "members"), [
    ([3e4, 24e4], (3e4, 24e4), [1, 1]), (4e4, (4e4, 4e4), [2]), (None, (5e4, 5e4), [1, 1]),
])  # fmt: skip
def test_each_axle_has_its_threshold(stated, taken, members):
    """Drums at the rear need more pressure before they grip: axles deviate apart unless one value is stated."""
    given = {} if stated is None else {"threshold_pressure_pa": stated, "threshold_pressure_pa_tolerance": 2e4}
    car = load_vehicle(SIX | given)
    assert car.parameters.friction_brake.threshold_pressure_pa == pytest.approx(taken)
    nuisances = [n for n in car.nuisances if n.name.startswith("friction_brake_threshold_pressure_pa")]
    assert [len(n.at) for n in nuisances] == members
    assert [car.p[k] for n in nuisances for k in n.at] == pytest.approx(taken)
    if stated is not None:
        assert all(step == pytest.approx(HALF_WIDTH_TO_SIGMA * 2e4) for n in nuisances for step in n.step)


def test_an_unstated_threshold_reaches_zero_and_a_stated_zero_is_known() -> None:
    """Torque proportional to pressure: a factor never leads to it, and a threshold was named in such a car."""
    thresholds = [n for n in load_vehicle(SIX).nuisances if n.name.startswith("friction_brake_threshold_pressure_pa")]
    at_limit = nominal(load_vehicle(SIX)).with_nuisances(thresholds, np.array([n.lower for n in thresholds]))
    assert at_limit.p[PARAMETER.slice("friction_brake_threshold_pressure_pa")] == pytest.approx([0.0, 0.0], abs=1e-6)
    stated = load_vehicle(SIX | {"threshold_pressure_pa": 0.0})
    assert not [n for n in stated.nuisances if n.name.startswith("friction_brake_threshold_pressure_pa")]


@pytest.mark.parametrize(("name", "at", "wanted"), [
    ("tyre_stiffness_load", P.tyre_pkx3, 0.0), ("tyre_curve", P.tyre_lex, -0.35),
    ("tyre_friction_load", P.tyre_pdx2, -0.01),
    ("suspension_brake_support_tangent_front", P.suspension_brake_support_tangent, 0.35),
])  # fmt: skip
def test_forms_of_a_simple_car_are_within_their_bounds(name, at, wanted):
    """Slip stiffness and grip in proportion to the load, a hyperbolic tangent, no pitch: what models without springs
    have."""
    car = load_vehicle(SIX)
    (nuisance,) = (one for one in car.nuisances if one.name == name)
    reached = [nominal(car).with_nuisances([nuisance], np.array([z])).p[at] for z in (nuisance.lower, nuisance.upper)]
    assert min(reached) <= wanted <= max(reached)


def test_the_larger_tolerance_of_two_axles_counts() -> None:
    stated = {**SIX, "track_m": [1.5, 1.48]}
    steps = [
        {n.name: n.step for n in load_vehicle({**stated, "track_m_tolerance": of}).nuisances}
        for of in (0.05, [0.01, 0.05])
    ]
    assert steps[0] == steps[1]
    with pytest.raises(UnusableError, match="track_m_tolerance: expected a number, got 'narrow'"):
        load_vehicle({**stated, "track_m_tolerance": "narrow"})


def test_a_value_of_wrong_shape_makes_the_set_unusable() -> None:
    with pytest.raises(UnusableError, match="track_m"):
        load_vehicle({**SIX, "track_m": [1.5, 1.48, 1.5]})


def test_a_stated_tolerance_is_kept_to_as_far_as_an_equation_is_that_good() -> None:
    stated = {**SIX, "cog_height_m": 0.5, "cog_height_m_tolerance": 0.03}
    step = {n.name: n.step[0] for n in load_vehicle(stated).nuisances}
    assert step["vehicle_cog_height_m"] == pytest.approx(HALF_WIDTH_TO_SIGMA * 0.03)
    step = {n.name: n.step[0] for n in load_vehicle({**stated, "cog_height_m_tolerance": 0.001}).nuisances}
    assert step["vehicle_cog_height_m"] == pytest.approx(HALF_WIDTH_TO_SIGMA * 0.04 * 0.5)
    step = {n.name: n.step[0] for n in load_vehicle(SIX).nuisances}
    assert step["vehicle_cog_height_m"] > 0.03


SPRINGS = {
    "suspension_ride_rate_n_m": [32000.0, 28000.0], "suspension_progression_n_m3": 0.0,
    "suspension_damping_ns_m": [2200.0, 1900.0], "suspension_anti_roll_nm_rad": [28000.0, 24000.0],
    "suspension_brake_support_tangent": [0.14, 0.2], "suspension_roll_centre_height_m": 0.0,
}  # fmt: skip


def test_stated_springs_have_their_tolerance_and_at_least_a_twentieth() -> None:
    stated = {"suspension_ride_rate_n_m_tolerance": 4800.0, "suspension_damping_ns_m_tolerance": 10.0}
    by_name = {one.name: one for one in load_vehicle(SIX | SPRINGS | stated).nuisances}
    assert by_name["suspension_ride_rate_n_m_front"].step[0] == pytest.approx(HALF_WIDTH_TO_SIGMA * 4800.0)
    assert by_name["suspension_damping_ns_m_front"].step[0] == pytest.approx(HALF_WIDTH_TO_SIGMA * 110.0)
    assert "suspension_progression_n_m3_front" not in by_name  # linear springs, and known to be
    silent = {one.name: one for one in load_vehicle(SIX).nuisances}
    assert silent["suspension_ride_rate_n_m_front"].step[0] > 5.0 * by_name["suspension_ride_rate_n_m_front"].step[0]


@pytest.mark.parametrize(("stated", "half"), [({}, 0.1), ({"lift_front": 0.05, "lift_front_tolerance": 0.03}, 0.03)])
def test_stated_lift_has_its_tolerance(stated: dict[str, float], half: float) -> None:
    by_name = {one.name: one for one in load_vehicle(SIX | stated).nuisances}
    assert by_name["vehicle_lift_coefficient_front"].step[0] == pytest.approx(HALF_WIDTH_TO_SIGMA * half)


def test_stated_discs_have_their_tolerance() -> None:
    pads = {"pad_a_1_ks": 3e-5, "pad_b_1_j": 9e-7, "pad_c_1_s": 4e-3, "pad_epsilon_w": 35510.0}
    stated = {"disc_heat_front_j_k": 3000.0, "disc_heat_front_j_k_tolerance": 60.0}
    for given, half in ((stated, 60.0), ({}, 600.0)):
        by_name = {one.name: one for one in load_vehicle(SIX | pads | given).nuisances}
        assert by_name["friction_brake_heat_capacity_j_k_front"].step[0] == pytest.approx(HALF_WIDTH_TO_SIGMA * half)


def test_the_curvature_of_a_tyre_ends_where_its_equation_does() -> None:
    """Beyond a curvature factor of 1 the plant's tyre is that of 1: no sensitivity leads a fit back from there."""
    car = load_vehicle(SIX)
    (curve,) = (one for one in car.nuisances if one.name == "tyre_curve")
    at_limit = nominal(car).with_nuisances([curve], np.array([curve.upper]))
    assert float(at_limit.p[P.tyre_lex] * at_limit.p[P.tyre_pex1]) == pytest.approx(1.0)
    assert curve.upper < curve.bound


def test_curves_that_a_set_does_not_state_have_a_wide_bound() -> None:
    by_name = {one.name: one for one in load_vehicle(SIX | {"tyre_lkx": 1.1, "tyre_lkx_tolerance": 0.1}).nuisances}
    assert by_name["tyre_lkx"].bound == 3.0
    assert by_name["tyre_friction_load"].bound > 3.0


def _late(vehicle: Vehicle) -> dict[str, Nuisance]:
    return {one.name: one for one in recording_nuisances(True, vehicle.latencies) if "late_" in one.name}


def test_latencies_that_a_set_does_not_state_are_those_of_loggers() -> None:
    late = _late(load_vehicle(SIX))
    assert {name: one.step[0] for name, one in late.items()} == {
        "late_imu": 0.01, "late_pressure": 0.01, "late_motor": 0.01, "late_pressure_demand": 0.0175,
        "late_motor_demand": 0.0175, "late_steering": 0.0175, "late_yaw_rate": 0.003, "late_ground_speed": 0.1,
    }  # fmt: skip
    demand = late["late_motor_demand"]
    assert demand.upper * demand.step[0] == pytest.approx(0.0525)
    assert demand.lower * demand.step[0] == pytest.approx(-0.02)  # the logger got the frame later than the motor


def test_a_tolerance_of_all_nodes_holds_for_demands_and_steering_too() -> None:
    vehicle = load_vehicle(SIX | {"node_latency_s_tolerance": 1e-3})
    assert not any("node_latency" in remark for remark in vehicle.remarks)
    late = _late(vehicle)
    assert {late[f"late_{node}"].step[0] for node in ("imu", "pressure", "motor", "steering")} == {5e-4}
    for node in ("pressure_demand", "motor_demand"):  # an actuator's dead time beside the frames'
        assert late[f"late_{node}"].step[0] == pytest.approx(0.0105)
        assert late[f"late_{node}"].lower == 0.0
    assert any("node_latency_s" in remark for remark in load_vehicle(SIX | {"node_latency_s": 1e-3}).remarks)


def test_each_node_has_a_nominal_latency_and_a_tolerance_of_its_own() -> None:
    stated = {"motor_demand_latency_s": 0.015, "imu_latency_s": 0.01, "imu_latency_s_tolerance": 0.004}
    vehicle = load_vehicle(SIX | stated)
    by_node = dict(zip(LATENCY_NODES, vehicle.latencies, strict=True))
    assert (by_node["imu"].value_s, by_node["imu"].half_width_s) == (0.01, 0.004)
    assert by_node["motor_demand"].half_width_s == pytest.approx(0.003)
    assert nominal(vehicle).latency_s == (0.01, 0.0, 0.0, 0.0, 0.015, 0.0, 0.0, 0.0)
    assert "late_motor" not in _late(load_vehicle(SIX | {"motor_latency_s_tolerance": 0.0}))


def test_instruments_and_road_are_free_where_no_set_of_measurements_says_otherwise() -> None:
    def free(table: dict[str, float]) -> dict[str, float]:
        return {one.name: one.step[0] for one in load_vehicle(table).nuisances if one.name in INSTRUMENTS}

    assert free(SIX)["ax_zero_mps2"] == 0.025
    assert "motor_demand_scale" not in free(SIX)  # its motors are not compared with their demands
    assert free(SIX | {"motor_time_constant_s": 0.01})["motor_demand_scale"] == 0.015
    assert free(SIX | {"road_grade_tolerance": 0.02})["road_grade"] == 0.01
    assert "wind_mps" not in free(SIX | {"wind_mps_tolerance": 0.0})
    assert not [one.name for one in paper_car().nuisances if one.name in INSTRUMENTS]


def test_the_line_lag_has_the_stated_or_default_tolerance() -> None:
    """Without it lags of 3 and 4 ms are named as causes of cars with nothing hidden."""
    car = load_vehicle(SIX)
    (line,) = (one for one in car.nuisances if one.name == "line_lag")
    assert line.step[0] == pytest.approx(4e-3)
    lagging = nominal(car).with_nuisances([line], np.ones(1))
    assert lagging.theta[THETA.slice("pressure_location", "lag_s")] == pytest.approx(4e-3)
    for half, count in ((2e-3, 1), (0.0, 0)):
        stated = load_vehicle(SIX | {"line_lag_s_tolerance": half})
        assert [one.step[0] for one in stated.nuisances if one.name == "line_lag"] == [0.5 * half] * count
        assert not any("line_lag" in remark for remark in stated.remarks)
    assert not any(one.name == "line_lag" for one in paper_car().nuisances)


@pytest.mark.parametrize("missing", [None, *SPRINGS])
def test_the_suspension_is_stated_if_every_number_of_it_is(missing: str | None) -> None:
    stated = {name: value for name, value in SPRINGS.items() if name != missing}
    assert load_vehicle(SIX | stated).suspension_stated == (missing is None)
    assert not load_vehicle(SIX).suspension_stated


def test_the_shipped_car_keeps_its_own_values() -> None:
    car = paper_car()
    assert car.parameters.vehicle.mass_kg == 1463.0
    assert np.isfinite(car.p).all()


@pytest.mark.parametrize("value", ["heavy", True, [], float("nan"), 10**400])
def test_a_value_that_is_not_a_number_is_refused(value: object) -> None:
    if isinstance(value, str):
        assert load_vehicle({**SIX, "colour": value})
        return
    with pytest.raises(UnusableError, match="expected a number"):
        load_vehicle({**SIX, "mass_kg": value})


def test_effects_on_unstated_sections_are_undiagnosable() -> None:
    car = load_vehicle(SIX)
    assert {"ehb_dead_time", "motor_tau", "battery_soc"} <= set(car.undiagnosable_effects)
    assert car.parameters.motor.peak_torque_nm > 2000.0
    remark = next(text for text in car.remarks if "not given: ehb, motor, battery" in text)
    assert "pressures are compared only where their demand" in remark
    assert "torques of the motors are not compared" in remark
    stated = load_vehicle({**SIX, "ehb_dead_time_s": 0.02, "motor_peak_torque_nm": 400.0, "tyre_lkx": 1.0})
    assert set(stated.undiagnosable_effects) == {"battery_soc"}
    assert not any("compared" in text for text in stated.remarks)
    motor, ehb = stated.parameters.motor, stated.parameters.ehb
    assert motor.peak_torque_nm == 400.0
    assert min(motor.peak_power_w, motor.rate_limit_nm_s, ehb.build_rate_pa_s, ehb.release_rate_pa_s) > 2e5
    assert motor.fade_start_mps < 0.5
    assert motor.derating_start_k > 5e3
    assert motor.max_speed_rad_s > 300.0
    assert any("no such limit is simulated: ehb_build_rate_pa_s" in text for text in stated.remarks)
    assert not {"ehb_build_rate_pa_s", "motor_peak_power_w"} & {one.name for one in stated.nuisances}
    assert paper_car().unstated == ()


def test_a_brake_gain_without_tolerance_is_known_to_a_hundredth() -> None:
    """Not to the tolerance of the shipped car's piston, radius and efficiency, some 15 %."""

    def share(car: Vehicle) -> float:
        (gain,) = (one for one in car.nuisances if one.name == "brake_gain_front")
        return gain.step[0] / float(car.p[gain.at[0]]) / HALF_WIDTH_TO_SIGMA

    assert share(load_vehicle(SIX)) == pytest.approx(0.01, rel=0.02)
    stated = load_vehicle({**SIX, "brake_gain_front_nm_pa_tolerance": 2.5e-5})
    assert share(stated) == pytest.approx(0.1, rel=0.02)


HYDRAULICS = {"ehb_build_rate_pa_s": 25e6, "ehb_release_rate_pa_s": 40e6}
MOTORS = {
    "motor_time_constant_s": 0.02, "motor_peak_torque_nm": 700.0, "motor_peak_power_w": 75e3,
    "motor_rate_limit_nm_s": 12e3, "motor_fade_start_mps": 2.0, "motor_fade_end_mps": 0.5,
    "motor_derating_start_k": 390.0, "motor_derating_end_k": 420.0,
}  # fmt: skip


BATTERY = {"battery_charge_power_w": 60e3, "battery_discharge_power_w": 80e3}
BRAKES = ("pressure_offset.offset_pa", "pressure_gain.gain")
REST = ("iwm_gain.unseen", "pad_mu_gain.gain", "tyre_radius.gain")
ALL = (*BRAKES, "iwm_gain.gain", *REST)


@pytest.mark.parametrize(("stated", "off"), [
    ({}, (*BRAKES, *REST)), (MOTORS, ALL), ({"motor_time_constant_s": 0.02}, ALL), (HYDRAULICS | MOTORS, ALL),
    (HYDRAULICS | MOTORS | BATTERY, ()),
])  # fmt: skip
def test_a_set_without_all_limits_has_side_to_side_variation(stated, off):
    """Else 0.7 % of a pressure or brake, 0.4 of a motor, 0.1 of a radius, 46 ppm of a clock are named as causes."""
    car = load_vehicle({**SIX, **stated})
    nuisances = [n.name for n in car.nuisances if n.kind == "side_to_side"]
    clocks = [f"clock_drift.share_{node}" for node in ("wheel", "imu", "pressure", "motor") if off]
    assert nuisances == [f"{number}_{wheel}" for number in off for wheel in ("fl", "fr", "rl", "rr")] + clocks


@pytest.mark.parametrize(("stated", "known"), [({}, False), (HYDRAULICS | MOTORS | BATTERY, True)])
def test_the_steering_zero_is_a_nuisance_unless_all_limits_are_stated(stated, known):
    """Without it zeros of 0.5 to 0.8 degrees are named as causes, beside the right ones."""
    car = load_vehicle({**SIX, **stated, "steering_ratio": 20.0})
    assert [one.step for one in car.nuisances if one.name == "zero_steering"] == ([] if known else [(5e-4,)])
    off = np.array([float(one.name == "zero_steering") for one in car.nuisances])
    theta = nominal(car).with_nuisances(car.nuisances, off).theta
    assert theta[THETA.slice("steer_lateral", "offset_rad")] == pytest.approx(0.0 if known else 5e-4)
    assert "zero_steering" not in {one.name for one in car.without_lateral_dynamics().nuisances}


def _demands(torque_nm: float) -> Log:
    t_s = 0.01 * np.arange(300)
    return make_log("a.csv", t_s, {name: np.where(t_s > 1.0, torque_nm, np.nan) for name in MOTOR_DEMAND})


def test_motors_without_a_stated_peak_torque_get_the_largest_demand() -> None:
    """With a peak torque of 5 kN m a fade-out 3 m/s early would do nothing to 315 N m."""
    car = load_vehicle({**SIX, "motor_fade_start_mps": 3.2, "motor_fade_end_mps": 0.9})
    limited = car.with_motor_limits_from([_demands(-315.0), _demands(120.0)])
    assert limited.parameters.motor.peak_torque_nm == limited.p[P.motor_peak_torque_nm] == 315.0
    assert car.with_motor_limits_from([]) is car
    stated = load_vehicle({**SIX, "motor_peak_torque_nm": 400.0})
    assert stated.with_motor_limits_from([_demands(-315.0)]) is stated


def test_the_motors_support_is_that_of_the_brakes_unless_stated() -> None:
    at = PARAMETER.slice("suspension_drive_support_tangent")
    assert load_vehicle(SIX | SPRINGS).p[at].tolist() == SPRINGS["suspension_brake_support_tangent"]
    own = load_vehicle(SIX | SPRINGS | {"suspension_drive_support_tangent": [0.05, 0.1]})
    assert own.p[at].tolist() == [0.05, 0.1]
    assert load_vehicle(SIX | SPRINGS).suspension_stated
