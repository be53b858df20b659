"""Whether manoeuvres agree about a cause: one value in all, or another in each; one kind of manoeuvre, or more."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_as_driven, log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.agreement import MODEL_FORM, agrees, shown_elsewhere
from hil.diagnosis.detection.profile_fit import refitted, unscored
from hil.diagnosis.estimation.consistency import Consistency, consistencies
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from plant.injection.theta import THETA

LOGS = 6
CANDIDATE = {one.name: one for one in candidates(columns())}["pad_mu_gain@car"]


@pytest.fixture(scope="module")
def fitted():
    """A function: the pads of each log gain so much; the hypothesis of a gain of all, and its fitter."""
    vehicle = paper_car()
    log = log_as_driven(vehicle, 0.308)
    base = nominal(vehicle)

    def fit(gains):
        rig = Simulator(prepare([log] * LOGS, 0.308), vehicle)
        rng, at = np.random.default_rng(1), 0
        told = [rig.run(_with_pads(base, gain)) for gain in gains]
        for gain_of, drive in zip(told, rig.dataset.recordings, strict=True):
            for group, values in gain_of.items():
                part = values[at : at + drive.samples]
                size = {"wheel": 0.02, "pressure": 2e3, "motor": 0.5}.get(group, 0.02)
                drive.measured[group][:] = part + size * rng.standard_normal(part.shape)
            at += drive.samples
        masks = SampleMasks.of(rig.dataset)
        without = {name: np.zeros((len(masks.log_start), 0), np.float32) for name in masks.names}
        fitter = Fitter(rig, masks, base, (), without)
        model, noise = fitter.start()
        term = Term(CANDIDATE, float(np.mean(gains)))
        model = fitter.fit(fitter.at(model.z, (term,), noise), noise, 5)
        model, noise = fitter.alternate_noise_and_fit(model, noise, 2)
        return fitter, refitted(unscored(model, noise, 1.0), model, noise)

    return fit


def _with_pads(base, gain):
    theta = base.theta.copy()
    theta[THETA.slice("pad_mu_gain", "gain")] = gain
    return replace(base, theta=theta)


def test_a_value_that_all_manoeuvres_share_is_consistent(fitted):
    fitter, hypothesis = fitted([-0.2] * LOGS)
    (one,) = consistencies(fitter, hypothesis.model, hypothesis.noise)
    assert hypothesis.term.value == pytest.approx(-0.2, abs=0.02)
    assert one.effective_segments > 4.0
    assert one.variance_inflation < 2.0
    assert agrees(fitter, replace(hypothesis, gain=40.0), 20.0)


def test_a_value_of_another_sign_in_every_second_manoeuvre_is_not(fitted):
    fitter, hypothesis = fitted([-0.35, 0.15] * (LOGS // 2))
    (one,) = consistencies(fitter, hypothesis.model, hypothesis.noise)
    assert one.variance_inflation > 3.0
    assert not agrees(fitter, replace(hypothesis, gain=40.0), 20.0)


def test_few_segments_say_little_of_a_variance():
    alone = Consistency(np.array([6.0]), np.array([9.0]))
    many = Consistency(np.full(20, 6.0), np.full(20, 9.0))
    assert alone.ratio == many.ratio == 4.0
    assert 1.0 < alone.variance_inflation < 2.0 < many.variance_inflation < 4.0


def test_a_direction_of_the_form_keeps_its_sign_without_the_best_kind_of_manoeuvre():
    """One log of brakes alone, one of motors alone that says the same, nothing, or the opposite."""
    log = log_of_pulses()
    halves = [
        replace(log, channels={name: 0.0 * v if quantity in name else v for name, v in log.channels.items()})
        for quantity in ("motor_torque", "pressure")
    ]
    dataset = prepare(halves, 0.308)
    brakes = np.array([number == 0 for number, _ in dataset.segments])
    information = np.where(brakes, 100.0, 10.0)
    for tells, expected in ((0.0, True), (-10.0, False), (-20.0, False)):  # of the value 1: 1, 0 and -1
        score = np.where(brakes, 0.0, tells)
        assert shown_elsewhere(Consistency(score, information), 1.0, dataset) == expected
    assert not shown_elsewhere(Consistency(0.0 * information, np.where(brakes, 100.0, 0.0)), 1.0, dataset)
    assert "motor_tau" in MODEL_FORM
