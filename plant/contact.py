"""Contact of one tyre with the road: relaxed slips to forces, down to standstill."""

from math import atan, cos, pi

import numpy as np
from numpy.typing import NDArray

from plant.compiled import equation
from plant.tyre import (
    combined,
    cornering_stiffness,
    load_offset,
    peak_lateral,
    peak_longitudinal,
    relaxation_lateral,
    relaxation_longitudinal,
    sliding_relaxation,
    slip_stiffness,
)
from plant.vectors import P, X, Y

Vector = NDArray[np.float64]
SLIP_LIMIT = 2.0  # a spinning wheel at standstill would wind its slip up without end
LOAD_FLOOR_N = 100.0  # for relaxation lengths only


@equation
def slip_rate(slip: float, sliding_mps: float, transport_mps: float, length_m: float) -> float:
    """Rate of a relaxed slip, 1/s: sigma s' = v_s - |v| s (Pacejka 2006, section 7.2), stopped at the limit."""
    rate = (sliding_mps - transport_mps * slip) / length_m
    if abs(slip) > SLIP_LIMIT and rate * slip > 0.0:
        return 0.0
    return rate


@equation
def low_speed_damping(speed_mps: float, limit_mps: float, damping_ns_m: float) -> float:
    """Damping of the contact below ``limit_mps``, N s/m (Pacejka 2006, section 8.6): fades in with a cosine."""
    if speed_mps >= limit_mps:
        return 0.0
    return 0.5 * damping_ns_m * (1.0 + cos(pi * speed_mps / limit_mps))


@equation
def tyre_contact(
    i: int, along: float, across: float, load: float, friction: float, x: Vector, p: Vector, dx: Vector,
    decay: Vector, gain: Vector, y: Vector,
) -> tuple[float, float]:  # fmt: skip
    """Rates of the relaxed slips of wheel ``i`` and the forces in its axes, N.

    Parameters
    ----------
    along, across : velocity of the contact in the wheel's axes, m/s.  load : N.  friction : scale of the road.
    The slips are states in ``x``; ``dx``, ``decay``, ``gain`` and ``y.slip_speed_mps`` are written.
    """
    slip, side_slip = x[X.slip + i], x[X.side_slip + i]
    transport = abs(along)
    sliding = x[X.wheel_speed_rad_s + i] * p[P.wheel_rolling_radius_m] - along
    loaded = max(load, LOAD_FLOOR_N)
    grip = max(friction, 1e-3)
    dfz = load_offset(loaded, p)
    stiffness_x = slip_stiffness(loaded, dfz, p)
    stiffness_y = -cornering_stiffness(loaded, p)
    floor = p[P.tyre_relaxation_floor]
    length_x = sliding_relaxation(
        relaxation_longitudinal(loaded, dfz, p), slip, stiffness_x, peak_longitudinal(loaded, dfz, grip, p), floor
    )
    length_y = sliding_relaxation(
        relaxation_lateral(loaded, p), side_slip, stiffness_y, peak_lateral(loaded, dfz, grip, p), floor
    )
    dx[X.slip + i] = slip_rate(slip, sliding, transport, length_x)
    dx[X.side_slip + i] = slip_rate(side_slip, across, transport, length_y)
    decay[X.slip + i] = transport / length_x
    decay[X.side_slip + i] = transport / length_y
    gain[i] = 1.0 / length_x
    y[Y.slip_speed_mps + i] = sliding
    damping = low_speed_damping(transport, p[P.tyre_low_speed_mps], p[P.tyre_low_speed_damping_ns_m])
    left = 1.0 if i % 2 == 0 else -1.0
    return combined(
        slip + damping * sliding / stiffness_x,
        atan(side_slip + damping * across / stiffness_y),
        load,
        friction,
        left,
        p,
    )
