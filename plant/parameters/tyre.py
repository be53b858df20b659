"""Tyre: the PAC2002 coefficients the model uses, named as in a ``.tir`` file in lower case.

Camber terms are left out: the model has no camber.
"""

from dataclasses import dataclass
from typing import Annotated

Coefficient = Annotated[float, "", -500.0, 500.0]
Scale = Annotated[float, "", 0.0, 10.0]
SignedScale = Annotated[float, "", -20.0, 20.0]


@dataclass(frozen=True, slots=True)
class TyreParameters:
    """Magic Formula coefficients (pure slip, combined slip, relaxation), scaling factors and low-speed values."""

    unloaded_radius: Annotated[float, "m", 0.1, 1.0]
    fnomin: Annotated[float, "N", 100.0, 50000.0]
    pcx1: Coefficient
    pdx1: Coefficient
    pdx2: Coefficient
    pex1: Coefficient
    pex2: Coefficient
    pex3: Coefficient
    pex4: Coefficient
    pkx1: Coefficient
    pkx2: Coefficient
    pkx3: Coefficient
    phx1: Coefficient
    phx2: Coefficient
    pvx1: Coefficient
    pvx2: Coefficient
    rbx1: Coefficient
    rbx2: Coefficient
    rcx1: Coefficient
    rex1: Coefficient
    rex2: Coefficient
    rhx1: Coefficient
    ptx1: Coefficient
    ptx2: Coefficient
    ptx3: Coefficient
    pcy1: Coefficient
    pdy1: Coefficient
    pdy2: Coefficient
    pey1: Coefficient
    pey2: Coefficient
    pey3: Coefficient
    pky1: Coefficient
    pky2: Coefficient
    phy1: Coefficient
    phy2: Coefficient
    pvy1: Coefficient
    pvy2: Coefficient
    rby1: Coefficient
    rby2: Coefficient
    rby3: Coefficient
    rcy1: Coefficient
    rey1: Coefficient
    rey2: Coefficient
    rhy1: Coefficient
    rhy2: Coefficient
    rvy1: Coefficient
    rvy2: Coefficient
    rvy4: Coefficient
    rvy5: Coefficient
    rvy6: Coefficient
    pty1: Coefficient
    pty2: Coefficient
    lfzo: Scale
    lcx: Scale
    lmux: Scale
    lex: SignedScale
    lkx: Scale
    lhx: Scale
    lvx: Scale
    lxal: Scale
    lsgkp: Scale
    lcy: Scale
    lmuy: Scale
    ley: Scale
    lky: Scale
    lhy: Scale
    lvy: Scale
    lyka: Scale
    lvyka: Scale
    lsgal: Scale
    relaxation_least_m: Annotated[float, "m", 0.03, 0.3]  # what is left at full sliding or without load
    partial_sliding: Annotated[float, "", 0.0, 3.0]  # 0 Magic Formula, 0.35 brush, 0.55 exponential (Burckhardt)
    low_speed_mps: Annotated[float, "m/s", 0.1, 10.0]
    low_speed_damping_ns_m: Annotated[float, "N s/m", 0.0, 20000.0]
