"""The rivals of `explain` on a problem whose answer is known: no replay in it."""

import numpy as np
import pytest

from hil.validation.perf.rivals import NONE, RIVALS, least_squares, nearest, sparse
from hil.validation.perf.signatures import Problem, triangle

SAMPLES = 1500
EFFECTS = ("drag", "grade", "gain", "gain", "gain", "gain", "bias", "lag")
PLACES = (
    ("drag", (0,)), ("grade", (1,)), ("gain", (2, 3, 4, 5)), ("gain", (2, 3)), ("gain", (4, 5)), ("gain", (2,)),
    ("bias", (6,)), ("lag", (7,)),
)  # fmt: skip


def _problem(seed: int, true: dict[int, float], twins: bool = False) -> Problem:
    """White noise and signatures that overlap somewhat; ``true`` are values by column."""
    rng = np.random.default_rng(seed)
    smooth = np.array([np.convolve(row, np.ones(40) / 40.0, "same") for row in rng.standard_normal((8, SAMPLES))]).T
    signatures = smooth * rng.uniform(0.5, 200.0, 8)
    if twins:
        signatures[:, 1] = -2.0 * signatures[:, 0]
    residual = rng.standard_normal(SAMPLES)
    for column, sigmas in true.items():
        residual += sigmas * signatures[:, column] / np.linalg.norm(signatures[:, column])
    return Problem(residual, signatures, EFFECTS, PLACES, SAMPLES)


@pytest.fixture(params=[sparse, nearest, least_squares])
def rival(request):
    if request.param is sparse:
        pytest.importorskip("pysindy", reason="pysindy is not installed")
    return request.param


@pytest.mark.parametrize(("column", "name"), [(0, "drag"), (6, "bias"), (7, "lag")])
def test_a_single_cause_is_named(rival, column, name):
    guess = rival(_problem(1, {column: 15.0}))
    assert guess.named == name
    assert guess.probability[name] > 0.95
    assert sum(guess.probability.values()) == pytest.approx(1.0)
    assert max(guess.shares, key=guess.shares.get) == name
    assert sum(guess.shares.values()) == pytest.approx(1.0)
    assert guess.shares[NONE] == 0.0


def test_shares_go_by_what_is_lost_without_a_cause():
    pytest.importorskip("pysindy", reason="pysindy is not installed")
    shares = sparse(_problem(5, {0: 40.0, 7: 20.0})).shares
    assert (shares["drag"], shares["lag"]) == pytest.approx((0.8, 0.2), abs=0.1)


def test_a_cause_at_two_wheels_is_one_name(rival):
    guess = rival(_problem(2, {2: 15.0, 3: 15.0}))
    assert guess.named == "gain"
    assert guess.probability["gain"] > 0.95


def test_white_noise_raises_no_alarm(rival):
    """BIC lets one in two hundred through here, the others three in a thousand; one of twenty would be much."""
    guesses = [rival(_problem(seed, {})) for seed in range(20)]
    assert sum(guess.named != NONE for guess in guesses) <= 1
    for guess in guesses:
        assert guess.named == NONE or guess.probability[NONE] > 0.1
        assert guess.shares[NONE] == (guess.named == NONE)
        assert set(guess.probability) == {NONE, *EFFECTS}
        assert sum(guess.probability.values()) == pytest.approx(1.0)


def test_two_signatures_that_are_one_share_the_chance():
    given = _problem(3, {0: 15.0}, twins=True)
    for rival in (nearest, least_squares):
        chances = rival(given).probability
        assert chances["drag"] == pytest.approx(chances["grade"], rel=0.1)
        assert chances["drag"] + chances["grade"] > 0.95


def test_the_triangle_stands_for_all_samples(rival):
    """The same answer, from as many rows as there are columns."""
    whole = _problem(4, {0: 6.0, 7: 4.0})
    parts = {"a": slice(0, 500), "b": slice(500, SAMPLES)}
    rows = triangle(
        {name: whole.residual[part, None] / 2.0 for name, part in parts.items()},
        {name: whole.signatures[part] / 2.0 for name, part in parts.items()},
        {name: np.full(part.stop - part.start, 2.0) for name, part in parts.items()},
    )
    assert rows.shape == (9, 9)
    expected, found = rival(whole), rival(Problem(rows[:, 0], rows[:, 1:], EFFECTS, PLACES, SAMPLES))
    assert found.named == expected.named
    assert found.probability == pytest.approx(expected.probability, abs=1e-6)


def test_what_is_masked_takes_no_part():
    rng = np.random.default_rng(0)
    residual, signatures = {"a": rng.standard_normal((50, 1))}, {"a": rng.standard_normal((50, 3))}
    known = (np.arange(50) < 30) * 1.0
    rows = triangle(residual, signatures, {"a": known})
    there = np.column_stack((residual["a"], signatures["a"]))[:30]
    assert rows.T @ rows == pytest.approx(there.T @ there)


def test_every_rival_is_in_the_list():
    assert set(RIVALS.values()) == {sparse, nearest, least_squares}
