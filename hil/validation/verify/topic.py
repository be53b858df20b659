"""What one verification gives: numbers with limits, and a section of figures."""

from dataclasses import dataclass

from hil.report.report import Number, Section


@dataclass(frozen=True)
class Topic:
    """One verification of the plant.

    Attributes
    ----------
    title : one line.
    against : what it is held against.
    numbers : each with its limit and whether it was met.
    section : figures and tables.
    """

    title: str
    against: str
    numbers: tuple[Number, ...]
    section: Section


def below(label: str, value: float, limit: float, unit: str, note: str = "") -> Number:
    """A number whose magnitude must stay below a limit."""
    return Number(label, value, unit, note, f"|·| ≤ {limit:g}", abs(value) <= limit)


def within(label: str, value: float, low: float, high: float, unit: str, note: str = "") -> Number:
    """A number that must lie in a range."""
    return Number(label, value, unit, note, f"{low:g} to {high:g}", low <= value <= high)
