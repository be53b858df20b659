"""Worlds: the vehicle's numbers move without corners, and stay what they are."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.parameter_set import Change, nominal
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.diagnosis.vehicle.priors import ZERO_SD, Nuisance, NuisanceKind, of_the_day, recording_nuisances
from plant.injection.theta import THETA

SIX = {
    "mass_kg": 1650.0, "wheelbase_m": 2.72, "cog_to_front_axle_m": 1.3, "rolling_radius_m": 0.318,
    "brake_gain_front_nm_pa": 2.9e-4, "brake_gain_rear_nm_pa": 1.7e-4,
}  # fmt: skip
WHEELS = ("fl", "fr", "rl", "rr")
TOLD = (("wheel_speed", "rad_s"), ("pressure", "pa"))
STEPS = np.linspace(-1.0, 1.0, 25)  # of how far each may be off


@pytest.mark.parametrize("vehicle", [paper_car(), load_vehicle(SIX)], ids=["own numbers", "six numbers"])
def test_every_number_of_the_vehicle_moves_without_a_corner(vehicle):
    """A number that stands still for part of its range has no sensitivity there, and the fit would go to and fro."""
    base = nominal(vehicle)
    for nuisance in vehicle.nuisances:
        for at, step in zip(nuisance.at, nuisance.step, strict=True):
            parameter_sets = [base.with_nuisances([nuisance], np.array([z])) for z in nuisance.bound * STEPS]
            in_theta = nuisance.kind in ("sensor", "side_to_side", "line_lag")
            values = np.array([(parameters.theta if in_theta else parameters.p)[at] for parameters in parameter_sets])
            moved = np.diff(values) * np.sign(step)
            assert (moved > 0.0).all(), nuisance.name
            assert moved.max() < 30.0 * moved.min(), nuisance.name  # from a fifth to five times
            if nuisance.kind == "vehicle" and base.p[at] > 0.0:
                assert values.min() > 0.0, nuisance.name
                assert values.max() < 5.001 * base.p[at], nuisance.name


def test_one_standard_deviation_is_what_the_set_says():
    vehicle = paper_car()
    mass = next(nuisance for nuisance in vehicle.nuisances if nuisance.name == "vehicle_mass_kg")
    base = nominal(vehicle)
    assert base.with_nuisances([mass], np.array([1.0])).p[mass.at[0]] == pytest.approx(
        base.p[mass.at[0]] + mass.step[0]
    )


def test_what_single_wheels_are_off_was_there_before_a_cause_of_the_same_kind():
    """Pads of one wheel that lose a tenth from the second log on took with them, before, what all four are off."""
    base = nominal(load_vehicle(SIX))
    pads = THETA.slice("pad_mu_gain", "gain")
    off = replace(base, theta=base.theta.copy())
    off.theta[pads] = (0.01, -0.02, 0.0, 0.01)
    weak = replace(off, theta=off.theta.copy())
    weak.theta[pads.start] -= 0.1
    begun = weak.with_onset("pad_mu_gain", 1, 2.0, before=off)
    t = np.arange(3000) * 0.01
    logs = [
        make_log(name, t, {f"{what}_{w}_{unit}": 20.0 + 0.0 * t for w in WHEELS for what, unit in TOLD})
        for name in "abc"
    ]
    first, second, third = prepare(logs, 0.318).recordings
    assert begun.theta_in(first)[pads].tolist() == off.theta[pads].tolist()
    assert begun.theta_in(second)[THETA.slice("pad_mu_gain", "onset_s")] == 2.0
    assert begun.theta_in(third)[pads].tolist() == weak.theta[pads].tolist()


def test_an_inertial_unit_has_zeros_across():
    """0.012 m/s2, a tenth of a degree, were named as a cause."""
    nuisances = recording_nuisances(True, paper_car().latencies)
    base = nominal(paper_car())
    z = np.array([1.0 if one.kind == "sensor" else 0.0 for one in nuisances])
    theta = base.with_nuisances(nuisances, z).theta
    assert theta[THETA.slice("imu_bias", "ay_mps2")] == pytest.approx(ZERO_SD["ay_mps2"])
    assert theta[THETA.slice("imu_bias", "yaw_rate_rad_s")] == pytest.approx(ZERO_SD["yaw_rate_rad_s"])
    assert np.flatnonzero(theta != base.theta).size == 2
    assert (base.with_nuisances(nuisances, 0.0 * z).theta == base.theta).all()


def test_what_has_changed_since_a_reference_acts_in_later_logs_alone():
    """Values of causes go to the change, numbers of the car to all logs, what differs from day to day to later ones."""
    base = replace(nominal(load_vehicle(SIX)), change=Change(2))
    pads, wind = THETA.slice("pad_mu_gain", "gain"), THETA.slice("headwind", "wind_mps")
    common = Nuisance("pad_mu_gain@front", (pads.start, pads.start + 1), (0.1, 0.1), NuisanceKind.LEARNED)
    days = of_the_day((), base.p, disc_measured=False)
    at = [one.name for one in days].index("headwind.wind_mps_of_the_day_0")
    moved = base.with_nuisances((common, *days), np.append(0.5, np.eye(len(days))[at] + np.eye(len(days))[-1]))
    moved = moved.adding([pads.start], -0.2)
    assert moved.in_recording(1).theta[pads] == pytest.approx([0.05, 0.05, 0.0, 0.0])
    assert moved.in_recording(2).theta[pads] == pytest.approx([1.05 * 0.8 - 1.0, 0.05, 0.0, 0.0])
    assert moved.in_recording(1).theta[wind] == 0.0
    assert moved.in_recording(2).theta[wind] == pytest.approx(2.0**0.5)
    assert moved.in_recording(1).disc_offset_k == 0.0
    assert moved.in_recording(2).disc_offset_k == pytest.approx(15.0 * 2.0**0.5)
    begun = moved.adding([pads.start + 3], -0.1).with_onset("pad_mu_gain", 3, 2.0, before=moved)
    assert begun.in_recording(1).onsets == ()
    (onset,) = begun.in_recording(2).onsets
    assert onset.before[: pads.stop - pads.start] == pytest.approx([1.05 * 0.8 - 1.0, 0.05, 0.0, 0.0])


def test_an_effect_that_begins_since_the_reference_is_not_in_it():
    """An extension whose pads lose a fifth in the third log; the first two are the reference, all bite 30 % more."""
    bare = nominal(load_vehicle(SIX))
    pads = THETA.slice("pad_mu_gain", "gain")
    weak = bare.adding(range(pads.start, pads.stop), -0.2).with_onset("pad_mu_gain", 2, 4.0, before=bare)
    base = replace(weak, change=Change(2))
    at = tuple(range(pads.start, pads.stop))
    common = Nuisance("pad_mu_gain@car", at, (0.1,) * 4, NuisanceKind.LEARNED)
    day = Nuisance("pad_mu_gain.gain_of_the_day_0", (pads.start,), (0.01,), NuisanceKind.OF_THE_DAY)
    moved = base.with_nuisances((common, day), np.array([3.0, 2.0]))
    assert moved.in_recording(1).theta[pads] == pytest.approx(np.full(4, 0.3))
    assert moved.in_recording(1).onsets == ()
    (onset,) = moved.in_recording(2).onsets
    assert onset.before[: len(at)] == pytest.approx([1.3 * 1.02 - 1.0, 0.3, 0.3, 0.3])
    assert moved.in_recording(2).theta[pads] == pytest.approx([1.1 * 1.02 - 1.0, 0.1, 0.1, 0.1])
