"""An effect with an onset goes into the extension file and comes back, in the same log, in others and in scenarios."""

from types import SimpleNamespace

import numpy as np
import pytest

from hil.diagnosis.result.extended_car import extended_car, write_extended_car
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.extension_file import load_extension
from hil.diagnosis.vehicle.load import paper_car
from plant.injection.theta import THETA

PADS = THETA.slice("pad_mu_gain", "gain")
BEGINS = THETA.slice("pad_mu_gain", "onset_s")


def _dataset(*names):
    recordings = [
        SimpleNamespace(log=SimpleNamespace(name=name, direction=1), number=k) for k, name in enumerate(names)
    ]
    return SimpleNamespace(recordings=recordings)


def _written(folder, *, already=0.0):
    """Extension of pads that lose a tenth from 4.25 s of the second of three logs on."""
    car = paper_car()
    before = nominal(car)
    before.theta[PADS] += already
    weak = nominal(car)
    weak.theta[PADS] += already - 0.1
    weak = weak.with_onset("pad_mu_gain", 1, 4.25, before)
    final = SimpleNamespace(z=np.zeros(0), terms=())
    fitter = SimpleNamespace(parameter_set=lambda z, terms: weak, nuisances=())
    diagnosis = SimpleNamespace(fitter=fitter, final=final, dataset=_dataset("a.csv", "b.csv", "c.csv"), vehicle=car)
    write_extended_car(diagnosis, folder)
    return folder / "extension.toml"


def test_an_onset_is_written_and_taken_up_in_the_log_it_is_of(tmp_path):
    path = _written(tmp_path)
    assert load_extension(path).onsets == {"pad_mu_gain": ("b.csv", 4.25)}
    text = path.read_text()
    assert "onset_s = 4.25" in text
    assert "4.25 s into b.csv" in text
    dataset = _dataset("a.csv", "b.csv", "c.csv")
    car, remarks = extended_car(paper_car(), path, dataset)
    assert remarks == []
    gains = [[theta[PADS][0] for _, theta in car.thetas_in(one)] for one in dataset.recordings]
    assert gains == [[0.0], [0.0, -0.1], [-0.1]]
    assert car.thetas_in(dataset.recordings[1])[1][0] == 425
    assert car.theta[BEGINS][0] < -1e11  # no time of every log


def test_in_other_logs_the_effect_is_there_throughout_and_a_remark_says_so(tmp_path):
    dataset = _dataset("later.csv")
    car, (remark,) = extended_car(paper_car(), _written(tmp_path), dataset)
    assert [theta[PADS][0] for _, theta in car.thetas_in(dataset.recordings[0])] == [-0.1]
    assert "b.csv" in remark


def test_an_effect_that_grows_at_its_onset_is_not_taken_away_before_it(tmp_path):
    path = _written(tmp_path, already=-0.05)
    assert load_extension(path).onsets == {}
    assert load_extension(path).theta[PADS] == pytest.approx([-0.15] * 4)
    assert "grows from 4.25 s" in path.read_text()


def test_nuisances_act_before_an_onset_of_the_same_effect_too(tmp_path):
    """Pads of single wheels are off whether or not an extension has pads that begin to lose."""
    dataset = _dataset("a.csv", "b.csv")
    car, _ = extended_car(paper_car(), _written(tmp_path), dataset)
    one_wheel = SimpleNamespace(at=(PADS.start,), step=(0.01,), kind="side_to_side")
    moved = car.with_nuisances([one_wheel], np.array([2.0]))
    before, after = (theta[PADS] for _, theta in moved.thetas_in(dataset.recordings[1]))
    assert before == pytest.approx([0.02, 0.0, 0.0, 0.0])
    assert after == pytest.approx([-0.08, -0.1, -0.1, -0.1])


def test_numbers_beyond_their_bounds_are_written_at_the_bound(tmp_path):
    """A common part and a change, each inside: pads that bite 25 % more than stated, and 35 % more than that since."""
    text = (path := _written(tmp_path, already=0.7875)).read_text()
    assert "pad_mu_gain.gain: estimated as 0.6875, beyond -0.6 to 0.6; here at the limit." in text
    assert load_extension(path).theta[PADS] == pytest.approx([0.6] * 4)
