"""When a cause begins, from what each manoeuvre says of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.dataset import Segment
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.onset import (
    detect_change_point,
    estimate_onsets,
    moments_of,
    nearest,
    onset_penalty,
    segment_starts,
)
from hil.diagnosis.estimation.gauss_newton import Fitter, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


def _products(value: float, begin: int, strength: list[float], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Manoeuvres that see a cause with ``strength`` standard deviations each, there from ``begin`` on."""
    q = np.square(strength) / value**2
    there = np.arange(len(q)) >= begin
    noise = np.random.default_rng(seed).standard_normal(len(q))
    return q * value * there + np.sqrt(q) * noise, q


@given(begin=st.integers(2, 8), seed=st.integers(0, 200), value=st.sampled_from([-3.0, 0.02, 40.0]))
def test_a_clear_beginning_is_found(begin, seed, value):
    b, q = _products(value, begin, [8.0] * 10, seed)
    assert detect_change_point(b, q) == begin


def test_what_was_always_there_has_none():
    found = [detect_change_point(*_products(1.0, 0, [5.0] * 10, seed)) for seed in range(300)]
    assert sum(one is not None for one in found) <= 5


def test_manoeuvres_that_do_not_show_it_prove_no_beginning():
    assert detect_change_point(*_products(1.0, 0, [0.1, 0.1, 0.1, 9.0, 9.0], 1)) is None
    assert detect_change_point(*_products(1.0, 3, [0.1, 0.1, 0.1, 9.0, 9.0], 1)) is None


def test_a_time_costs_what_its_choice_among_many_is_worth():
    samples = np.zeros(9000)
    frame = SampleMasks(samples, samples, samples, samples, samples, 0.02, {}, ())
    assert onset_penalty(frame) == pytest.approx(2.0 * np.log(720.0))


def test_a_beginning_is_looked_for_in_both_manoeuvres_it_may_lie_in():
    """That before the first one that shows it, and that one: it may show the last second of it alone."""
    before, after, elsewhere = Segment(0, 800, 0.0, 9.0), Segment(800, 1500, 0.0, 9.0), Segment(0, 600, 0.0, 9.0)
    same = moments_of((2, before), (2, after))
    assert {drive for drive, _ in same} == {2}
    assert (same[0][1], same[-1][1]) == (0.0, 15.0)
    apart = moments_of((0, before), (1, elsewhere))
    assert [max(t for drive, t in apart if drive == k) for k in (0, 1)] == [8.0, 6.0]
    assert [min(t for drive, t in apart if drive == k) for k in (0, 1)] == [0.0, 0.0]


def test_the_manoeuvre_nearest_to_a_moment_is_of_its_own_drive():
    starts = [(0, 0.0), (0, 30.0), (1, 10.0)]
    moments = [(0, 1.0), (0, 14.0), (0, 16.0), (0, 99.0), (1, 0.0)]
    assert [nearest(starts, moment) for moment in moments] == [0, 0, 1, 1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("always", [True, False])
def test_what_was_taken_to_begin_and_was_always_there_has_no_beginning(always):
    """The screen may give a cause a beginning where numbers of the car still stand in for it."""
    vehicle = load_vehicle(VEHICLE)
    log = log_as_driven(vehicle, 0.318)
    case = prepare([log, log], 0.318)
    rig, base = Simulator(case, vehicle), nominal(vehicle)
    (pads,) = [one for one in candidates(columns()) if one.name == "pad_mu_gain@car"]
    second = next(moment for moment in segment_starts(case) if moment[0] == 1)

    def fitter() -> Fitter:
        return NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True).fitter

    there = Term(pads, -0.2, onset=None if always else second)
    as_handed_in = fitter().start()[0].z
    told = rig.run(fitter().parameter_set(as_handed_in, (there,)))
    rng, first = np.random.default_rng(5), 0
    for drive in case.recordings:
        for group, values in told.items():
            own = values[first : first + drive.samples]
            drive.measured[group][:] = own + DEVIATIONS.get(group, 0.02) * rng.standard_normal(own.shape)
        first += drive.samples
    fresh = fitter()
    noise = fresh.alternate_noise_and_fit(fresh.at(as_handed_in, (there,), fresh.start()[1]), fresh.start()[1], 2)[1]
    taken = fresh.at(as_handed_in, (Term(pads, -0.2, onset=second),), noise)
    (term,) = estimate_onsets(fresh, taken, noise).terms
    assert (term.onset is None) is always
    assert term.value == pytest.approx(-0.2, abs=0.02)
