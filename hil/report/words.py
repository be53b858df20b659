"""How the printers write names and values: nothing a log can hold may act on the reader's terminal or page."""

import math
import unicodedata
from collections.abc import Iterator, Mapping

import numpy as np

from hil.report.report import Cell, Number
from hil.report.units import Display, symbol

_DIRECTION = frozenset("\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")  # reorder what is shown


def clean(text: str) -> str:
    """Return ``text`` on one line, with control, direction and undecodable characters as visible escapes."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if _harmless(c) else c.encode("unicode_escape").decode("ascii") for c in text)


def _harmless(char: str) -> bool:
    return unicodedata.category(char) not in {"Cc", "Cs", "Zl", "Zp", "Cn"} and char not in _DIRECTION


def value_text(value: object) -> str:
    """Return a table cell's text: four significant digits, plain notation where that is readable, dash for none."""
    if isinstance(value, str):
        return clean(value)
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return float_text(float(value))
    return "–" if value is None else clean(str(value))


def float_text(value: float) -> str:
    """Return ``value`` to four significant digits; a dash when it is not a number."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.4g}")
    if not 1e-4 <= abs(rounded) < 1e6:
        return f"{value:.3e}"
    decimals = max(0, 3 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{decimals}f}"


def number_text(number: Number) -> tuple[str, str]:
    """Return the value as shown and its unit symbol."""
    value: Cell = number.value
    if isinstance(number.unit, Display) and isinstance(value, (int, float)) and not isinstance(value, bool):
        value = float(number.unit.convert(np.array([value], dtype=np.float64))[0])
    text = value_text(value)
    return text, "" if text == "–" else clean(symbol(number.unit))


def outline(tree: Mapping[str, object]) -> Iterator[tuple[int, str, str]]:
    """Yield (depth, key, value) of a nested mapping, depth first; a branch has an empty value."""
    yield from _outline(tree, 0)


def _outline(tree: Mapping[str, object], depth: int) -> Iterator[tuple[int, str, str]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield depth, clean(str(key)), ""
            yield from _outline(value, depth + 1)
        elif isinstance(value, (list, tuple)):
            yield depth, clean(str(key)), ", ".join(exact_text(item) for item in value)
        else:
            yield depth, clean(str(key)), exact_text(value)


def exact_text(value: object) -> str:
    """Return a provenance value unrounded."""
    return repr(value) if isinstance(value, float) else value_text(value)
