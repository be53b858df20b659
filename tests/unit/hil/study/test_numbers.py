"""The vehicle's numbers: how strained a model is, and a fit that no single number blocks."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.study.noise import Frame
from hil.study.numbers import Numbers, strain
from hil.study.prepare import prepare
from hil.study.rig import Rig
from hil.study.vehicle import paper_car
from hil.study.world import DISC_GUESSED_K, DISC_TOLD_K, nominal

NOISE_PA = 2e3


def test_numbers_within_their_tolerance_strain_nothing():
    rng = np.random.default_rng(3)
    assert strain(np.zeros(50)) == 1.0
    assert strain(0.5 * rng.standard_normal(50)) == 1.0
    assert strain(np.full(50, 2.0)) == pytest.approx(4.0)


def test_a_strained_number_at_its_end_wants_to_go_on():
    z = np.array([3.0, 1.0, 1.0, 1.0])
    assert strain(z) == pytest.approx(3.0)
    assert strain(z, np.full(4, 3.0)) == pytest.approx((4 * 9.0 + 3.0) / 4)
    assert strain(z / 3.0, np.full(4, 1.0)) == 1.0  # little strained


@pytest.mark.parametrize(("told_k", "deviation_k"), [(350.0, DISC_TOLD_K), (None, DISC_GUESSED_K)])
def test_discs_whose_temperature_is_told_are_known_better(told_k, deviation_k):
    vehicle = paper_car()
    case = prepare([replace(log_of_pulses(), disc_temperature_k=told_k)], 0.308)
    numbers = Numbers(Rig(case, vehicle), Frame.of(case), vehicle, nominal(vehicle), True)
    (disc,) = (one for one in numbers.nuisances if one.name == "disc_temperature_k")
    assert disc.step == (deviation_k,)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_dead_time_is_found_on_either_side(side):
    """It acts from step to step; a fit that keeps to one side leaves the other to effects."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    base = nominal(vehicle)
    rig = Rig(case, vehicle)
    names = [nuisance.name for nuisance in Numbers(rig, Frame.of(case), vehicle, base, True).nuisances]
    at = names.index("ehb_dead_time_s")
    numbers = Numbers(rig, Frame.of(case), vehicle, base, relinearise=True)
    off = np.where(np.arange(len(names)) == at, side * 0.6, 0.0)
    told = rig.run(base.shifted(numbers.nuisances, off))["pressure"]
    (drive,) = case.drives
    drive.measured["pressure"][:] = told + NOISE_PA * np.random.default_rng(1).standard_normal(told.shape)
    numbers.anew(np.zeros(len(names)))
    model, _ = numbers.fitted(*numbers.fitter.start())
    assert np.sign(model.z[at]) == side  # how much of it is latency, one log leaves open
    left = drive.measured["pressure"] - model.stack["pressure"]
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE_PA
