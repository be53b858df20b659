"""Contact of the tyres with the road: loads, relaxed slips, forces, down to standstill."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from math import pi

import numpy as np
from numpy.typing import NDArray

from plant.brakes import per_axle
from plant.compiled import equation
from plant.fastmath import atan, sin
from plant.inject import J, inject_wheel
from plant.suspension import link_force, spring_force
from plant.tyre import (
    combined_at,
    cornering_stiffness,
    load_offset,
    peak_lateral,
    peak_longitudinal,
    relaxation_lateral,
    relaxation_longitudinal,
    sliding_relaxation,
    slip_stiffness,
)
from plant.vectors import C, P, U, X, Y
from plant.vehicle import GRAVITY_MPS2, rolling_resistance

Vector = NDArray[np.float64]
BLEED_MPS = 6.0  # C: a locked wheel's deflection at rest is then what its sliding force can hold
LOAD_FLOOR_N = 50.0  # an unloaded tyre is computed at this load, and its force scaled down
FRICTION_FLOOR = 1e-3


@equation
def static_load(i: int, cos_grade: float, p: Vector) -> float:
    """Load of one wheel at rest, N; of the sprung mass as on the flat, where the springs are at their zero."""
    front_m, rear_m = p[P.vehicle_cog_to_axle_m], p[P.vehicle_cog_to_axle_m + 1]
    share = (rear_m if i < 2 else front_m) / (front_m + rear_m)
    unsprung = 0.5 * per_axle(i, p, P.vehicle_unsprung_mass_kg)
    return GRAVITY_MPS2 * (0.5 * p[P.vehicle_mass_kg] * share - unsprung + unsprung * cos_grade)


@equation
def wheel_load(i: int, braking: float, driving: float, cos_grade: float, x: Vector, p: Vector, y: Vector) -> float:
    """Vertical load of one wheel, N: static share, unsprung weight, spring and links.

    ``braking``, ``driving`` : torque of the friction brake and of the motor, N m; negative brakes.
    """
    front = 1.0 if i < 2 else -1.0
    half = 0.5 - (i % 2)
    front_m, rear_m = p[P.vehicle_cog_to_axle_m], p[P.vehicle_cog_to_axle_m + 1]
    wheel_x = front_m if i < 2 else -rear_m
    wheel_y = half * per_axle(i, p, P.vehicle_track_m)
    share = (rear_m if i < 2 else front_m) / (front_m + rear_m)
    drop = wheel_x * x[X.pitch_rad] - wheel_y * x[X.roll_rad] - x[X.heave_m]
    drop_rate = wheel_x * x[X.pitch_rate_rad_s] - wheel_y * x[X.roll_rate_rad_s] - x[X.heave_rate_mps]
    spring = spring_force(
        drop, drop_rate, x[X.roll_rad], wheel_y, per_axle(i, p, P.suspension_ride_rate_n_m),
        per_axle(i, p, P.suspension_progression_n_m3), per_axle(i, p, P.suspension_damping_ns_m),
        per_axle(i, p, P.suspension_anti_roll_nm_rad),
    )  # fmt: skip
    links = link_force(
        braking / p[P.wheel_rolling_radius_m], driving / p[P.wheel_rolling_radius_m],
        p[P.vehicle_mass_kg] * share * x[X.speed_mps] * x[X.yaw_rate_rad_s], front, wheel_y,
        per_axle(i, p, P.suspension_brake_support_tangent), per_axle(i, p, P.suspension_drive_support_tangent),
        per_axle(i, p, P.suspension_roll_centre_height_m),
    )  # fmt: skip
    return max(inject_wheel(static_load(i, cos_grade, p) + spring + links, y, J.wheel_load, i), 0.0)


@equation
def rolling_radius(i: int, p: Vector, y: Vector) -> float:
    """Rolling radius of one wheel, m."""
    return inject_wheel(p[P.wheel_rolling_radius_m], y, J.wheel_radius, i)


@equation
def slip_rate(
    slip: float, sliding_mps: float, transport_mps: float, bleeding_mps: float, gain_1_m: float, held: float
) -> float:
    """Rate of a relaxed slip, 1/s: sigma s' = v_s - |v| s (Pacejka 2006, section 7.2), less what bleeds off.

    At rest the slip is the deflection of the carcass, and that is no larger than its stiffness and the friction let it
    be: slip beyond ``held``, D / K, bleeds off near standstill. Else the deflection of a locked wheel, kept up to its
    sliding slip, would throw the car back with more than the energy of its springs.
    """
    excess = slip - min(max(slip, -held), held)
    return (sliding_mps - transport_mps * slip - bleeding_mps * excess) * gain_1_m


@equation
def slip_decay(slip: float, transport_mps: float, bleeding_mps: float, gain_1_m: float, held: float) -> float:
    """Own decay rate of a relaxed slip, 1/s."""
    return (transport_mps + (bleeding_mps if abs(slip) > held else 0.0)) * gain_1_m


@equation
def tangent_stiffness_share(force_n: float, peak_n: float) -> float:
    """Share of the slip stiffness that is left at a force: 1 - (F/D)^2, within 0.1 of the magic formula's."""
    used = force_n / peak_n
    return max(1.0 - used * used, 0.0)


@equation
def near_standstill(speed_mps: float, limit_mps: float) -> float:
    """Share of what acts near standstill only, fading in below ``limit_mps`` (Pacejka 2006, section 8.6)."""
    share = min(speed_mps / limit_mps, 1.0)
    return 0.5 + 0.5 * sin(0.5 * pi - pi * share)


@equation
def contacts(x: Vector, u: Vector, cut: Vector, p: Vector, y: Vector, cos_grade: float, wheels: int) -> None:
    """Wheel torques, loads, tyre forces; rates of the slips and the wheel speeds.

    Reads ``y.friction_torque_nm``, ``motor_torque_nm``, ``along_mps``, ``across_mps`` and ``road_friction``.
    """
    for i in range(wheels):
        radius = rolling_radius(i, p, y)
        given, made = u[U.wheel_torque_nm + i], y[Y.friction_torque_nm + i] + y[Y.motor_torque_nm + i]
        torque = given if cut[C.wheel_torque + i] > 0.5 else made
        y[Y.wheel_torque_nm + i] = torque
        driving = y[Y.motor_torque_nm + i]
        load = wheel_load(i, torque - driving, driving, cos_grade, x, p, y)
        y[Y.wheel_load_n + i] = load

        omega, slip, side_slip = x[X.wheel_speed_rad_s + i], x[X.slip + i], x[X.side_slip + i]
        along, across = y[Y.along_mps + i], y[Y.across_mps + i]
        transport = abs(along)
        sliding = omega * radius - along
        y[Y.slip_speed_mps + i] = sliding

        loaded = max(load, LOAD_FLOOR_N)
        grip = max(y[Y.road_friction + i], FRICTION_FLOOR)
        dfz = load_offset(loaded, p)
        stiffness_x = inject_wheel(slip_stiffness(loaded, dfz, p), y, J.tyre_stiffness, i)
        stiffness_y = -cornering_stiffness(loaded, p)
        least = p[P.tyre_relaxation_least_m]
        held_x = peak_longitudinal(loaded, dfz, grip, p) / stiffness_x
        held_y = peak_lateral(loaded, dfz, grip, p) / stiffness_y
        gain_x = 1.0 / sliding_relaxation(relaxation_longitudinal(loaded, dfz, p), slip, 3.0 * held_x, least)
        gain_y = 1.0 / sliding_relaxation(relaxation_lateral(loaded, p), side_slip, 3.0 * held_y, least)
        y[Y.slip_gain_1_m + i] = gain_x
        inertia = per_axle(i, p, P.wheel_inertia_kg_m2)
        standing = near_standstill(transport, p[P.tyre_low_speed_mps])
        bleeding, damping = BLEED_MPS * standing, p[P.tyre_low_speed_damping_ns_m] * standing
        y[Y.standing_damping_1_s + i] = damping * radius * radius / inertia
        y[Y.rate + X.slip + i] = slip_rate(slip, sliding, transport, bleeding, gain_x, held_x)
        y[Y.rate + X.side_slip + i] = slip_rate(side_slip, across, transport, bleeding, gain_y, held_y)
        y[Y.decay_1_s + X.slip + i] = slip_decay(slip, transport, bleeding, gain_x, held_x)
        y[Y.decay_1_s + X.side_slip + i] = slip_decay(side_slip, transport, bleeding, gain_y, held_y)

        side = 1.0 - 2.0 * (i % 2)
        force, cross = combined_at(
            slip + damping * sliding / stiffness_x,
            per_axle(i, p, P.vehicle_slip_angle_share) * atan(side_slip + damping * across / stiffness_y), loaded, grip,
            stiffness_x, side, p,
        )  # fmt: skip
        carried = load / loaded
        given, made = u[U.longitudinal_force_n + i], inject_wheel(force * carried, y, J.tyre_force, i)
        free = 0.0 if cut[C.force + i] > 0.5 else carried
        y[Y.slip_stiffness_n + i] = free * stiffness_x * tangent_stiffness_share(force, held_x * stiffness_x)
        y[Y.side_stiffness_n + i] = free * stiffness_y * tangent_stiffness_share(cross, held_y * stiffness_y)
        force = given if cut[C.force + i] > 0.5 else made
        y[Y.longitudinal_force_n + i] = force
        y[Y.lateral_force_n + i] = inject_wheel(cross * carried, y, J.tyre_side_force, i)

        coefficient = rolling_resistance(
            omega * radius, p[P.vehicle_rolling_resistance], p[P.vehicle_rolling_resistance_speed_s2_m2]
        )  # fmt: skip
        rolling = inject_wheel(load * radius * coefficient, y, J.wheel_rolling_torque, i)
        y[Y.rolling_torque_nm + i] = rolling
        y[Y.rate + X.wheel_speed_rad_s + i] = (torque - radius * force - rolling) / inertia
        y[Y.rate + X.wheel_angle_rad + i] = omega
    for i in range(wheels):  # a loop of its own, or the one above goes through wheel by wheel
        y[Y.decay_1_s + X.wheel_speed_rad_s + i] += y[Y.standing_damping_1_s + i]
