"""Tyre forces: PAC2002 Magic Formula without camber, relaxed slip.

Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 4.3.2, in the form of MSC Adams/Tire PAC2002.
Symbols as there. Vehicle axes: a positive longitudinal slip drives, a positive side slip (motion to the left) gives a
negative side force. ``side`` is 1 on the left and -1 on the right, where the tyre is mounted mirrored.
cos(atan(q)) is written 1/sqrt(1 + q^2). No branches: four wheels go through at once.
"""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from plant.compiled import equation
from plant.fastmath import atan, exp, sin
from plant.vectors import P

Vector = NDArray[np.float64]


@equation
def magic(b: float, c: float, d: float, e: float, slip: float) -> float:
    """Magic Formula, d sin(c atan(b s - e (b s - atan(b s))))."""
    bs = b * slip
    return d * sin(c * atan(bs - e * (bs - atan(bs))))


@equation
def weighting(b: float, c: float, e: float, slip: float) -> float:
    """Cosine version for combined slip, cos(c atan(b s - e (b s - atan(b s))))."""
    bs = b * slip
    return sin(0.5 * pi + c * atan(bs - e * (bs - atan(bs))))


@equation
def load_offset(load_n: float, p: Vector) -> float:
    """Normalised change of load, dfz = (Fz - Fz0') / Fz0'."""
    nominal = p[P.tyre_lfzo] * p[P.tyre_fnomin]
    return (load_n - nominal) / nominal


@equation
def slip_stiffness(load_n: float, dfz: float, p: Vector) -> float:
    """Longitudinal slip stiffness, N: Kx = Fz (pKx1 + pKx2 dfz) exp(pKx3 dfz) lKx."""
    return load_n * (p[P.tyre_pkx1] + p[P.tyre_pkx2] * dfz) * exp(p[P.tyre_pkx3] * dfz) * p[P.tyre_lkx]


@equation
def cornering_stiffness(load_n: float, p: Vector) -> float:
    """Cornering stiffness, N/rad (negative): Ky = pKy1 Fz0' sin(2 atan(Fz / (pKy2 Fz0'))) lKy."""
    nominal = p[P.tyre_lfzo] * p[P.tyre_fnomin]
    q = load_n / (p[P.tyre_pky2] * nominal)
    return p[P.tyre_pky1] * nominal * 2.0 * q / (1.0 + q * q) * p[P.tyre_lky]  # sin(2 atan q) = 2 q / (1 + q^2)


@equation
def peak_longitudinal(load_n: float, dfz: float, friction: float, p: Vector) -> float:
    """Peak longitudinal force, N: Dx = mux Fz."""
    return (p[P.tyre_pdx1] + p[P.tyre_pdx2] * dfz) * p[P.tyre_lmux] * friction * load_n


@equation
def peak_lateral(load_n: float, dfz: float, friction: float, p: Vector) -> float:
    """Peak lateral force, N: Dy = muy Fz."""
    return (p[P.tyre_pdy1] + p[P.tyre_pdy2] * dfz) * p[P.tyre_lmuy] * friction * load_n


@equation
def partly_sliding(slip: float, normalised: float, share: float) -> float:
    """Slip that the Magic Formula answers like a tyre whose contact slides in part from the first slip on.

    s (1 - q x / (1 + (1 + q) x)), x = K |s| / D ``normalised``, q ``share``: the force begins as K s (1 - q x), which
    the odd Magic Formula cannot. With it, brush (1 - (1 - x/3)^3), exponential (1 - exp(-x)) and hyperbolic tangent lie
    within 0.1 % of the peak force; without, the first two are 2 and 4 % off at a given K.
    """
    return slip * (1.0 - share * normalised / (1.0 + (1.0 + share) * normalised))


@equation
def pure_longitudinal(slip: float, load_n: float, dfz: float, peak: float, stiffness: float, p: Vector) -> float:
    """Longitudinal force at pure slip, N."""
    shifted = slip + (p[P.tyre_phx1] + p[P.tyre_phx2] * dfz) * p[P.tyre_lhx]
    sign = 1.0 if shifted >= 0.0 else -1.0
    e = (p[P.tyre_pex1] + (p[P.tyre_pex2] + p[P.tyre_pex3] * dfz) * dfz) * (1.0 - p[P.tyre_pex4] * sign) * p[P.tyre_lex]
    c = p[P.tyre_pcx1] * p[P.tyre_lcx]
    vertical = load_n * (p[P.tyre_pvx1] + p[P.tyre_pvx2] * dfz) * p[P.tyre_lvx] * p[P.tyre_lmux]
    curved = partly_sliding(shifted, stiffness / peak * abs(shifted), p[P.tyre_partial_sliding])
    return magic(stiffness / (c * peak), c, peak, min(e, 1.0), curved) + vertical


@equation
def pure_lateral(angle: float, load_n: float, dfz: float, peak: float, stiffness: float, p: Vector) -> float:
    """Lateral force at pure slip, N; ``angle`` is the slip angle, rad."""
    shifted = angle + (p[P.tyre_phy1] + p[P.tyre_phy2] * dfz) * p[P.tyre_lhy]
    sign = 1.0 if shifted >= 0.0 else -1.0
    e = (p[P.tyre_pey1] + p[P.tyre_pey2] * dfz) * (1.0 - p[P.tyre_pey3] * sign) * p[P.tyre_ley]
    c = p[P.tyre_pcy1] * p[P.tyre_lcy]
    vertical = load_n * (p[P.tyre_pvy1] + p[P.tyre_pvy2] * dfz) * p[P.tyre_lvy] * p[P.tyre_lmuy]
    return magic(stiffness / (c * peak), c, peak, min(e, 1.0), shifted) + vertical


@equation
def longitudinal_weight(slip: float, angle: float, dfz: float, p: Vector) -> float:
    """Gxa: how much the slip angle leaves of the longitudinal force."""
    q = p[P.tyre_rbx2] * slip
    b = p[P.tyre_rbx1] / sqrt(1.0 + q * q) * p[P.tyre_lxal]
    e = min(p[P.tyre_rex1] + p[P.tyre_rex2] * dfz, 1.0)
    c = p[P.tyre_rcx1]
    shift = p[P.tyre_rhx1]
    return weighting(b, c, e, angle + shift) / weighting(b, c, e, shift)


@equation
def lateral_weight(slip: float, angle: float, dfz: float, p: Vector) -> float:
    """Gyk: how much the longitudinal slip leaves of the lateral force."""
    q = p[P.tyre_rby2] * (angle - p[P.tyre_rby3])
    b = p[P.tyre_rby1] / sqrt(1.0 + q * q) * p[P.tyre_lyka]
    e = min(p[P.tyre_rey1] + p[P.tyre_rey2] * dfz, 1.0)
    c = p[P.tyre_rcy1]
    shift = p[P.tyre_rhy1] + p[P.tyre_rhy2] * dfz
    return weighting(b, c, e, slip + shift) / weighting(b, c, e, shift)


@equation
def ply_steer(slip: float, angle: float, dfz: float, peak: float, p: Vector) -> float:
    """SVyk: lateral force that longitudinal slip induces, N."""
    q = p[P.tyre_rvy4] * angle
    d = peak * (p[P.tyre_rvy1] + p[P.tyre_rvy2] * dfz) / sqrt(1.0 + q * q)
    return d * sin(p[P.tyre_rvy5] * atan(p[P.tyre_rvy6] * slip)) * p[P.tyre_lvyka]


@equation
def combined(slip: float, angle: float, load_n: float, friction: float, side: float, p: Vector) -> tuple[float, float]:
    """Longitudinal and lateral force, N, at combined slip.

    Parameters
    ----------
    slip : kappa.  angle : slip angle alpha, rad.  load_n : Fz, above 0.  friction : scale of the road, above 0.
    side : 1 left, -1 right.  p : parameter vector.
    """
    return combined_at(slip, angle, load_n, friction, slip_stiffness(load_n, load_offset(load_n, p), p), side, p)


@equation
def combined_at(
    slip: float, angle: float, load_n: float, friction: float, stiffness_n: float, side: float, p: Vector
) -> tuple[float, float]:
    """As `combined`, with the longitudinal slip stiffness given, N."""
    dfz = load_offset(load_n, p)
    peak_x = peak_longitudinal(load_n, dfz, friction, p)
    peak_y = peak_lateral(load_n, dfz, friction, p)
    a = side * angle
    fx = pure_longitudinal(slip, load_n, dfz, peak_x, stiffness_n, p)
    fy = pure_lateral(a, load_n, dfz, peak_y, cornering_stiffness(load_n, p), p)
    fx *= longitudinal_weight(slip, a, dfz, p)
    fy = fy * lateral_weight(slip, a, dfz, p) + ply_steer(slip, a, dfz, peak_y, p)
    return fx, side * fy


@equation
def relaxation_longitudinal(load_n: float, dfz: float, p: Vector) -> float:
    """Relaxation length, m: Fz (pTx1 + pTx2 dfz) exp(-pTx3 dfz) (R0 / Fz0) lsgkp."""
    stretch = (p[P.tyre_ptx1] + p[P.tyre_ptx2] * dfz) * exp(-p[P.tyre_ptx3] * dfz)
    return load_n * stretch * p[P.tyre_unloaded_radius] / p[P.tyre_fnomin] * p[P.tyre_lsgkp]


@equation
def relaxation_lateral(load_n: float, p: Vector) -> float:
    """Relaxation length, m: pTy1 sin(2 atan(Fz / (pTy2 Fz0'))) R0 lFz0 lsgal."""
    q = load_n / (p[P.tyre_pty2] * p[P.tyre_lfzo] * p[P.tyre_fnomin])
    return p[P.tyre_pty1] * 2.0 * q / (1.0 + q * q) * p[P.tyre_unloaded_radius] * p[P.tyre_lfzo] * p[P.tyre_lsgal]


@equation
def sliding_relaxation(length_m: float, slip: float, limit: float, least_m: float) -> float:
    """Relaxation length left when the contact slides, m: sigma (1 - |s| / limit), at least ``least_m``.

    Pacejka 2006, chapter 7, restricted fully non-linear model; ``limit`` is 3 D / K, where a brush model slides
    completely.
    """
    return max(length_m * (1.0 - abs(slip) / limit), least_m)
