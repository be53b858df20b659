"""Engineering units for display: values stay SI until they are printed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Display:
    """An affine conversion from an SI value to what a reader expects: ``shown = value * factor + offset``.

    Attributes
    ----------
    symbol : unit symbol as printed.
    factor : shown units per SI unit.
    offset : in shown units.
    """

    symbol: str
    factor: float = 1.0
    offset: float = 0.0

    def convert(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``value`` (SI, any shape) in the shown unit."""
        return value * self.factor + self.offset


Unit = str | Display

KMH = Display("km/h", 3.6)  # from m/s
BAR = Display("bar", 1e-5)  # from Pa
DEG_C = Display("°C", 1.0, -273.15)  # from K
PERCENT = Display("%", 100.0)  # from 1
MS = Display("ms", 1e3)  # from s
KJ = Display("kJ", 1e-3)  # from J
KN = Display("kN", 1e-3)  # from N


_PRINTED = {"1": "", "m/s2": "m/s²", "m/s^2": "m/s²"}


def symbol(unit: Unit) -> str:
    """Return the unit's printed symbol."""
    return unit.symbol if isinstance(unit, Display) else _PRINTED.get(unit, unit)


def shown(values: NDArray[np.float64], unit: Unit) -> NDArray[np.float64]:
    """Return ``values`` as displayed: converted where ``unit`` is a `Display`, unchanged where it is text."""
    return unit.convert(values) if isinstance(unit, Display) else values
