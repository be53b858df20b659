"""Onset of a cause, from its products by segment."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.dataset import Segment
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.onset import detect_change_point, estimate_onsets, nearest, times_between
from hil.diagnosis.detection.score_test import onset_penalty, segment_starts
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


def _products(value: float, onset: int, strength: list[float], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments that show a cause with ``strength`` standard deviations each, there from the segment ``onset`` on."""
    q = np.square(strength) / value**2
    there = np.arange(len(q)) >= onset
    noise = np.random.default_rng(seed).standard_normal(len(q))
    return q * value * there + np.sqrt(q) * noise, q


@given(onset=st.integers(2, 8), seed=st.integers(0, 200), value=st.sampled_from([-3.0, 0.02, 40.0]))
def test_a_clear_onset_is_detected(onset, seed, value):
    b, q = _products(value, onset, [8.0] * 10, seed)
    assert detect_change_point(b, q) == onset


def test_what_was_always_there_has_none():
    detected = [detect_change_point(*_products(1.0, 0, [5.0] * 10, seed)) for seed in range(300)]
    assert sum(one is not None for one in detected) <= 5


def test_segments_that_do_not_show_it_prove_no_onset():
    assert detect_change_point(*_products(1.0, 0, [0.1, 0.1, 0.1, 9.0, 9.0], 1)) is None
    assert detect_change_point(*_products(1.0, 3, [0.1, 0.1, 0.1, 9.0, 9.0], 1)) is None


def test_an_onset_has_the_penalty_of_its_choice_among_many():
    samples = np.zeros(9000)
    masks = SampleMasks(samples, samples, samples, samples, samples, 0.02, {}, ())
    assert onset_penalty(masks) == pytest.approx(2.0 * np.log(720.0))


def test_an_onset_is_searched_in_both_segments_it_may_lie_in():
    """That before the first one that shows it, and that one: it may show the last second of it alone."""
    before, after, elsewhere = Segment(0, 800, 0.0, 9.0), Segment(800, 1500, 0.0, 9.0), Segment(0, 600, 0.0, 9.0)
    same = times_between((2, before), (2, after))
    assert {drive for drive, _ in same} == {2}
    assert (same[0][1], same[-1][1]) == (0.0, 15.0)
    two = times_between((0, before), (1, elsewhere))
    assert [max(t for drive, t in two if drive == k) for k in (0, 1)] == [8.0, 6.0]
    assert [min(t for drive, t in two if drive == k) for k in (0, 1)] == [0.0, 0.0]


def test_the_segment_nearest_to_an_onset_is_of_its_own_recording():
    starts = [(0, 0.0), (0, 30.0), (1, 10.0)]
    onsets = [(0, 1.0), (0, 14.0), (0, 16.0), (0, 99.0), (1, 0.0)]
    assert [nearest(starts, onset) for onset in onsets] == [0, 0, 1, 1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("always", [True, False])
def test_a_scanned_onset_of_what_was_always_there_goes(always):
    """The scan may give a cause an onset where nuisance parameters still absorb it before."""
    vehicle = load_vehicle(VEHICLE)
    log = log_as_driven(vehicle, 0.318)
    dataset = prepare([log, log], 0.318)
    simulator, base = Simulator(dataset, vehicle), nominal(vehicle)
    (pads,) = [one for one in candidates(columns()) if one.name == "pad_mu_gain@car"]
    second = next(start for start in segment_starts(dataset) if start[0] == 1)

    def fitter() -> Fitter:
        nuisance_fit = NuisanceFit(simulator, SampleMasks.of(dataset), vehicle, base, relinearise=True)
        return nuisance_fit.fitter

    there = Term(pads, -0.2, onset=None if always else second)
    nominal_z = fitter().start()[0].z
    simulated = simulator.run(fitter().parameter_set(nominal_z, (there,)))
    rng, first = np.random.default_rng(5), 0
    for drive in dataset.recordings:
        for group, values in simulated.items():
            own = values[first : first + drive.samples]
            drive.measured[group][:] = own + DEVIATIONS.get(group, 0.02) * rng.standard_normal(own.shape)
        first += drive.samples
    fresh = fitter()
    noise = fresh.alternate_noise_and_fit(fresh.at(nominal_z, (there,), fresh.start()[1]), fresh.start()[1], 2)[1]
    taken = fresh.at(nominal_z, (Term(pads, -0.2, onset=second),), noise)
    (term,) = estimate_onsets(fresh, taken, noise)[0].terms
    assert (term.onset is None) is always
    assert term.value == pytest.approx(-0.2, abs=0.02)
