"""The tyre against the Magic Formula of the CommonRoad vehicle models (another author's code), and published points."""

import math
from types import SimpleNamespace

import numpy as np

from hil.report.report import Chart, Curve, Section
from hil.report.units import KN, PERCENT, Unit
from hil.validation.verify.car import paper_car
from hil.validation.verify.topic import Topic, below, within
from plant.layout import Vector
from plant.model import pack
from plant.parameters import TyreParameters
from plant.tyre import combined, load_offset, slip_stiffness

LOADS_N = (2500.0, 4000.0, 5500.0)
SLIPS = np.linspace(-1.0, 1.0, 201)
ANGLES_RAD = np.radians(np.linspace(-20.0, 20.0, 161))
PUBLISHED_STIFFNESS_N = {2500.0: 51e3, 3590.0: 78e3, 4500.0: 103e3, 5500.0: 134e3}


def forces(p: Vector, slip: Vector, angle_rad: Vector, load_n: float) -> tuple[Vector, Vector]:
    """Our forces over slips and slip angles of one shape."""
    pairs = [combined(float(k), float(a), load_n, 1.0, 1.0, p) for k, a in zip(slip, angle_rad, strict=True)]
    fx, fy = np.array(pairs).T
    return fx, fy


def independent(tyre: TyreParameters, slip: Vector, angle_rad: Vector, load_n: float) -> tuple[Vector, Vector]:
    """Forces of the CommonRoad Magic Formula.

    It has no dependence on the load, so it is given coefficients that our load makes of ours. Its side force has the
    other sign and its longitudinal slip too; the shifts are off on both sides.
    """
    from vehiclemodels.utils.tire_model import (
        formula_lateral,
        formula_lateral_comb,
        formula_longitudinal,
        formula_longitudinal_comb,
    )

    dfz = load_n / tyre.fnomin - 1.0
    p = SimpleNamespace(
        p_cx1=tyre.pcx1, p_dx1=tyre.pdx1 + tyre.pdx2 * dfz, p_dx3=0.0, p_hx1=0.0, p_vx1=0.0,
        p_kx1=(tyre.pkx1 + tyre.pkx2 * dfz) * math.exp(tyre.pkx3 * dfz),
        r_hx1=tyre.rhx1, r_bx1=tyre.rbx1, r_bx2=tyre.rbx2, r_cx1=tyre.rcx1, r_ex1=tyre.rex1,
        p_cy1=tyre.pcy1, p_dy1=tyre.pdy1 + tyre.pdy2 * dfz, p_dy3=0.0, p_hy1=0.0, p_hy3=0.0, p_vy1=0.0, p_vy3=0.0,
        p_ky1=tyre.pky1 * math.sin(2.0 * math.atan(load_n / (tyre.pky2 * tyre.fnomin))) * tyre.fnomin / load_n,
        r_hy1=tyre.rhy1, r_by1=tyre.rby1, r_by2=tyre.rby2, r_by3=tyre.rby3, r_cy1=tyre.rcy1, r_ey1=tyre.rey1,
        r_vy1=0.0, r_vy3=0.0, r_vy4=tyre.rvy4, r_vy5=tyre.rvy5, r_vy6=tyre.rvy6,
    )  # fmt: skip
    along, across = [], []
    for k, a in zip(slip, angle_rad, strict=True):
        p.p_ex1 = (tyre.pex1 + tyre.pex2 * dfz + tyre.pex3 * dfz**2) * (1.0 - tyre.pex4 * (1.0 if k >= 0.0 else -1.0))
        p.p_ey1 = (tyre.pey1 + tyre.pey2 * dfz) * (1.0 - tyre.pey3 * (1.0 if a >= 0.0 else -1.0))
        pure_x = formula_longitudinal(-k, 0.0, load_n, p)
        pure_y, mu_y = formula_lateral(a, 0.0, load_n, p)
        along.append(formula_longitudinal_comb(k, a, pure_x, p))
        across.append(formula_lateral_comb(k, a, 0.0, mu_y, load_n, pure_y, p))
    return np.array(along), np.array(across)


def topic() -> Topic:
    """Pure and combined slip on three loads against the other code; slip stiffness against the published values."""
    car = paper_car()
    p = pack(car)
    worst_x, worst_y = 0.0, 0.0
    charts = []
    nothing = np.zeros_like
    cases: list[tuple[str, Vector, Vector, str, Unit, Vector, int]] = [
        ("Longitudinal force, pure slip", SLIPS, nothing(SLIPS), "slip", PERCENT, SLIPS, 0),
        ("Lateral force, pure slip", nothing(ANGLES_RAD), ANGLES_RAD, "slip angle", "deg", np.degrees(ANGLES_RAD), 1),
        ("Longitudinal force at 4 deg", SLIPS, nothing(SLIPS) + math.radians(4.0), "slip", PERCENT, SLIPS, 0),
        ("Lateral force at 5 % braking slip", nothing(ANGLES_RAD) - 0.05, ANGLES_RAD, "slip angle", "deg",
         np.degrees(ANGLES_RAD), 1),
    ]  # fmt: skip
    for title, slip, angle, label, unit, x, shown in cases:
        curves = []
        for load, group in zip(LOADS_N, ("rl", "fl", "fr"), strict=True):
            ours, theirs = forces(p, slip, angle, load), independent(car.tyre, slip, angle, load)
            worst_x = max(worst_x, float(np.abs(ours[0] - theirs[0]).max()) / load)
            worst_y = max(worst_y, float(np.abs(ours[1] - theirs[1]).max()) / load)
            curves.append(Curve(f"{load / 1000:g} kN", x, ours[shown], group=group))
            thinned = slice(None, None, 10)
            curves.append(
                Curve(
                    f"{load / 1000:g} kN, CommonRoad", x[thinned], theirs[shown][thinned], None, None, "points", group
                )
            )
        charts.append(Chart(title, label, unit, "force", KN, tuple(curves)))
    numbers = [
        below("Longitudinal, largest", 1e6 * worst_x, 1.0, "ppm", "of the load, over all slips and loads"),
        below("Lateral, largest", 1e6 * worst_y, 1.0, "ppm", "of the load, over all slips and loads"),
    ]
    for load, published in PUBLISHED_STIFFNESS_N.items():
        stiffness_kn = slip_stiffness(load, load_offset(load, p), p) / 1e3
        numbers.append(
            below(f"C at {load:g} N", stiffness_kn - published / 1e3, 0.6, "kN", "against the published, given to 1 kN")
        )
    pure, _ = forces(p, SLIPS, nothing(SLIPS), 3590.0)
    numbers += [
        within("Peak friction", float(np.abs(pure).max()) / 3590.0, 1.18, 1.20, "", "published 1.19 at 3590 N"),
        within("Slip at the peak", float(abs(SLIPS[np.argmin(pure)])), 0.14, 0.17, "", "published 0.154"),
    ]
    text = "Lines: ours. Points: CommonRoad vehicle models, which take the coefficients at each load. Ply steer off."
    return Topic(
        "Tyre",
        "the Magic Formula of the CommonRoad vehicle models",
        tuple(numbers),
        Section("Tyre", charts=tuple(charts), text=text),
    )
