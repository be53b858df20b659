"""The gain on manoeuvres that no fit saw."""

import numpy as np
from pulses import log_of_pulses

from hil.study.fitting.fit import Fitter
from hil.study.fitting.numbers import Numbers
from hil.study.likelihood.noise import Frame
from hil.study.logs.prepare import prepare
from hil.study.replay.rig import Rig
from hil.study.replay.vehicle import paper_car
from hil.study.replay.world import nominal
from hil.study.verdict.measure import folds, held_out


class Watched(Fitter):
    """Notes the numbers that it replays."""

    def residual(self, z, terms):
        self.replayed.append(z)
        return super().residual(z, terms)


def test_no_fold_moves_a_number_farther_than_it_may_go():
    """A demand acted on before it was made spoilt the torque of motors on every manoeuvre held out."""
    vehicle, base = paper_car(), nominal(paper_car())
    first = log_of_pulses()
    logs = [first, first]  # several manoeuvres, to hold some out
    rig = Rig(prepare(logs, 0.308), vehicle)
    numbers = Numbers(rig, Frame.of(rig.case), vehicle, base, relinearise=True)
    names = [nuisance.name for nuisance in numbers.nuisances]
    early = names.index("late_demand")
    off = np.where(np.arange(len(names)) == early, -0.5, 0.0)
    told, at = rig.run(base.shifted(numbers.nuisances, off)), 0
    for drive in rig.case.drives:
        for group, values in told.items():
            drive.measured[group][:] = values[at : at + drive.samples]
        at += drive.samples
    numbers.anew(np.zeros(len(names)))
    of = numbers.fitter
    fitter = Watched(of.rig, of.frame, of.base, of.nuisances, of.nuisance_columns)
    fitter.replayed = []
    model, noise = fitter.start()
    fitter.replayed.clear()
    held_out(fitter, noise, model)
    assert len(fitter.replayed) == len(folds(of.frame)) >= 2
    assert all(z[early] >= 0.0 for z in fitter.replayed)
    assert all((np.abs(z) <= fitter.farthest).all() for z in fitter.replayed)
