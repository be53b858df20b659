"""The gain on manoeuvres that no fit saw."""

import numpy as np
from pulses import log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.result.cross_validation import folds, held_out_residual
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from hil.diagnosis.vehicle.priors import recording_nuisances


class Watched(Fitter):
    """Notes the numbers that it replays."""

    def residual(self, z, terms):
        self.replayed.append(z)
        return super().residual(z, terms)


def _replayed(name: str, deviations: float) -> tuple[Watched, int]:
    """Fitter of two logs of a car one of whose numbers is so far off; that number. It noted what folds replayed."""
    vehicle, base = paper_car(), nominal(paper_car())
    first = log_of_pulses()
    logs = [first, first]  # several manoeuvres, to hold some out
    rig = Simulator(prepare(logs, 0.308), vehicle)
    nuisances = (*vehicle.nuisances, *recording_nuisances(True, vehicle.latencies))
    names = [nuisance.name for nuisance in nuisances]
    number = names.index(name)
    off = np.where(np.arange(len(names)) == number, deviations, 0.0)
    told, at = rig.run(base.with_nuisances(nuisances, off)), 0
    for drive in rig.dataset.recordings:
        for group, values in told.items():
            drive.measured[group][:] = values[at : at + drive.samples]
        at += drive.samples
    of = NuisanceFit(rig, SampleMasks.of(rig.dataset), vehicle, base, relinearise=True).fitter
    fitter = Watched(of.simulator, of.masks, of.base, of.nuisances, of.nuisance_jacobian)
    fitter.replayed = []
    model, noise = fitter.start()
    fitter.replayed.clear()
    held_out_residual(fitter, noise, model)
    assert len(fitter.replayed) == len(folds(of.masks)) >= 2
    return fitter, number


def test_no_fold_moves_a_number_farther_than_it_may_go():
    """A demand acted on before it was made spoilt the torque of motors on every manoeuvre held out."""
    fitter, early = _replayed("late_motor_demand", -0.5)
    assert all(z[early] >= 0.0 for z in fitter.replayed)
    assert all((np.abs(z) <= fitter.bound).all() for z in fitter.replayed)


def test_a_fold_moves_by_what_it_leaves_out_alone():
    """From a fit that one more step would move all folds went beyond the truth, and a wheel locked in what they held
    out."""
    fitter, gain = _replayed("brake_gain_front", 1.0)
    assert all(abs(z[gain]) < 0.3 for z in fitter.replayed)
