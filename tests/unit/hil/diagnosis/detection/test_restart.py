"""Causes that the vehicle's numbers stood in for."""

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refitted
from hil.diagnosis.detection.restart import refit_from_nominal
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

WEAKER = -0.2
DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


@pytest.mark.slow
def test_pads_that_brake_gains_stood_in_for_are_found():
    vehicle = load_vehicle(VEHICLE)
    case = prepare([log_as_driven(vehicle, 0.318)], 0.318)
    rig, base = Simulator(case, vehicle), nominal(vehicle)
    (pads,) = [one for one in candidates(columns()) if one.name == "pad_mu_gain@car"]
    rng = np.random.default_rng(2)
    (drive,) = case.recordings
    for group, told in rig.run(pads.applied(base, WEAKER)).items():
        drive.measured[group][:] = told + DEVIATIONS.get(group, 0.02) * rng.standard_normal(told.shape)
    numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True)
    bent, noise = numbers.fit(*numbers.fitter.start())
    gains = [k for k, one in enumerate(numbers.nuisances) if one.name.startswith("brake_gain")]
    assert (bent.z[gains] < -2.0).any()
    begun = numbers.fitter.at(bent.z, (Term(pads, 0.0),), noise)
    stuck = refitted(FittedHypothesis(begun.terms[0], begun, begun.cost, 0.0, 1.0, noise), begun, noise)
    fitter = numbers.fitter
    (found,), (without, _) = refit_from_nominal(numbers, [stuck], bent, refitted, stuck.cost, anew=1)
    assert numbers.fitter is fitter
    assert found.term.value == pytest.approx(WEAKER, abs=0.02)
    assert criterion(found) < criterion(stuck)
    assert found.cost + 100.0 < min(without.cost, fitter.cost(bent.residual, bent.z, noise))
