import numpy as np
import pytest

from hil.validation.reference_car.car import NOMINAL
from hil.validation.reference_car.drive import drive
from hil.validation.reference_car.manoeuvres import manoeuvre_set
from hil.validation.reference_car.noise import QUANTUM, draw_noise, gusts
from hil.validation.reference_car.sensors import SensorFault, observe
from hil.validation.reference_car.snr import difference, signal_to_noise, whitened
from hil.validation.reference_car.strengths import ROWS

BY_NAME = {manoeuvre.name: manoeuvre for manoeuvre in manoeuvre_set("full")}
NOISE = draw_noise("medium", np.random.default_rng(3))


@pytest.fixture(scope="module")
def stop():
    manoeuvre = BY_NAME["m05_stop_130_hot"]
    return drive(manoeuvre, NOMINAL, np.zeros((ROWS, 4)), np.zeros(ROWS), 0, np.zeros((manoeuvre.ticks, 2)))


def fault(name, strength, onset=0.0):
    return {name: SensorFault(np.broadcast_to(np.asarray(strength, float), 4), onset)}


def test_a_log_repeats_itself_and_depends_on_the_seed(stop):
    first, again, other = (observe(stop, NOISE, {}, (seed,)) for seed in (1, 1, 2))
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
    assert (first["ax_mps2"] != other["ax_mps2"]).any()


def test_teeth_give_the_speed(stop):
    noisy, clean = observe(stop, NOISE, {}, (1,)), observe(stop, NOISE, {}, (1,), clean=True)
    fast = clean["wheel_speed_fl_rad_s"] > 20.0
    apart = (noisy["wheel_speed_fl_rad_s"] - clean["wheel_speed_fl_rad_s"])[fast]
    assert abs(apart.mean()) < 0.05
    assert apart.std() < 0.2
    assert noisy["wheel_speed_fl_rad_s"][-1] == 0.0


def test_teeth_tell_which_way_the_wheel_turns():
    manoeuvre = next(one for one in manoeuvre_set("decide") if one.name == "stop_reverse")
    back = drive(manoeuvre, NOMINAL, np.zeros((ROWS, 4)), np.zeros(ROWS), 0, np.zeros((manoeuvre.ticks, 2)))
    noisy, clean = observe(back, NOISE, {}, (1,)), observe(back, NOISE, {}, (1,), clean=True)
    fast = clean["wheel_speed_fl_rad_s"] < -10.0
    assert fast.sum() > 200
    assert (noisy["wheel_speed_fl_rad_s"] - clean["wheel_speed_fl_rad_s"])[fast].std() < 0.2
    assert noisy["wheel_speed_fl_rad_s"][-1] == 0.0


def test_time_runs_and_frames_wait(stop):
    steps = np.diff(observe(stop, NOISE, {}, (1,))["t_s"])
    assert (steps > 0.0).all()
    assert steps.std() > 1e-4


def test_values_are_steps_of_the_bus(stop):
    table = observe(stop, NOISE, {}, (1,))
    for name, channel in (("ax_mps2", "ax"), ("pressure_fl_pa", "pressure"), ("motor_torque_rr_nm", "motor")):
        steps = table[name] / QUANTUM[channel]
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_satellite_speed_comes_ten_times_a_second(stop):
    present = np.isfinite(observe(stop, NOISE, {}, (1,))["speed_mps"])
    assert present.mean() == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("name", "strength", "channel", "expected"),
    [
        ("imu_bias", 0.5, "ax_mps2", lambda v: v + 0.5),
        ("imu_gain", 0.1, "ax_mps2", lambda v: 1.1 * v),
        ("pressure_offset", 1e5, "pressure_rl_pa", lambda v: v + 1e5),
        ("pressure_gain", -0.1, "pressure_rl_pa", lambda v: 0.9 * v),
        ("wrong_scale", -2.0, "motor_torque_fl_nm", lambda v: -v),
        ("speed_scale", 0.02, "speed_mps", lambda v: 1.02 * v),
    ],
)
def test_sensor_effects_from_their_onset_on(stop, name, strength, channel, expected):
    plain = observe(stop, NOISE, {}, (1,), clean=True)
    found = observe(stop, NOISE, fault(name, strength, 4.0), (1,), clean=True)
    k = 400
    np.testing.assert_allclose(found[channel][:k], plain[channel][:k], equal_nan=True)
    np.testing.assert_allclose(found[channel][k:], expected(plain[channel][k:]), rtol=1e-9, atol=1e-9)


def test_a_late_node_shows_what_was(stop):
    plain = observe(stop, NOISE, {}, (1,), clean=True)
    late = observe(stop, NOISE, fault("timestamp_offset", [0.0, 0.1, 0.0, 0.0]), (1,), clean=True)
    np.testing.assert_allclose(late["ax_mps2"][100:600], plain["ax_mps2"][90:590], atol=0.05)
    np.testing.assert_allclose(late["pressure_fl_pa"], plain["pressure_fl_pa"])


def test_lost_frames_repeat_the_last(stop):
    held = observe(stop, NOISE, fault("frame_drop", [0.0, 0.5, 0.0, 0.0]), (1,))
    repeated = (np.diff(held["ax_mps2"]) == 0.0) & (np.diff(held["ay_mps2"]) == 0.0)
    assert 0.4 < repeated.mean() < 0.6


def test_whitening_knows_the_noise():
    """A noisy log less its clean twin gives innovations of variance one: the noise model is the noise."""
    name = "m02_coast_fast_out"
    noise = draw_noise("medium", np.random.default_rng(7))
    manoeuvre = BY_NAME[name]
    sums, counts = np.zeros(3), 0
    for seed in range(6):
        blown = gusts(manoeuvre.ticks, noise, np.random.default_rng(seed))
        zero = np.zeros((ROWS, 4))
        noisy = observe(drive(manoeuvre, NOMINAL, zero, np.zeros(ROWS), 0, blown), noise, {}, (seed,))
        calm = drive(manoeuvre, NOMINAL, zero, np.zeros(ROWS), 0, 0.0 * blown)
        clean = observe(calm, noise, {}, (seed,), clean=True)
        z = whitened(difference([noisy], [clean]), [clean], noise)
        rows = len(clean["t_s"])
        motion = z[: 6 * rows].reshape(rows, 6)
        sums += np.mean(motion[:, :4] ** 2), np.mean(motion[:, 4] ** 2), np.mean(z[6 * rows :] ** 2)
        counts += 1
    np.testing.assert_allclose(sums / counts, 1.0, atol=0.15)


def test_snr_beside_imitations():
    signal, other = np.array([3.0, 4.0, 0.0]), np.array([[0.0], [0.0], [1.0]])
    assert signal_to_noise(signal, np.empty((3, 0))) == (5.0, 5.0)
    assert signal_to_noise(signal, other)[0] == pytest.approx(5.0)
    beside, alone = signal_to_noise(signal, signal[:, None])
    assert alone == 5.0
    assert beside == pytest.approx((25.0 / 26.0) ** 0.5)


def test_who_stands_first_is_no_signature(stop):
    table = observe(stop, NOISE, {}, (1,), clean=True)
    apart = difference([table], [table])[0]
    moving = np.isfinite(apart["ax_mps2"])
    assert 0.5 < moving.mean() < 1.0
    assert table["wheel_speed_fl_rad_s"][moving].min() >= 10.0
