"""Score tests behind a limit: candidates with zero gradient."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.profile_fit import CandidateFits
from hil.diagnosis.detection.score_test import has_zero_gradient, line_search, score
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car

COLUMNS = columns()
(POWER,) = [one for one in candidates(COLUMNS) if one.effect.name == "iwm_field"]
LOST = -0.93
NOISE_NM = 0.5


@pytest.fixture(scope="module")
def weaker():
    """A drive on which motors that have lost most of their power meet its limit; one that has lost a little does not.

    Its fitter, the model without the loss, and its noise.
    """
    vehicle, dataset = paper_car(), prepare([log_of_pulses()], 0.308)
    simulator, base = Simulator(dataset, vehicle), nominal(vehicle)
    (recording,) = dataset.recordings
    rng = np.random.default_rng(5)
    for group, values in simulator.run(POWER.applied(base, LOST)).items():
        size = {"pressure": 2e3, "motor": NOISE_NM}.get(group, 0.02)
        recording.measured[group][:] = values + size * rng.standard_normal(values.shape)
    masks = SampleMasks.of(dataset)
    none = {name: np.zeros((len(masks.log_start), 0)) for name in masks.names}
    fitter = Fitter(simulator, masks, base, (), none)
    return (fitter, *fitter.alternate_noise_and_fit(*fitter.start(), 1))


def test_a_small_step_shows_nothing_and_a_simulation_at_full_size_does(weaker):
    fitter, model, noise = weaker
    (column,) = [COLUMNS[k] for k in POWER.columns]
    stepped = [column.stepped(fitter.parameter_set(model.z, ()))]
    jacobian = finite_difference_jacobian(fitter.simulator, fitter.masks, model.channels, stepped, [column.step])
    assert not any(values.any() for values in jacobian.values())
    item = score(POWER, 0.0, 0.0)
    assert has_zero_gradient(item)
    test = line_search(fitter, model, noise, item)
    assert test.replayed
    assert test.max_snr > 3.0
    assert test.value == pytest.approx(LOST, abs=0.05)
    fits = CandidateFits(fitter, jacobian, model, noise, relinearise=True)
    again, left = fits.profile_over_noise(replace(test, candidate=replace(POWER, columns=(0,))))
    assert again.raw_gain >= test.raw_gain
    assert fits.fit(again, left).term.value == pytest.approx(LOST, abs=0.005)


def test_what_no_size_explains_stays_at_zero(weaker):
    (pedal,) = [
        one for one in candidates(COLUMNS) if one.effect.name == "pedal_sensor" and one.parameter.name == "gain"
    ]
    test = line_search(*weaker, score(pedal, 0.0, 0.0))
    assert test.value == test.max_snr == 0.0
    assert not test.replayed
