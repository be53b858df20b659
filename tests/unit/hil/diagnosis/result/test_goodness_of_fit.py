"""Goodness of fit: whiteness of innovations, and a car that the model does not describe."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.result import Settings
from hil.diagnosis.detection.stepwise import StepwiseSelection
from hil.diagnosis.result.goodness_of_fit import goodness_of_fit, whiteness
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car


def test_white_innovations_are_white_and_coloured_ones_are_not():
    noise = np.random.default_rng(3).standard_normal(4000)
    rho, p = whiteness(noise)
    assert abs(rho) < 0.05
    assert p > 0.01
    rho, p = whiteness(noise[1:] + 0.5 * noise[:-1])
    assert rho == pytest.approx(0.4, abs=0.05)
    assert p < 1e-6
    assert whiteness(noise[:10]) == (0.0, 1.0)
    assert whiteness(np.zeros(1000)) == (0.0, 1.0)


@pytest.fixture(scope="module")
def diagnosis():
    """The shipped car's own drive, with noise, and no cause asked for."""
    vehicle = paper_car()
    rig = Simulator(prepare([log_as_driven(vehicle, 0.308)], 0.308), vehicle)
    rng, (drive,) = np.random.default_rng(0), rig.dataset.recordings
    for group, values in rig.run(nominal(vehicle)).items():
        size = {"pressure": 2e3, "motor": 0.5}.get(group, 0.02)
        drive.measured[group][:] = values + size * rng.standard_normal(values.shape)
    settings = Settings(most_causes=0, dictionary=False)
    return StepwiseSelection(rig.dataset, vehicle, nominal(vehicle), settings, lambda _: None).run()


def test_a_car_that_the_model_describes(diagnosis):
    fits = {one.track: one for one in goodness_of_fit(diagnosis)}
    speed = fits["wheel.mean"]
    assert all(one.described for one in fits.values())
    assert speed.channel == "wheel_speed"
    assert speed.unexplained < 0.02
    assert speed.worst_error >= speed.error


def _rolls_on(diagnosis, model):
    """A model of the car that brakes while the measured one, from the middle on, rolls on."""
    drifted = {name: values.copy() for name, values in model.residual.items()}
    late = np.arange(len(drifted["wheel.mean"])) * diagnosis.fitter.masks.sample_s - 10.0
    drifted["wheel.mean"][:, 0] += np.maximum(late, 0.0)
    return replace(model, residual=drifted)


def test_brakes_that_do_something_else_are_no_car_of_ours(diagnosis):
    final, told = (_rolls_on(diagnosis, one) for one in (diagnosis.final, diagnosis.nominal))
    speed = {one.track: one for one in goodness_of_fit(replace(diagnosis, final=final, nominal=told))}["wheel.mean"]
    assert not speed.described
    assert speed.worst_s[1] > 10.0
    assert speed.whiteness_p < 1e-3


def test_a_fit_that_drifts_is_no_other_car(diagnosis):
    """What the vehicle as told describes, the model describes."""
    final = _rolls_on(diagnosis, diagnosis.final)
    speed = {one.track: one for one in goodness_of_fit(replace(diagnosis, final=final))}["wheel.mean"]
    assert speed.unexplained > 0.1
    assert speed.error_as_stated < 0.1 * speed.error
    assert speed.described
