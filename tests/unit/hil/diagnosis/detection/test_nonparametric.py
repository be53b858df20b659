"""Nonparametric terms: hat functions that add up to any curve, written and read again, driven in a scenario."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.diagnosis.detection.nonparametric import (
    BASIS_SIZE,
    NONPARAMETRIC_TERMS,
    BasisExpansion,
    at_each_location,
    basis_expansion,
    estimate_curve,
)
from hil.diagnosis.result.extended_scenario import extended_scenario
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.load import paper_car
from hil.scenario.effects import EffectError, read_laws, written_laws
from hil.scenario.scenario import load_scenario
from plant.injection.bank import term

LAW_TOML = """
[[laws]]
injection_point = "friction.mu"
variable = "speed"
adds = false
centre = 15.0
width = 5.0
value = -0.3
at = ["rl"]
"""


def _expansion(k: int = 0) -> BasisExpansion:
    return basis_expansion(NONPARAMETRIC_TERMS[k], 2.0, 34.0)


def test_hats_of_equal_size_are_a_constant():
    points = estimate_curve(_expansion().functions, [0.2] * BASIS_SIZE, np.zeros((BASIS_SIZE, BASIS_SIZE)))
    assert [point["y"] for point in points] == pytest.approx([0.2] * len(points))


@given(
    values=st.lists(st.floats(-0.5, 0.5), min_size=BASIS_SIZE, max_size=BASIS_SIZE),
    index=st.integers(0, len(NONPARAMETRIC_TERMS) - 1),
)
def test_what_is_written_is_read_again(values, index):
    for placed in at_each_location(_expansion(index)):
        rows = np.array([function.row(value or 0.1) for function, value in zip(placed.functions, values, strict=True)])
        assert np.array_equal(read_laws(written_laws(rows), "laws"), rows)


def test_a_basis_function_is_added_to_what_a_parameter_set_has():
    function = _expansion().functions[2]
    twice = function.applied(function.applied(nominal(paper_car()), 0.1), 0.2)
    assert twice.nonparametric_rows.shape == (2, len(term("friction.mu", 0.1, (1, 3, 0.0, 1.0))))


def test_a_nonparametric_term_is_driven_in_a_scenario(tmp_path):
    path = tmp_path / "extension.toml"
    path.write_text(LAW_TOML)
    extended = load_scenario(str(extended_scenario("stop72", path, tmp_path)))
    assert extended.effects.terms.shape[0] == 1
    assert extended.effects.terms[0][3:7].tolist() == [0.0, 0.0, -0.3, 0.0]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [('"friction.mu"', '"friction.nu"', "friction.nu"), ('"speed"', '"spede"', "SPEDE"), ("width = 5.0", "", "width")],
)
def test_rows_that_cannot_be_used_say_why(old, new, says):
    with pytest.raises(EffectError, match=says):
        read_laws(tomllib.loads(LAW_TOML.replace(old, new))["laws"], "laws")
