"""The simulator: what answers the speed is taken at the measured one; what cannot differ is not simulated again."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.data.dataset import ROW_S
from hil.diagnosis.data.log import Log, make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.parameter_set import ParameterSet, nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.simulation.substeps import STEPS
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.diagnosis.vehicle.priors import LATENCY_NODES
from plant.effects.effect import NODES
from plant.injection.theta import THETA
from plant.model import initial_state, pack, replay
from plant.vectors import INPUT, P

WHEELS = ("fl", "fr", "rl", "rr")
RECUPERATES, BRAKES = (10.0, 15.0), (19.0, 23.0)
SEGMENTS = 3
MOTOR_NODE = np.array([node == "motor" for node in NODES]) * 1.0


def _log() -> Log:
    """A car that coasts, recuperates beyond what its motors may give, rolls and brakes."""
    t = np.arange(2600) * 0.01
    recuperates, brakes = ((t > begin) & (t < end) for begin, end in (RECUPERATES, BRAKES))
    speed = 36.0 - np.cumsum(0.3 + 2.5 * recuperates + 3.0 * brakes) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS} | {"ax_mps2": np.gradient(speed, t)}
    channels |= {f"pressure_{w}_pa": 15e5 * brakes for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": 15e5 * brakes for w in WHEELS}
    channels |= {f"motor_torque_{w}_nm": -280.0 * recuperates for w in WHEELS}
    channels |= {f"motor_torque_demand_{w}_nm": -690.0 * recuperates for w in WHEELS}
    return make_log("log", t, channels)


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(prepare([_log()], 0.308), paper_car())


def late(node: str, by_s: float) -> tuple[float, ...]:
    """Latencies of a parameter set in which one node is late."""
    return tuple(by_s if name == node else 0.0 for name in LATENCY_NODES)


def _with(parameters: ParameterSet, effect: str, number: str, value: float | np.ndarray) -> ParameterSet:
    theta = parameters.theta.copy()
    theta[THETA.slice(effect, number)] = value
    return replace(parameters, theta=theta)


def test_a_motor_at_its_limit_does_not_answer_an_error_of_the_speed(simulator):
    """A limit that followed the simulated speed had more information on mass, drag and grade than the motion."""
    level = nominal(simulator.vehicle)
    flat, steep = (simulator.run(parameters) for parameters in (level, _with(level, "road_grade", "grade", 0.03)))
    assert np.abs(steep["wheel"] - flat["wheel"]).max() > 1.0
    assert np.abs(flat["motor"]).max() > 100.0
    assert np.array_equal(steep["motor"], flat["motor"])


def test_a_motor_that_pulls_away_is_not_compared_before_the_wheels_turn():
    """A simulated wheel that crept back by less than any sensor resolves made a fading of the torque that pulled."""
    t = np.arange(1500) * 0.01
    pulls = t > 5.0
    speed = np.clip(t - 5.2, 0.0, None)
    demanded = {f"motor_torque_demand_{w}_nm": 200.0 * pulls for w in WHEELS}
    measured = {f"motor_torque_{w}_nm": 200.0 * pulls for w in WHEELS}
    turning = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS}
    pressed = {f"pressure_{w}_pa": 5e5 * ~pulls for w in WHEELS}
    dataset = prepare([make_log("log", t, turning | demanded | measured | pressed)], 0.308)
    car = paper_car()
    (recording,) = Simulator(dataset, car).prepared(nominal(car)).dataset.recordings
    at = np.arange(len(recording.measured["motor"])) * 0.01 * recording.stride
    rests = (at > 5.1) & (at < 5.4)
    assert rests.any()
    assert np.isnan(recording.measured["motor"][rests]).all()
    assert np.isfinite(recording.measured["motor"][(at > 7.0) & (at < 14.0)]).all()


def test_motors_of_which_nobody_says_how_hot_they_get_are_not_derated():
    """Twice the torque of the shipped car's heated its windings, in another car's motors, until they gave less."""
    t = np.arange(6000) * 0.01
    pulls = 900.0 * (t > 2.0)
    channels = {f"wheel_speed_{w}_rad_s": np.clip(0.5 * (t - 2.0), 0.0, None) / 0.33 for w in WHEELS}
    channels |= {f"motor_torque_{w}_nm": pulls for w in WHEELS} | {f"motor_torque_demand_{w}_nm": pulls for w in WHEELS}
    channels |= {f"pressure_{w}_pa": np.zeros(len(t)) for w in WHEELS}
    stated = {"mass_kg": 3900.0, "wheelbase_m": 2.9, "rolling_radius_m": 0.33, "motor_peak_torque_nm": 1200.0}
    car = load_vehicle({**stated, "brake_gain_front_nm_pa": 3e-4, "brake_gain_rear_nm_pa": 2e-4})
    simulated = Simulator(prepare([make_log("log", t, channels)], 0.33), car).run(nominal(car))["motor"]
    assert simulated[-500:] == pytest.approx(900.0, rel=1e-3)


@pytest.mark.parametrize(("effect", "number", "value"), [
    ("pad_mu_gain", "gain", 0.1), ("iwm_gain", "gain", 0.1), ("ehb_dead_time", "time_s", 0.01),
    ("road_grade", "grade", 0.01), ("imu_bias", "ax_mps2", 0.1), ("pressure_offset", "offset_pa", 1e4),
])  # fmt: skip
def test_a_baseline_changes_no_result(simulator, effect, number, value):
    level = nominal(simulator.vehicle)
    changed = _with(level, effect, number, value)
    fresh = Simulator(simulator.dataset, simulator.vehicle).run(changed)
    simulator = simulator.with_baseline(level)
    kept = simulator.run(changed)
    for group, values in fresh.items():
        apart = np.abs(kept[group] - values).max()
        assert apart <= 2e-3 * max(np.abs(values - simulator.run(level)[group]).max(), 1e-9), group


@pytest.mark.parametrize(("effect", "number", "value", "acts"), [
    ("mass_offset", "mass_kg", 100.0, False), ("slip_stiffness", "gain", 0.2, False),
    ("headwind", "wind_mps", 4.0, True), ("rolling_resistance", "gain", 0.3, False),
    ("tyre_radius", "gain", 0.01, False), ("road_grade", "grade", 0.01, True), ("ehb_dead_time", "time_s", 0.01, True),
])  # fmt: skip
def test_a_standing_car_is_replayed_for_what_acts_on_it(effect, number, value, acts):
    """What needs a moving car leaves nothing behind that a sensor tells of one that stands on its brakes."""
    t = np.arange(600) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": np.zeros(len(t)) for w in WHEELS} | {"ax_mps2": np.zeros(len(t))}
    for name in ("pressure_{}_pa", "pressure_demand_{}_pa"):
        channels |= {name.format(w): 15e5 * (t > 2.0) for w in WHEELS}
    stands = Simulator(prepare([make_log("stands", t, channels), _log()], 0.308), paper_car())
    samples, level = stands.dataset.recordings[0].samples, nominal(stands.vehicle)
    before, fresh = stands.run(level), stands.run(_with(level, effect, number, value))
    kept = stands.with_baseline(level).run(_with(level, effect, number, value))
    same = all(np.array_equal(values[:samples], kept[group][:samples]) for group, values in before.items())
    assert same != acts
    for group, most in (("wheel", 1e-2), ("ax", 2e-3), ("pressure", 1.0)):
        assert np.abs(kept[group] - fresh[group])[:samples].max() < most, group


@pytest.mark.parametrize("change", [
    {"latency_s": late("imu", 0.004)}, {"latency_s": late("pressure", 0.004)},
    {"latency_s": late("pressure_demand", 0.024)},
    {"window_rows2": 4.0}, {"tooth_share": 0.2},
])  # fmt: skip
def test_channels_of_a_baseline_are_not_those_of_other_frames_or_teeth(simulator, change):
    level = nominal(simulator.vehicle)
    changed = replace(level, **change)
    fresh = Simulator(simulator.dataset, simulator.vehicle).run(changed)
    simulator = simulator.with_baseline(level)
    kept = simulator.run(changed)
    assert any(np.abs(values - simulator.run(level)[group]).max() > 1e-6 for group, values in fresh.items())
    for group, values in fresh.items():
        assert np.array_equal(kept[group], values), group


def test_until_a_cause_begins_what_single_wheels_are_off_is_there(simulator):
    """Pads of one wheel grow weak in the middle of a stop: until then the four were as unlike as they were."""
    level = nominal(simulator.vehicle)
    unlike = _with(level, "pad_mu_gain", "gain", np.array([0.01, -0.03, 0.02, 0.0]))
    weak = _with(unlike, "pad_mu_gain", "gain", np.array([-0.3, -0.03, 0.02, 0.0]))
    begun = weak.with_onset("pad_mu_gain", 0, 21.0, before=unlike)
    alone, always, within = (simulator.run(parameters)["wheel"] for parameters in (unlike, weak, begun))
    assert np.abs(within - alone)[:1049].max() == 0.0
    assert np.abs(within - alone)[1075:1140].max() > 0.5
    assert np.abs(alone - always)[:1049].max() > 0.5


def test_a_sensor_that_shows_too_much_does_not_press_the_pads_at_the_start():
    """The offset is in the first sample as in all others: no pressure that was never there has to be let off."""
    log, offset = _log(), 1e5
    measured = {f"pressure_{w}_pa": log.channels[f"pressure_{w}_pa"] + offset for w in WHEELS}
    simulator = Simulator(prepare([make_log("log", log.t_s, {**log.channels, **measured})], 0.308), paper_car())
    pressure = simulator.run(_with(nominal(simulator.vehicle), "pressure_offset", "offset_pa", offset))["pressure"]
    assert pressure[:100] == pytest.approx(offset, abs=1.0)


def test_a_ground_speed_that_is_too_high_starts_a_car_as_slow_as_it_was():
    """No wheel speed is logged: the channel starts as measured."""
    log = _log()
    ground = log.channels["wheel_speed_fl_rad_s"] * 0.308
    channels = {name: values for name, values in log.channels.items() if not name.startswith("wheel_speed")}
    simulator = Simulator(prepare([make_log("log", log.t_s, {**channels, "speed_mps": ground})], 0.308), paper_car())
    level = nominal(simulator.vehicle)
    simulator = simulator.with_baseline(level)
    right, wrong = (
        simulator.run(parameters)["gps"] for parameters in (level, _with(level, "speed_scale", "gain", 0.05))
    )
    assert wrong[:20] == pytest.approx(right[:20], rel=1e-3)
    assert np.abs(wrong - right).max() > 0.05  # the drag of a slower car is less


def test_brakes_change_nothing_before_they_are_applied(simulator):
    level = nominal(simulator.vehicle)
    simulator = simulator.with_baseline(level)
    same, changed = simulator.run(level), simulator.run(_with(level, "pad_mu_gain", "gain", 0.2))
    first = int(simulator.dataset.recordings[0].segments[-1].first) // simulator.dataset.recordings[0].stride
    assert len(simulator.dataset.recordings[0].segments) == SEGMENTS
    assert np.array_equal(same["wheel"][:first], changed["wheel"][:first])
    assert np.abs(same["wheel"][first:] - changed["wheel"][first:]).max() > 0.1


def test_pads_begin_at_the_rest_value_of_the_car_at_hand(simulator):
    """With the friction of the car as handed in, what is stated of its pads would say nothing of the first stops."""
    level = nominal(simulator.vehicle)
    p = level.p.copy()
    p[P.pad_epsilon_w] *= 1.05
    simulator = simulator.with_baseline(level)
    slower = simulator.run(replace(level, p=p))["wheel"][-100:] - simulator.run(level)["wheel"][-100:]
    weaker = simulator.run(_with(level, "pad_mu_gain", "gain", 1.0 / 1.05 - 1.0))["wheel"][-100:]
    weaker = weaker - simulator.run(level)["wheel"][-100:]
    assert slower.mean() == pytest.approx(weaker.mean(), rel=0.1)


def _driven(time_constant_s: float) -> tuple[Log, np.ndarray]:
    """A car whose motors step to and fro, as a log of 10 ms, and their torque in the middle of each row."""
    car = paper_car().parameters
    car = replace(car, motor=replace(car.motor, time_constant_s=time_constant_s))
    halves = np.zeros((3200, INPUT.size))
    t = np.arange(3200) * 0.005
    halves[:, INPUT.slice("motor_demand_nm")] = np.where((t > 1.9975) & ((t + 0.0025) % 2.0 < 1.0), -120.0, 0.0)[
        :, None
    ]
    names = [f"{name}_{w}" for name in ("wheel_speed_rad_s", "state.motor_torque_nm") for w in WHEELS]
    table = replay(
        initial_state(car, 30.0, 350.0, 0.7), halves, pack(car), [*names, "state.imu_longitudinal_mps2"], steps=5,
    )[0]  # fmt: skip
    channels = {f"wheel_speed_{w}_rad_s": table[::2, k] for k, w in enumerate(WHEELS)}
    channels |= {f"motor_torque_{w}_nm": table[::2, 4 + k] for k, w in enumerate(WHEELS)}
    demand = halves[::2, INPUT.slice("motor_demand_nm").start]
    channels |= {f"motor_torque_demand_{w}_nm": demand for w in WHEELS}
    channels |= {f"pressure_{w}_pa": np.zeros(1600) for w in WHEELS}
    return make_log("log", np.arange(1600) * 0.01, channels | {"ax_mps2": table[::2, 8]}), table[1::2, 4]


def _middle(simulator: Simulator) -> np.ndarray:
    inputs = simulator.dataset.recordings[0].inputs
    torque = inputs[:, INPUT.at.motor_torque_nm]
    return 0.5 * (torque[:-1] + torque[1:]) + inputs[:-1, INPUT.at.motor_torque_bend_nm]


def test_denoised_inputs_have_the_steps_of_the_parameters_that_made_them():
    """Measured torques smoothed have none; with a lag of the motors that is not theirs they have them wrong."""
    log, true = _driven(0.02)
    vehicle = paper_car()
    simulator = Simulator(prepare([log], 0.308), vehicle).prepared(nominal(vehicle))
    right = nominal(vehicle)
    right.p[P.motor_time_constant_s] = 0.02
    before = np.abs(_middle(simulator) - true[: len(_middle(simulator))]).max()
    simulator = simulator.denoised(right)
    after = np.abs(_middle(simulator) - true[: len(_middle(simulator))]).max()
    assert before > 10.0
    assert after < 1.0


@pytest.mark.parametrize("late_by", ["latency", "stamp", "clock", "scale"])
def test_denoised_inputs_are_the_true_ones_however_the_torque_is_measured(late_by):
    """What the sensor adds is taken back before the simulated torque is compared."""
    log, _ = _driven(0.008)
    vehicle = paper_car()
    t, changed = log.t_s, dict(log.channels)
    true = changed["motor_torque_fl_nm"]
    level = nominal(vehicle)
    parameters = {
        "latency": replace(level, latency_s=late("motor", 0.006)),
        "stamp": _with(level, "timestamp_offset", "delay_s", MOTOR_NODE * 0.006),
        "clock": _with(level, "clock_drift", "share", MOTOR_NODE * 5e-4),
        "scale": _with(level, "wrong_scale", "gain", MOTOR_NODE * -0.2),
    }[late_by]
    taken_s = t * (1.0 - 5e-4) if late_by == "clock" else t - 0.006
    seen = 0.8 * true if late_by == "scale" else np.interp(taken_s, t, true)
    changed |= {f"motor_torque_{w}_nm": seen for w in WHEELS}
    simulator = (
        Simulator(prepare([replace(log, channels=changed)], 0.308), vehicle)
        .prepared(parameters)
        .with_baseline(parameters)
    )
    driving = simulator._baseline.replays[0].inputs[:, INPUT.at.motor_torque_nm]
    assert np.abs(seen - true)[20:-20].max() > 20.0
    assert np.abs(driving - true[: len(driving)])[20:-20].max() < 6.0
    assert np.sqrt(np.mean((driving - true[: len(driving)])[20:-20] ** 2)) < 0.5


@pytest.mark.parametrize("late_by", ["latency", "stamp"])
def test_a_torque_measured_half_a_row_late_is_the_one_between_two_rows(late_by):
    """It lags its demand, so a straight line comes later.

    Of what is left, 0.7 N m where a ramp ends, 0.5 is what drives the car: smoothed, not the measured torque itself.
    """
    log, true = _driven(0.008)
    vehicle = paper_car()
    level = nominal(vehicle)
    level.p[P.motor_time_constant_s] = 0.008
    simulator = Simulator(prepare([log], 0.308), vehicle).prepared(level)
    recording = simulator.dataset.recordings[0]
    parameters = (
        replace(level, latency_s=late("motor", 0.005))
        if late_by == "latency"
        else _with(level, "timestamp_offset", "delay_s", MOTOR_NODE * 0.005)
    )
    true_torque = {"motor": recording.inputs[:, INPUT.slice("motor_torque_nm")]}
    seen = simulator.measurement_model.measure_rows(true_torque, recording, parameters)["motor"][1:, 0]
    straight = 0.5 * (true_torque["motor"][:-1, 0] + true_torque["motor"][1:, 0])
    far, near = (np.abs(values - true[: len(values)])[20:-20].max() for values in (straight, seen))
    assert near < 0.8 < 2.0 < far


@pytest.mark.parametrize("node", ["imu", "pressure", "motor"])
def test_a_late_stamp_and_an_early_frame_cancel(simulator, node):
    """Two shifts by lines between rows smooth every jump: fits of two names of one delay stood still there."""
    level, of_node = nominal(simulator.vehicle), np.array([name == node for name in NODES]) * 1.0
    delayed = _with(level, "timestamp_offset", "delay_s", of_node * 0.004)
    both, latency = (replace(one, latency_s=late(node, by_s)) for one, by_s in ((delayed, -0.004), (level, 0.004)))
    seen, as_stamped, as_logged, in_time = map(simulator.run, (both, delayed, latency, level))
    for group, values in in_time.items():
        assert seen[group] == pytest.approx(values, abs=1e-9 * np.abs(values).max())
        assert as_stamped[group] == pytest.approx(as_logged[group], abs=1e-9 * np.abs(values).max())
    assert any(not np.allclose(as_stamped[group], values) for group, values in in_time.items())


def test_a_yaw_rate_comes_later_than_the_accelerations(simulator):
    """A gyroscope has a filter of its own."""
    recording = simulator.dataset.recordings[0]
    ramp = np.arange(len(recording.inputs), dtype=float)[:, None]
    level = nominal(simulator.vehicle)
    in_time, later = (
        simulator.measurement_model.measure_rows({"ay": ramp, "yaw": ramp}, recording, parameters)
        for parameters in (level, replace(level, latency_s=late("yaw_rate", 0.5 * ROW_S)))
    )
    assert later["yaw"][5:-5] == pytest.approx(in_time["yaw"][5:-5] - 0.5)
    assert np.array_equal(later["ay"], in_time["ay"])


def test_steps_are_short_where_a_torque_steps_and_noise_is_no_step():
    log, _ = _driven(0.008)
    rng = np.random.default_rng(1)
    noisy = {
        name: values + 3.0 * rng.standard_normal(len(values)) if name.startswith("motor_torque_f") else values
        for name, values in log.channels.items()
    }
    for one in (log, replace(log, channels=noisy)):
        paces = Simulator(prepare([one], 0.308), paper_car())._setups[0].rows_per_step
        assert set(paces[200:202]) == {1}
        assert set(paces[205:212]) <= {1, STEPS // 2}
        assert (paces[260:290] == STEPS).all()
        assert 0.0 < (paces == 1).mean() < 0.4


def test_a_wheel_speed_that_is_a_mean_over_a_window_swings_less():
    log, _ = _driven(0.008)
    simulator = Simulator(prepare([log], 0.308), paper_car())
    level = nominal(simulator.vehicle)
    sharp, mean = simulator.run(level)["wheel"][:, 0], simulator.run(replace(level, window_rows2=1.0))["wheel"][:, 0]
    step = slice(100, 110)
    assert np.ptp(np.diff(mean[step], 2)) < 0.97 * np.ptp(np.diff(sharp[step], 2))
    assert mean[130:145] == pytest.approx(sharp[130:145], abs=1e-3)


def test_a_car_held_straight_goes_on_in_its_line_with_a_weak_brake(simulator):
    weak = np.array([-0.3, 0.0, 0.0, 0.0])
    held = Simulator(simulator.dataset, simulator.vehicle.without_lateral_dynamics())

    def yaw_rate(of: Simulator) -> np.ndarray:
        return of.states(_with(nominal(of.vehicle), "pad_mu_gain", "gain", weak), ["state.yaw_rate_rad_s"])

    assert np.abs(yaw_rate(simulator)).max() > 1e-3
    assert np.abs(yaw_rate(held)).max() < 1e-9
    assert "steer_lateral" in held.vehicle.undiagnosable_effects


@pytest.mark.parametrize("rows", [1, 2, 4])
def test_no_damping_of_a_standing_wheel_makes_the_steps_swing_by_themselves(rows, monkeypatch):
    """In steps of 5 ms wheels at rest turned to and fro by 0.2 rad/s, and sensitivities at a stop were chance."""
    t = np.arange(1600) * 0.01
    speed = np.clip(20.0 - 2.5 * np.clip(t - 1.0, 0.0, None), 0.0, None)
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS} | {"ax_mps2": np.gradient(speed, t)}
    channels |= {f"pressure_{w}_pa": 15e5 * (t > 1.0) for w in WHEELS}
    dataset = prepare([make_log("log", t, channels)], 0.308)
    (damping,) = [one for one in paper_car().nuisances if one.name == "wheel_brake_windup_time_s"]
    assert damping.bound == 3.0
    monkeypatch.setattr(
        "hil.diagnosis.simulation.simulator.rows_per_step", lambda recording: np.full(len(recording.inputs), rows)
    )
    simulator = Simulator(dataset, paper_car())
    parameters = nominal(simulator.vehicle).with_nuisances([damping], np.array([damping.bound]))
    assert np.abs(simulator.run(parameters)["wheel"][-200:]).max() < 1e-4
