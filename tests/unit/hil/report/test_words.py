import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.report.report import Number
from hil.report.units import KMH
from hil.report.words import clean, float_text, number_text, outline, value_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (38.7349, "38.73"),
        (-0.5, "-0.5000"),
        (999.96, "1000"),
        (123456.7, "123457"),
        (1.5e7, "1.500e+07"),
        (2e-5, "2.000e-05"),
        (math.nan, "–"),
        (-math.inf, "−∞"),
    ],
)
def test_floats_show_four_significant_digits(value: float, text: str) -> None:
    assert float_text(value) == text


@given(st.floats(-1e300, 1e300))
def test_what_is_shown_is_the_value_to_four_digits(value: float) -> None:
    assert float(float_text(value)) == pytest.approx(value, rel=5.1e-4)


def test_other_values() -> None:
    assert [value_text(v) for v in (None, True, np.bool_(False), 53800, np.int64(3), np.float32(0.5), "a\nb")] == [
        "–", "yes", "no", "53800", "3", "0.5000", "a\\nb",
    ]  # fmt: skip
    assert number_text(Number("v", 20, KMH)) == ("72.00", "km/h")
    assert number_text(Number("v", None, KMH)) == ("–", "")
    assert number_text(Number("v", "none", "m")) == ("none", "m")


@given(st.text())
def test_clean_text_is_one_harmless_line_that_can_be_written(text: str) -> None:
    result = clean(text)
    assert result.encode("utf-8").decode() == result
    assert not any(ord(c) < 32 or ord(c) == 127 for c in result)
    assert len(result.splitlines()) <= 1


def test_terminal_and_direction_controls_become_visible() -> None:
    assert clean("\x1b[31m\u202eabc\udc80") == "\\x1b[31m\\u202eabc\\udc80"
    assert clean("µ °C Δ 摩擦") == "µ °C Δ 摩擦"


def test_the_outline_is_depth_first_and_exact() -> None:
    tree = {"a": {"b": 0.1234567890123, "c": (1, 2.5)}, "d": None}
    assert list(outline(tree)) == [(0, "a", ""), (1, "b", "0.1234567890123"), (1, "c", "1, 2.5"), (0, "d", "–")]
