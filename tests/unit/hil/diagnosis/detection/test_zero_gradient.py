"""Causes behind a limit."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.profile_fit import CandidateFits
from hil.diagnosis.detection.score_test import score
from hil.diagnosis.detection.zero_gradient import has_zero_gradient, line_search
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
    vehicle, case = paper_car(), prepare([log_of_pulses()], 0.308)
    rig, base = Simulator(case, vehicle), nominal(vehicle)
    (drive,) = case.recordings
    rng = np.random.default_rng(5)
    for group, told in rig.run(POWER.applied(base, LOST)).items():
        size = {"pressure": 2e3, "motor": NOISE_NM}.get(group, 0.02)
        drive.measured[group][:] = told + size * rng.standard_normal(told.shape)
    frame = SampleMasks.of(case)
    none = {name: np.zeros((len(frame.log_start), 0)) for name in frame.names}
    fitter = Fitter(rig, frame, base, (), none)
    return (fitter, *fitter.alternate_noise_and_fit(*fitter.start(), 1))


def test_a_small_step_shows_nothing_and_a_replay_does(weaker):
    fitter, model, noise = weaker
    world = fitter.world(model.z, ())
    (column,) = [COLUMNS[k] for k in POWER.columns]
    shown = finite_difference_jacobian(fitter.rig, fitter.frame, model.stack, [column.stepped(world)], [column.step])
    assert not any(values.any() for values in shown.values())
    item = score(POWER, 0.0, 0.0)
    assert has_zero_gradient(item)
    met = line_search(fitter, model, noise, item)
    assert met.replayed
    assert met.max_snr > 3.0
    assert met.value == pytest.approx(LOST, abs=0.05)
    contest = CandidateFits(fitter, shown, model, noise, relinearise=True)
    again, quieter = contest.profile_over_noise(replace(met, candidate=replace(POWER, columns=(0,))))
    assert again.raw_gain >= met.raw_gain
    assert contest.fit(again, quieter).term.value == pytest.approx(LOST, abs=0.005)


def test_what_no_size_explains_stays_at_nothing(weaker):
    (pedal,) = [
        one for one in candidates(COLUMNS) if one.effect.name == "pedal_sensor" and one.parameter.name == "gain"
    ]
    met = line_search(*weaker, score(pedal, 0.0, 0.0))
    assert met.value == met.max_snr == 0.0
    assert not met.replayed
