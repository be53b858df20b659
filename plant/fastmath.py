"""atan, sin, cos and exp without branches, so that the compiler can work on four wheels in one instruction.

Polynomials interpolated at Chebyshev nodes; the tests hold them against the library. Uncompiled runs use the library.
"""

import math
from collections.abc import Callable

from numba import config

from plant.compiled import equation

_TAN_3_8 = 2.414213562373095  # tan(3 pi / 8)
_TAN_1_8 = 0.4142135623730951  # tan(pi / 8)
_PI_HIGH, _PI_LOW = 3.141592653589793, 1.2246467991473532e-16


def _atan(x: float) -> float:
    """Arc tangent, rad; absolute error below 1e-15."""
    t = abs(x)
    large, middle = t > _TAN_3_8, t > _TAN_1_8
    over = -1.0 if large else (t - 1.0 if middle else t)
    under = t if large else (t + 1.0 if middle else 1.0)
    base = 0.5 * math.pi if large else (0.25 * math.pi if middle else 0.0)
    z = over / under
    s = z * z
    s2 = s * s
    s4 = s2 * s2
    low = (0.999999999999999 - 0.3333333333322134 * s) + s2 * (0.19999999978376642 - 0.1428571266064491 * s)
    high = (0.11111048820145657 - 0.09089529349777939 * s) + s2 * (0.0767352902219825 - 0.06505943710914511 * s)
    angle = base + z * (low + s4 * (high + s4 * (0.05024632852842795 - 0.02531471159114413 * s)))
    return angle if x >= 0.0 else -angle


def _sin(x: float) -> float:
    """Sine of an angle up to some turns, rad; absolute error below 1e-15."""
    half_turns = math.floor(x / math.pi + 0.5)
    r = (x - half_turns * _PI_HIGH) - half_turns * _PI_LOW
    s = r * r
    s2 = s * s
    s4 = s2 * s2
    low = (1.0 - 0.16666666666666072 * s) + s2 * (0.008333333333282724 - 0.00019841269824853765 * s)
    high = (2.7557316608043817e-6 - 2.5051881880176867e-8 * s) + s2 * (
        1.604816619883057e-10 - 7.374361118628136e-13 * s
    )
    half = 0.5 * half_turns
    odd = half - math.floor(half)  # 0 or 1/2
    return r * (low + s4 * high) * (1.0 - 4.0 * odd)


def _cos(x: float) -> float:
    """Cosine of an angle up to some turns, rad; absolute error below 1e-15."""
    return sin(x + 0.5 * math.pi)


def _exp(x: float) -> float:
    """Exponential; relative error below 1e-14 for |x| up to 1, below 2e-9 for |x| up to 5."""
    s = 0.0625 * x
    part = 1.0 + s * (1.0 / 5.0 + s * (1.0 / 30.0 + s * (1.0 / 210.0 + s * (1.0 / 1680.0))))
    power = 1.0 + s * (1.0 + s * (0.5 + s * (1.0 / 6.0 + s * part * (1.0 / 24.0))))
    power *= power
    power *= power
    power *= power
    return power * power


_COMPILED = not getattr(config, "DISABLE_JIT", False)
atan: Callable[[float], float] = equation(_atan) if _COMPILED else math.atan
sin: Callable[[float], float] = equation(_sin) if _COMPILED else math.sin
cos: Callable[[float], float] = equation(_cos) if _COMPILED else math.cos
exp: Callable[[float], float] = equation(_exp) if _COMPILED else math.exp
