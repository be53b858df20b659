"""Functions that carry a linear part exactly over a step: phi_1(z) = (e^z - 1)/z, phi_2(z) = (phi_1(z) - 1)/z.

Of a decay, z = -rate times step, and of 2x2 matrices, which are a I + b M for a matrix M (Cayley and Hamilton).
"""

from plant.compiled import equation

SMALL = 1e-3
EXPONENT_LIMIT = 30.0  # exponents beyond are held here: of what decays no more than exp(-30) is left
_HALVINGS = 4


@equation
def phi_1(z: float, decayed: float) -> float:
    """phi_1(-z), the mean of exp(-z s) over s from 0 to 1; ``decayed`` is exp(-z)."""
    mean = (1.0 - decayed) / max(z, SMALL)
    return mean if z > SMALL else 1.0 - z * (0.5 - z / 6.0)


@equation
def phi_2(z: float, one: float) -> float:
    """phi_2(-z); ``one`` is phi_1(-z)."""
    mean = (1.0 - one) / max(z, SMALL)
    return mean if z > SMALL else 0.5 - z * (1.0 / 6.0 - z / 24.0)


@equation
def phi_of_pair(trace: float, det: float) -> tuple[float, float, float, float]:
    """phi_1 and phi_2 of a 2x2 matrix M of this trace and determinant: a, b of each, as a I + b M.

    Power series of phi_2 at M / 16, then doubled: phi_2(2z) = (phi_1(z)^2 + 2 phi_2(z))/4, phi_1(2z) = (e^z + 1)
    phi_1(z)/2 (Skaflestad and Wright 2009, Appl. Numer. Math. 59, 783). M^2 is tr M - det I. Relative error below 1e-10
    up to eigenvalues of 4, below 1e-7 up to 30.
    """
    scale = 0.5**_HALVINGS
    t, d = scale * trace, scale * scale * det
    a, b = 1.0 / 5040.0, 1.0 / 40320.0
    a, b = 1.0 / 720.0 - b * d, a + b * t
    a, b = 1.0 / 120.0 - b * d, a + b * t
    a, b = 1.0 / 24.0 - b * d, a + b * t
    a, b = 1.0 / 6.0 - b * d, a + b * t
    two, two_m = 0.5 - b * d, a + b * t
    one, one_m = 1.0 - two_m * d, two + two_m * t
    e, e_m = 1.0 - one_m * d, one + one_m * t
    for _ in range(_HALVINGS):
        square = one_m * one_m
        two = 0.25 * (one * one - square * d) + 0.5 * two
        two_m = 0.25 * (one * one_m + 0.5 * square * t + two_m)
        half, half_m = 0.5 * (e + 1.0), 0.5 * e_m
        both = half_m * one_m
        one, one_m = half * one - both * d, 0.5 * (half * one_m + half_m * one + both * t)
        square = e_m * e_m
        e, e_m = e * e - square * d, e * e_m + 0.5 * square * t
        t, d = 2.0 * t, 4.0 * d
    return one, one_m, two, two_m
