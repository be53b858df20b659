"""Names that a database gives the values of a signal."""

from typing import Any

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.decode import Values


def named_values(signal: Signal, dtype: np.dtype[Any]) -> dict[Any, str]:
    """Names by physical value, worked out as the decoder works out the values.

    Of two raw values with one physical value the first one counts.
    """
    named: dict[Any, str] = {}
    whole = dtype.kind in "iu"
    low, high = (0, 2**64) if dtype == np.uint64 else (-(2**63), 2**63)
    for raw, text in signal.choices.items():
        if whole:
            number = raw * int(signal.factor) + int(signal.offset)
            if low <= number < high:
                named.setdefault(number, text)
        else:
            named.setdefault(float(raw) * float(signal.factor) + float(signal.offset), text)
    return named


def value_names(values: Values, signal: Signal) -> tuple[npt.NDArray[np.int32], tuple[str, ...]]:
    """Index into the names for each value, -1 where it has none, and the names."""
    named = named_values(signal, values.dtype)
    texts = tuple(dict.fromkeys(named.values()))
    if not named:
        return np.full(len(values), -1, np.int32), texts
    number = {text: i for i, text in enumerate(texts)}
    known = np.array(sorted(named), values.dtype)
    codes = np.array([number[named[value]] for value in known.tolist()], np.int32)
    at = np.minimum(np.searchsorted(known, values), len(known) - 1)
    return np.where(known[at] == values, codes[at], np.int32(-1)).astype(np.int32), texts
