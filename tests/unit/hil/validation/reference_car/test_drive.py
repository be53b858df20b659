import functools
from dataclasses import replace

import numpy as np
import pytest

from hil.validation.reference_car.car import NOMINAL, TOLERANCE, true_car
from hil.validation.reference_car.catalogue import LISTED, UNLISTED
from hil.validation.reference_car.drive import STEP_S, drive, energy_balance
from hil.validation.reference_car.manoeuvres import SETS, TICK_S, manoeuvre_set
from hil.validation.reference_car.strengths import ROWS, E, S, Y

BY_NAME = {manoeuvre.name: manoeuvre for manoeuvre in manoeuvre_set("full")}
SHOWING = ("m03_motor_36", "m05_stop_72_cold", "m05_stop_72_hot", "m06_regen_stop", "m07_slalom_stop", "m08_motor_hard")


def driven(name, strength=None, onset=None, law=0, car=NOMINAL, gusts=None):
    manoeuvre = BY_NAME[name]
    return drive(
        manoeuvre, car, np.zeros((ROWS, 4)) if strength is None else strength,
        np.zeros(ROWS) if onset is None else onset, law, np.zeros((manoeuvre.ticks, 2)) if gusts is None else gusts,
    )  # fmt: skip


def test_energy_adds_up_in_every_manoeuvre():
    for name in BY_NAME:
        assert abs(energy_balance(driven(name), NOMINAL)) < 1e-4, name


def test_a_missing_loss_would_show_in_the_balance():
    whole = driven("m05_stop_72_cold")
    outputs = whole.outputs.copy()
    outputs[:, Y.rolling_w] = 0.0
    broken = replace(whole, outputs=outputs)
    assert abs(energy_balance(broken, NOMINAL)) > 1e-3


def test_deceleration_is_force_over_mass():
    """30 bar cold: gain p mu / mu0 over radius and mass with the wheels' inertia, within the drag and rolling loss."""
    stop = driven("m05_stop_72_cold")
    k = round(3.0 / STEP_S)
    mu = stop.states[k, S.mu]
    torque = 2.0 * (NOMINAL.brake_gain_front_nm_pa + NOMINAL.brake_gain_rear_nm_pa) * (30e5 - 5e4) * mu / 0.39832
    mass = NOMINAL.mass_kg + 4.0 * NOMINAL.wheel_inertia_kg_m2 / NOMINAL.rolling_radius_m**2
    losses = 0.011 * 9.81 + 0.5 * 1.205 * 0.645 * stop.states[k, S.speed_mps] ** 2 / NOMINAL.mass_kg
    expected = torque / NOMINAL.rolling_radius_m / mass + losses
    found = (stop.states[k - 20, S.speed_mps] - stop.states[k + 20, S.speed_mps]) / (40 * STEP_S)
    assert found == pytest.approx(expected, rel=0.02)


def test_pressure_changes_no_faster_than_the_hydraulics_can():
    """At the end of every step: what a rate exceeds its limit by would keep it there when the demand is reached."""
    strength = np.zeros((ROWS, 4))
    strength[E.ehb_rate_limit] = -0.2
    for hidden, share in ((None, 1.0), (strength, 0.8)):
        rate = driven("m10_hold_pressure", hidden).states[:, S.pressure_rate_pa_s : S.pressure_rate_pa_s + 4]
        assert rate.max() == pytest.approx(share * NOMINAL.ehb_build_rate_pa_s, rel=1e-12)
        assert rate.min() == pytest.approx(-share * NOMINAL.ehb_release_rate_pa_s, rel=1e-12)


def test_actuators_follow_what_the_frames_say():
    """A driver's demand between two quanta: pressure control and motors get the quantum, and settle there."""
    hold, pulses = BY_NAME["m10_hold_pressure"], BY_NAME["m03_motor_20"]
    none = np.zeros((ROWS, 4)), np.zeros(ROWS), 0
    off = replace(hold, pressure_pa=hold.pressure_pa + 4e3 * (hold.pressure_pa > 0.0))
    braked = drive(off, NOMINAL, *none, np.zeros((hold.ticks, 2)))
    last = np.flatnonzero(braked.pressure_demand_pa[:, 0] == braked.pressure_demand_pa.max())[-1]
    assert off.pressure_pa[last, 0] - braked.pressure_demand_pa[last, 0] == pytest.approx(4e3)
    at = round((last * TICK_S + NOMINAL.ehb_dead_time_s) / STEP_S)
    assert braked.states[at, S.pressure_pa] == pytest.approx(braked.pressure_demand_pa[last, 0], abs=500.0)

    shifted = replace(pulses, motor_nm=pulses.motor_nm + 0.2 * (pulses.motor_nm != 0.0))
    driven_by = drive(shifted, NOMINAL, *none, np.zeros((pulses.ticks, 2)))
    steps = driven_by.motor_demand_nm / 0.5
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    most = int(np.abs(driven_by.motor_demand_nm[:, 0]).argmax())
    last = most + int((driven_by.motor_demand_nm[most:, 0] == driven_by.motor_demand_nm[most, 0]).argmin()) - 1
    felt = driven_by.states[round(last * TICK_S / STEP_S), S.motor_nm]
    assert felt == pytest.approx(driven_by.motor_demand_nm[last, 0], abs=0.05)


def test_pads_rest_where_equation_3_rests():
    x = driven("m02_coast_slow_out").states
    rest = NOMINAL.pad_a_1_ks / NOMINAL.pad_b_1_j * 320.0 / NOMINAL.pad_epsilon_w
    assert x[0, S.mu] == pytest.approx(rest)
    assert x[-1, S.mu] == pytest.approx(rest, rel=5e-3)


def test_softer_springs_dive_deeper_and_swing_slower():
    """Springs of 1 / 1.5; inertia and dampers stay: the body's damped frequency goes with sqrt(k / I - (d / 2 I)^2)."""
    softness = np.zeros((ROWS, 4))
    softness[E.pitch_dive, 0] = 0.5
    depth, half_s = [], []
    for strength in (None, softness):
        stop = driven("m05_stop_72_cold", strength)
        held = round(3.0 / STEP_S)
        depth.append(stop.states[held, S.pitch_rad])
        standing = stop.states[np.argmax(stop.states[:, S.speed_mps] < 0.01) :, S.pitch_rate_rad_s]
        turns = np.flatnonzero(np.diff(np.sign(standing)) != 0)
        half_s.append((turns[1] - turns[0]) * STEP_S)
    assert depth[1] / depth[0] == pytest.approx(1.5, rel=0.02)
    ours = (1.0 / 1.5 - NOMINAL.pitch_damping**2) / (1.0 - NOMINAL.pitch_damping**2)
    assert half_s[1] / half_s[0] == pytest.approx(ours**-0.5, rel=0.03)


def test_slope_is_felt_by_the_wheels_and_not_by_the_accelerometer():
    plain, gusts = driven("m02_coast_fast_out"), np.zeros((BY_NAME["m02_coast_fast_out"].ticks, 2))
    gusts[:, 1] = 0.2
    up = driven("m02_coast_fast_out", gusts=gusts)
    k = round(3.0 / STEP_S)
    inertia = 4.0 * NOMINAL.wheel_inertia_kg_m2 / NOMINAL.rolling_radius_m**2 / NOMINAL.mass_kg
    lost = plain.states[k, S.speed_mps] - up.states[k, S.speed_mps]
    assert lost == pytest.approx(0.2 * 3.0 / (1.0 + inertia), rel=0.03)
    assert abs(up.states[k, S.imu_ax_mps2] - plain.states[k, S.imu_ax_mps2]) < 0.02


def acting(kind, magnitude):
    strength = np.zeros((ROWS, 4))
    strength[E.unlisted if kind.law else getattr(E, kind.name)] = kind.strength(magnitude, kind.where[0])
    return strength


CAUSES = [kind for kind in (*LISTED, *UNLISTED) if not kind.senses]


def largest_change(kind, magnitudes):
    seen = [S.speed_mps, S.omega_rad_s, S.imu_ax_mps2, S.pressure_pa, S.motor_nm]
    changed = 0.0
    for name in SHOWING:
        before = plain(name).states[:, seen]
        for magnitude in magnitudes:
            after = driven(name, acting(kind, magnitude), law=kind.law).states
            assert np.isfinite(after).all(), (name, magnitude)
            rows = min(len(after), len(before))
            changed = max(changed, float(np.abs(after[:rows, seen] - before[:rows]).max()))
    return changed


@functools.cache
def plain(name):
    return driven(name)


@pytest.mark.parametrize("kind", CAUSES, ids=lambda kind: kind.name)
def test_every_cause_shows(kind):
    assert (largest_change(kind, (kind.typical,)) > 1e-3) == kind.shows


@pytest.mark.slow
@pytest.mark.parametrize("kind", CAUSES, ids=lambda kind: kind.name)
def test_every_cause_is_finite_at_its_bounds(kind):
    assert largest_change(kind, (kind.low, kind.high)) >= 0.0


def test_nothing_happens_before_the_onset():
    strength, onset = np.zeros((ROWS, 4)), np.zeros(ROWS)
    strength[E.pad_mu_gain], onset[E.pad_mu_gain] = -0.3, 3.0
    whole, late = driven("m05_stop_72_cold"), driven("m05_stop_72_cold", strength, onset)
    k = round(3.0 / STEP_S)
    np.testing.assert_array_equal(late.states[:k], whole.states[:k])
    assert late.states[k + 400, S.speed_mps] > whole.states[k + 400, S.speed_mps] + 0.1


def test_true_cars_differ_within_their_tolerance():
    cars = [true_car(np.random.default_rng([seed, 1])) for seed in range(40)]
    for name, tolerance in TOLERANCE.items():
        values = np.array([getattr(car, name) for car in cars]) - getattr(NOMINAL, name)
        assert np.abs(values).max() <= tolerance * (1.0 + 1e-9)
        assert values.std() > 0.2 * tolerance


def test_sets_last_as_long_as_they_say():
    assert 150.0 < sum(m.ticks for m in manoeuvre_set("full")) * 0.01 < 220.0
    assert {m.direction for m in manoeuvre_set("full")} == {1, -1}
    for name in SETS:
        assert len({m.name for m in manoeuvre_set(name)}) == len(manoeuvre_set(name))
    assert manoeuvre_set("full", 3)[1].speed_mps != manoeuvre_set("full")[1].speed_mps


def test_a_wheel_that_lifts_drives_on():
    """With one front calliper 40 % too weak the car turns in under the brakes until a rear wheel is hardly loaded."""
    strength = np.zeros((ROWS, 4))
    strength[E.stuck_corner, 0] = 0.4
    for name in BY_NAME:
        assert np.isfinite(driven(name, strength).states).all(), name


def reversing(strength=None):
    stop = next(manoeuvre for manoeuvre in manoeuvre_set("decide") if manoeuvre.name == "stop_reverse")
    given = np.zeros((ROWS, 4)) if strength is None else strength
    return drive(stop, NOMINAL, given, np.zeros(ROWS), 0, np.zeros((stop.ticks, 2)))


def test_a_stop_in_reverse_is_a_stop_forward_turned_round():
    """Loads shift to the other axle, so pads and tyres see a little else."""
    back = reversing()
    ahead = drive(
        replace(back.manoeuvre, speed_mps=9.0), NOMINAL, np.zeros((ROWS, 4)), np.zeros(ROWS), 0,
        np.zeros((back.manoeuvre.ticks, 2)),
    )  # fmt: skip
    rows = round(3.0 / STEP_S)
    assert back.states[0, S.speed_mps] == -9.0
    np.testing.assert_allclose(-back.states[:rows, S.speed_mps], ahead.states[:rows, S.speed_mps], atol=0.01)
    assert abs(back.states[-1, S.speed_mps]) < 0.05
    assert len(back.states) == pytest.approx(len(ahead.states), rel=0.01)
    assert abs(energy_balance(back, NOMINAL)) < 1e-3


def test_the_leading_end_of_a_pad_grips_forward_and_less_in_reverse():
    strength = np.zeros((ROWS, 4))
    strength[E.caliper_asymmetry, 1] = 0.06
    at = round(2.0 / STEP_S)
    for stop, share in ((reversing(strength), -0.06), (driven("m05_stop_72_cold", strength), 0.06)):
        fl, fr = stop.outputs[at, Y.brake_nm], stop.outputs[at, Y.brake_nm + 1]
        assert fr / fl == pytest.approx(1.0 + share, rel=5e-3)
