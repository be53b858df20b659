"""Units as the FMI wants them: exponents of SI base units."""

import re
from collections import Counter

BASE: dict[str, dict[str, int]] = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "K": {"K": 1}, "rad": {"rad": 1}, "1": {},
    "Hz": {"s": -1}, "N": {"kg": 1, "m": 1, "s": -2}, "Nm": {"kg": 1, "m": 2, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2}, "W": {"kg": 1, "m": 2, "s": -3}, "Pa": {"kg": 1, "m": -1, "s": -2},
}  # fmt: skip
_FACTOR = re.compile(r"\(([^)]*)\)(\d*)|([A-Za-z]+|1)(\d*)")


def exponents(unit: str) -> dict[str, int]:
    """Exponents of the base units of ``N m/rad``, ``1/(K s)`` and the like; what follows a slash is divided by.

    Raises
    ------
    ValueError : a symbol that is not in `BASE`.
    """
    total: Counter[str] = Counter()
    for place, part in enumerate(re.split(r"/(?![^(]*\))", unit)):
        for inner, inner_power, symbol, power in _FACTOR.findall(part):
            if not inner and symbol not in BASE:
                raise ValueError(f"unit {unit!r}: unknown symbol {symbol!r}; known: {', '.join(BASE)}")
            found = exponents(inner) if inner else BASE[symbol]
            times = int(power or inner_power or 1) * (-1 if place else 1)
            for base, exponent in found.items():
                total[base] += exponent * times
    return {base: exponent for base, exponent in total.items() if exponent}
