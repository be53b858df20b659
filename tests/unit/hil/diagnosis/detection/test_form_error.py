"""What a cause leaves: the form of its equation before it is another cause, where both act."""

import numpy as np
import pytest

from hil.diagnosis.detection.form_error import signature_overlap


def test_signatures_in_the_same_places_overlap_whole_and_apart_not_at_all():
    one = np.array([4.0, 0.0, 1.0, 0.0])
    assert signature_overlap(one, 3.0 * one) == pytest.approx(1.0)
    assert signature_overlap(one, np.array([0.0, 2.0, 0.0, 5.0])) == 0.0
    assert signature_overlap(one, np.array([4.0, 0.0, 0.0, 0.0])) == pytest.approx(0.8)


def test_a_signature_that_is_nowhere_overlaps_with_none():
    assert signature_overlap(np.zeros(3), np.ones(3)) == 0.0


def test_no_error_of_the_form_gives_a_signature_more_and_the_worst_gives_it_all():
    """An error is a share of the cause in each place, however it varies within."""
    rng = np.random.default_rng(4)
    cause, other = rng.normal(size=(2, 6, 50))
    energies = [np.sum(values**2, axis=1) for values in (cause, other)]
    share, bound = 0.3, 0.3**2 * energies[0].sum() * signature_overlap(*energies)

    def taken(errors):
        sized = errors * share * (energies[0] / np.sum(errors**2, axis=1))[:, None] ** 0.5
        return float(np.sum(sized * other)) ** 2 / energies[1].sum()

    assert max(taken(rng.normal(size=cause.shape)) for _ in range(200)) < bound
    assert taken(other) == pytest.approx(bound)
