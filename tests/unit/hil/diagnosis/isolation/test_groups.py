"""What cannot be told apart, from the joint information."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.diagnosis.detection.threshold import ISOLABILITY_SIGMA
from hil.diagnosis.estimation.terms import candidates, columns, summed
from hil.diagnosis.isolation.groups import imitation, isolability_group, remaining

COLUMNS = columns()
CANDIDATES = candidates(COLUMNS)
INDEX = {c.name: k for k, c in enumerate(CANDIDATES)}
SAMPLES = 600
MASS, FRONT, REAR, DRAG = "mass_offset@car", "pad_mu_gain@front", "pad_mu_gain@rear", "headwind.drag_gain@car"


def information(signatures):
    """Products of all columns where candidates leave these signatures at their typical sizes, the others noise."""
    rng = np.random.default_rng(5)
    leaves = rng.standard_normal((SAMPLES, len(COLUMNS))) * 1e-6
    for k, column in enumerate(COLUMNS):
        leaves[:, k] /= abs(column.parameter.typical) or 1.0
    for name, signature in signatures.items():
        candidate = CANDIDATES[INDEX[name]]
        for k in candidate.columns:
            leaves[:, k] = signature / len(candidate.columns) / candidate.parameter.typical
    return leaves.T @ leaves


def straight_stops():
    """Signatures in deceleration: mass, loaded at the rear, takes off what pads of both axles and drag make."""
    t, noise = np.linspace(0.0, 1.0, SAMPLES), 0.05
    deceleration = 3.0 * np.minimum(t / 0.05, 1.0)
    front = deceleration * (0.65 + 0.1 * np.sin(9.0 * t))  # load and heat move the share of the axles
    rear = deceleration - front
    drag = 0.02 + 0.3 * (1.0 - t) ** 2
    return {
        MASS: -0.09 * (0.7 * front + 1.5 * rear + drag) / noise,
        FRONT: -0.12 * front / noise,
        REAR: -0.12 * rear / noise,
        DRAG: 0.15 * drag / noise,
    }


def test_mass_pads_and_drag_are_tied_together_though_no_pair_is():
    q = information(straight_stops())
    found = isolability_group(q, CANDIDATES, INDEX[MASS], 200.0)
    assert found.pairs == ()
    assert found.alone > 50.0
    assert found.separation < ISOLABILITY_SIGMA
    assert sorted({CANDIDATES[k].effect.name for k in found.members}) == ["headwind", "pad_mu_gain"]
    assert len(found.members) == 3  # front and rear pads, or one axle and both
    pads = [v for k, v in zip(found.members, found.values, strict=True) if k != INDEX[DRAG]]
    assert sum(pads) < 0.0  # a heavier car brakes as one with weaker pads does


def test_the_null_vector_leaves_no_signature():
    q = information(straight_stops())
    found = isolability_group(q, CANDIDATES, INDEX[MASS], 200.0)
    products = summed(q, CANDIDATES)
    at = [INDEX[MASS], *found.members]
    null = np.array([200.0, *(-value for value in found.values)])
    assert float(null @ products[np.ix_(at, at)] @ null) <= found.separation**2
    assert 200.0**2 * products[at[0], at[0]] == pytest.approx(found.alone**2)


def test_a_known_force_unties_them():
    """A pulse of the motors: mass shows, pads and drag do not."""
    signatures = straight_stops()
    pulse = 2.0 * (np.arange(SAMPLES) % 100 < 30)
    tied = information(signatures)
    alone = information({MASS: -0.09 * pulse / 0.05})
    found = isolability_group(tied + alone, CANDIDATES, INDEX[MASS], 200.0)
    assert found.members == ()
    assert found.separation > ISOLABILITY_SIGMA


def test_one_rival_is_enough_where_it_imitates_alone():
    signature = np.sin(np.linspace(0.0, 20.0, SAMPLES))
    q = information({"road_grade@car": signature, "imu_bias.ax_mps2@car": 0.98 * signature})
    found = isolability_group(q, CANDIDATES, INDEX["road_grade@car"], 0.02)
    assert found.members == (INDEX["imu_bias.ax_mps2@car"],)
    assert found.pairs[0][0] == found.members[0]
    assert found.pairs[0][1] == pytest.approx(found.separation)


def test_separable_causes_are_not_tied():
    t = np.linspace(0.0, 1.0, SAMPLES)
    q = information({"road_grade@car": 2.0 + 0.0 * t, MASS: 2.0 * np.sin(60.0 * t), "tyre_radius@car": 2.0 * t})
    for name, value in (("road_grade@car", 0.02), (MASS, 150.0), ("tyre_radius@car", -0.01)):
        found = isolability_group(q, CANDIDATES, INDEX[name], value)
        assert found.indices == ()
        assert found.separation > 3.0


def test_a_rival_beyond_its_bounds_imitates_nothing():
    signature = np.ones(SAMPLES)
    q = information({"road_grade@car": signature, "pad_mu_gain@car": 0.02 * signature})  # would need 50 times its size
    found = isolability_group(q, CANDIDATES, INDEX["road_grade@car"], 0.02)
    assert found.indices == ()
    assert found.separation > 10.0


def test_what_stands_out_by_less_than_the_noise_is_tied_with_nothing_in_particular():
    q = information({"road_grade@car": np.full(SAMPLES, 1e-3)})
    found = isolability_group(q, CANDIDATES, INDEX["road_grade@car"], 0.02)
    assert found.indices == ()
    assert found.separation == found.alone < ISOLABILITY_SIGMA


def test_the_same_effect_elsewhere_is_no_rival():
    signature = np.sin(np.linspace(0.0, 20.0, SAMPLES))
    q = information({FRONT: signature, REAR: signature})
    assert isolability_group(q, CANDIDATES, INDEX[FRONT], -0.12).indices == ()


def test_columns_of_accepted_causes_may_come_first():
    q = information(straight_stops())
    wider = np.zeros((len(q) + 2, len(q) + 2))
    wider[2:, 2:] = q
    plain, later = (isolability_group(m, CANDIDATES, INDEX[MASS], 200.0, k) for m, k in ((q, 0), (wider, 2)))
    assert plain.members == later.members
    assert plain.separation == pytest.approx(later.separation)


@given(st.integers(0, 10_000), st.integers(3, 12), st.floats(0.5, 30.0))
@settings(max_examples=60)
def test_what_is_left_is_least_squares_with_priors(seed, count, value):
    """Against the plain solution by least squares; more rivals never leave more; a pair leaves what it leaves alone."""
    rng = np.random.default_rng(seed)
    leaves = rng.standard_normal((80, count)) @ rng.standard_normal((count, count))
    products, precision = leaves.T @ leaves, rng.uniform(0.1, 2.0, count) ** -2.0
    wide = np.tile((-1e9, 1e9), (count, 1))
    rivals = list(range(1, count))
    stacked = np.vstack((leaves[:, rivals], np.diag(np.sqrt(precision[rivals]))))
    target = np.concatenate((value * leaves[:, 0], np.zeros(count - 1)))
    best = np.linalg.lstsq(stacked, target, rcond=None)[0]
    left = float(np.linalg.norm(target - stacked @ best))
    assert remaining(products, precision, 0, value, rivals) == pytest.approx(left, rel=1e-5, abs=1e-4)
    fewer = [remaining(products, precision, 0, value, rivals[:k]) for k in range(count)]
    assert all(after <= before + 1e-6 for before, after in pairwise(fewer))
    found = imitation(products, precision, wide, 0, value)
    assert found.separation >= left - 1e-4
    for k, apart in found.pairs:
        assert apart == pytest.approx(remaining(products, precision, 0, value, [k]), abs=1e-4)
    assert bool(found.members) == (found.separation < ISOLABILITY_SIGMA <= found.alone)


def test_the_prior_is_one_and_a_half_of_what_is_usual():
    assert CANDIDATES[INDEX[MASS]].prior_sd == 225.0
