"""A parallel map keeps the order, and frees its threads also after an error."""

import pytest

from hil.diagnosis.parallel import parallel_map


def _fails(item):
    if item == 3:
        raise ValueError(f"no {item}")
    return item


def test_comes_back_in_order():
    assert parallel_map(lambda item: item * item, range(50)) == [item * item for item in range(50)]


def test_threads_are_free_again_after_an_error():
    for _ in range(20):
        with pytest.raises(ValueError, match="no 3"):
            parallel_map(_fails, range(5))
    assert parallel_map(_fails, [1, 2]) == [1, 2]
