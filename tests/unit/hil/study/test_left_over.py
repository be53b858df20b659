"""What a cause leaves: the form of its equation before it is another cause, where both act."""

import numpy as np
import pytest

from hil.study.left_over import overlap


def test_signatures_in_the_same_places_overlap_whole_and_apart_not_at_all():
    one = np.array([4.0, 0.0, 1.0, 0.0])
    assert overlap(one, 3.0 * one) == pytest.approx(1.0)
    assert overlap(one, np.array([0.0, 2.0, 0.0, 5.0])) == 0.0
    assert overlap(one, np.array([4.0, 0.0, 0.0, 0.0])) == pytest.approx(0.8)


def test_a_signature_that_is_nowhere_overlaps_with_none():
    assert overlap(np.zeros(3), np.ones(3)) == 0.0


def test_no_signature_can_take_more_than_the_form_leaves():
    """The bound holds for any error of the form: a share of the cause in each place, however it varies within."""
    rng = np.random.default_rng(4)
    cause, other = rng.normal(size=(2, 6, 50))
    share = 0.3
    errors = rng.normal(size=cause.shape)
    errors *= share * np.linalg.norm(cause, axis=1, keepdims=True) / np.linalg.norm(errors, axis=1, keepdims=True)
    errors[:3] = share * np.linalg.norm(cause[:3], axis=1, keepdims=True) * other[:3]
    errors[:3] /= np.linalg.norm(other[:3], axis=1, keepdims=True)
    taken = float(np.sum(errors * other)) ** 2 / float(np.sum(other**2))
    energies = [np.sum(values**2, axis=1) for values in (cause, other)]
    assert taken <= share**2 * energies[0].sum() * overlap(*energies)
