"""Causes that nuisance parameters absorbed."""

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.profile_fit import criterion, refitted, unscored
from hil.diagnosis.detection.restart import refit_from_nominal
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

WEAKER = -0.2
DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


@pytest.mark.slow
def test_pads_that_brake_gains_absorbed_are_estimated():
    vehicle = load_vehicle(VEHICLE)
    dataset = prepare([log_as_driven(vehicle, 0.318)], 0.318)
    simulator, base = Simulator(dataset, vehicle), nominal(vehicle)
    (pads,) = [one for one in candidates(columns()) if one.name == "pad_mu_gain@car"]
    rng = np.random.default_rng(2)
    (recording,) = dataset.recordings
    for group, values in simulator.run(pads.applied(base, WEAKER)).items():
        recording.measured[group][:] = values + DEVIATIONS.get(group, 0.02) * rng.standard_normal(values.shape)
    nuisance_fit = NuisanceFit(simulator, SampleMasks.of(dataset), vehicle, base, relinearise=True)
    biased, noise = nuisance_fit.fit(*nuisance_fit.fitter.start())
    gains = [k for k, one in enumerate(nuisance_fit.nuisances) if one.name.startswith("brake_gain")]
    assert (biased.z[gains] < -2.0).any()
    start = nuisance_fit.fitter.at(biased.z, (Term(pads, 0.0),), noise)
    stuck = refitted(unscored(start, noise, 1.0), start, noise)
    fitter = nuisance_fit.fitter
    (better,), (without, _) = refit_from_nominal(nuisance_fit, [stuck], biased, refitted, stuck.cost, 1)
    assert nuisance_fit.fitter is fitter
    assert better.term.value == pytest.approx(WEAKER, abs=0.02)
    assert criterion(better) < criterion(stuck)
    assert better.cost + 100.0 < min(without.cost, fitter.cost(biased.residual, biased.z, noise))
