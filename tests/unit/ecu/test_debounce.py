"""The up-down counter behind every plausibility check."""

import math

import pytest

from ecu.law.debounce import up_down

LIMIT_S, FORGET, HEAL_S = 0.03, 0.02, 3.0


def count(samples, level=0.0):
    """Levels after each sample, 10 ms apart."""
    levels = []
    for odd in samples:
        level = up_down(level, 0.01 if odd else 0.0, 0.01, LIMIT_S, FORGET, HEAL_S)
        levels.append(level)
    return levels


def first_fault(samples):
    return next((n + 1 for n, level in enumerate(count(samples)) if level > LIMIT_S), None)


def test_counts_to_its_limit_and_no_sample_less():
    assert first_fault([1, 1, 1]) == 3
    assert first_fault([1, 1, 0, 0, 0]) is None


def test_an_intermittent_fault_adds_up_and_a_rare_one_never():
    assert first_fault([1, 0, 0, 0, 0] * 10) == 16  # 10 ms each but what 40 ms forget
    assert first_fault(([1] + [0] * 50) * 40) is None


def test_heals_after_the_time_without_evidence_and_remembers_half():
    level = count([1, 1, 1])[-1]
    assert count([0] * 299, level)[-1] > LIMIT_S
    assert count([0] * 301, level)[-1] == pytest.approx(0.5 * LIMIT_S, abs=1e-3)
    assert count([0] * 200 + [1] + [0] * 299, level)[-1] > LIMIT_S
    assert first_fault([1, 1, 1] + [0] * 301) == 3
    assert count([0] * 301 + [1, 1], level)[-1] > LIMIT_S


@pytest.mark.parametrize(
    ("level", "evidence", "after"),
    [
        (0.0, 0.5, 0.5),
        (0.5, 0.25, 0.75),  # evidence adds up
        (0.0, 1.998, 1.998),  # a thousandth below the limit may be rounding
        (0.0, math.nextafter(1.998, 2.0), 5.0),
        (1.5, 0.5, 5.0),  # a fault, and three seconds until it heals
        (5.0, 0.125, 5.0),
        (2.25, 0.125, 5.0),  # any evidence begins the time anew
        (5.0, 0.0, 4.875),
        (2.25, 0.0, 2.125),
        (2.125, 0.0, 1.0),  # healed: half is kept
        (2.0, 0.0, 1.96875),  # the limit itself is none
        (0.5, 0.0, 0.46875),  # a quarter of the time is taken off
        (0.01, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ],
)
def test_one_sample(level, evidence, after):
    """Of 1/8 s; two seconds are a fault."""
    assert up_down(level, evidence, 0.125, 2.0, 0.25, 3.0) == after
