"""Numbers of the vehicle that may be off, and by how much: what the set states, and forms of curves that none does."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from plant.layout import Layout

CONSTANT_EPSILON_W = 1e7
"""Pads from here on have one friction, whatever their temperature."""
BRAKE_K = 423.15
"""Temperature that brake gains are stated at."""
HALF_WIDTH_TO_SIGMA = 0.5  # a tolerance is two standard deviations
_GUESSED = 8.0
_WIDE, _MOST_FACTOR, _MOST_TIMES = 0.1, 1.7, 5.0
_FORM = {
    "motor_time_constant_s": 0.1, "ehb_dead_time_s": 0.1, "wheel_inertia_kg_m2": 0.05, "vehicle_cog_height_m": 0.04,
    "vehicle_yaw_inertia_kg_m2": 0.05, "vehicle_steering_ratio": 0.02,
}  # fmt: skip
"""Share that a number is off at least, however well it is stated: an equation's number is not what was measured."""
_SUSPENSION = {
    "suspension_ride_rate_n_m": 0.3, "suspension_progression_n_m3": 1.0, "suspension_damping_ns_m": 0.3,
    "suspension_brake_support_tangent": 0.6, "suspension_drive_support_tangent": 0.6,
    "suspension_anti_roll_nm_rad": 0.7, "suspension_roll_centre_height_m": 3.0,
    "vehicle_pitch_inertia_kg_m2": 0.6, "vehicle_roll_inertia_kg_m2": 0.2,
}  # fmt: skip
_SPRINGS = 0.05
"""The same share of a number of the suspension that a set states."""
_LIFT = 0.1
"""Half-width of an axle's lift coefficient that no set states."""
_SIDE = 0.5
"""Share that the load may be off at which a tyre's cornering stiffness is largest: whether it grows with the load."""
_THERMAL = {"friction_brake_heat_capacity_j_k": 0.2, "friction_brake_cooling_w_k": 0.3}
"""Heat store of the discs, if a set does not state it."""
_SIGNED = (
    "suspension_progression_n_m3", "suspension_brake_support_tangent", "suspension_drive_support_tangent",
    "suspension_roll_centre_height_m",
)  # fmt: skip
"""Numbers that a car may have of either sign."""


@dataclass(frozen=True, eq=False)
class Nuisance:
    """A number of the vehicle that may be off: ``p[at] += z * step``, z normal with standard deviation 1.

    ``farthest`` is how many standard deviations it may be off at most; farther off it is a cause to be named. Beyond
    ``most`` more its equation has no meaning.
    ``kind`` says of what: a number of the vehicle (``signed`` if it may be below zero), the discs' temperature at the
    start, the latency of a node, or of what holds a demand (never below zero), zero of a sensor, what one brake, motor,
    tyre or clock is off beside the others (``scatter``), the lag of a toothed wheel, or the time over which it is a
    mean (never below zero), the lag of pads behind their sensors (``line``, never below zero).
    """

    name: str
    at: tuple[int, ...]
    step: tuple[float, ...]
    kind: str = "vehicle"
    bound: float = 3.0
    upper_bound: float = np.inf

    @property
    def upper(self) -> float:
        """How many standard deviations it may be more at most."""
        return min(self.bound, self.upper_bound)


def with_wide_prior(nuisance: Nuisance, p: Floats) -> Nuisance:
    """A number that no set states may go far, but a positive one to no more than five times or a fifth."""
    if nuisance.kind == "signed":
        return replace(nuisance, bound=_GUESSED)
    factor = max(factor_of(p[at], step) for at, step in zip(nuisance.at, nuisance.step, strict=True))
    limit = np.log(_MOST_TIMES) / np.log(factor) if factor > 1.0 else _GUESSED
    return replace(nuisance, bound=min(_GUESSED, float(limit)))


def factor_of(now: float, step: float) -> float:
    """By what one standard deviation multiplies a positive number known badly; 1 for one that it is added to."""
    wide = now > 0.0 and abs(step) >= _WIDE * now
    return min(1.0 + abs(step) / now, _MOST_FACTOR) if wide else 1.0


def _amount(now: float, step: float, then: float) -> float:
    """How many standard deviations a positive number ``then`` is off ``now``."""
    factor = factor_of(now, step)
    return float(np.log(then / now) / np.log(factor)) if factor > 1.0 else (then - now) / step


def nuisance_parameters(
    p: Floats, tolerance: Mapping[str, float], layout: Layout, stated: Collection[str]
) -> list[Nuisance]:
    """One a parameter; what acts alike is one (radius and area, pad numbers), axles are moved together or apart.

    Parameters
    ----------
    tolerance : half-widths of numbers of the flat vehicle ``p``.  stated : numbers that the set gives.
    """
    found: list[Nuisance] = []

    def add(name: str, at: list[int], half: list[float]) -> None:
        if any(half):
            found.append(Nuisance(name, tuple(at), tuple(h * HALF_WIDTH_TO_SIGMA for h in half)))

    for name in (
        "vehicle_mass_kg", "vehicle_cog_height_m", "vehicle_drag_coefficient", "vehicle_rolling_resistance",
        "wheel_rolling_radius_m", "wheel_inertia_kg_m2", "tyre_lkx", "tyre_lsgkp", "ehb_natural_frequency_hz",
        "ehb_damping_ratio", "ehb_dead_time_s", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s",
        "tyre_lmux", "motor_time_constant_s",
        "motor_rate_limit_nm_s", "motor_peak_torque_nm",
        "motor_fade_end_mps", "motor_fade_start_mps", "battery_charge_power_w", "sensor_imu_cutoff_hz",
        "tyre_lky", "vehicle_yaw_inertia_kg_m2", "vehicle_steering_ratio",
    ):  # fmt: skip
        own = layout.slice(name)
        half = max(tolerance.get(name, 0.0), _FORM.get(name, 0.0) * float(p[own].mean()))
        add(name, list(range(own.start, own.stop)), [half] * layout.sizes[name])
    cog = layout.slice("vehicle_cog_to_axle_m").start
    add(
        "vehicle_cog_to_axle_m",
        [cog, cog + 1],
        [tolerance.get("cog_to_front_axle_m", tolerance.get("vehicle_cog_to_axle_m", 0.0))] * 2,
    )
    found[-1] = replace(found[-1], step=(found[-1].step[0], -found[-1].step[1]))
    for k, axle in enumerate(("front", "rear")):
        area = layout.slice("friction_brake_piston_area_m2").start + k
        radius = layout.slice("friction_brake_effective_radius_m").start + k
        share = np.hypot(
            tolerance.get("friction_brake_piston_area_m2", 0.0) / p[area],
            tolerance.get("friction_brake_effective_radius_m", 0.0) / p[radius],
        )
        share = np.hypot(share, tolerance.get("friction_brake_efficiency", 0.0))
        gain = tolerance.get(f"brake_gain_{axle}")
        if gain is not None and np.isfinite(gain):
            brake_gain = 2.0 * p[layout.slice("pad_a_1_ks").start] / p[layout.slice("pad_b_1_j").start]
            brake_gain *= p[layout.slice("friction_brake_efficiency").start] * p[area] * p[radius]
            temperature = p[layout.slice("friction_brake_ambient_k").start]
            epsilon = p[layout.slice("pad_epsilon_w").start]
            reached = temperature if epsilon >= CONSTANT_EPSILON_W else BRAKE_K
            share = gain / (brake_gain * reached / epsilon)
        add(f"brake_gain_{axle}", [area], [float(share) * p[area]])
        for name in ("friction_brake_threshold_pressure_pa", "vehicle_slip_angle_share"):
            add(f"{name}_{axle}", [layout.slice(name).start + k], [tolerance.get(name, 0.0)])
    for name in ("pad_a_1_ks", "pad_epsilon_w", "pad_c_1_s"):
        add(name, [layout.slice(name).start], [tolerance.get(name, 0.0)])
    # forms of curves that no vehicle set states: the tyre's near its peak and at the side, the roll of the body
    curve = layout.slice("tyre_lex").start
    add("tyre_curve", [curve], [1.5])
    of_one = float(p[layout.slice("tyre_pex1").start])
    if of_one > 0.0:  # E is 1 at most (Pacejka 2012, eq. 4.E14)
        found[-1] = replace(found[-1], upper_bound=_amount(float(p[curve]), found[-1].step[0], 1.0 / of_one))
    add("tyre_shape", [layout.slice("tyre_lcx").start], [0.25])
    add("tyre_stiffness_load", [layout.slice("tyre_pkx3").start], [0.3])
    side = layout.slice("tyre_pky2").start
    add("tyre_side_stiffness_load", [side], [_SIDE * float(p[side])])
    add("tyre_friction_load", [layout.slice("tyre_pdx2").start], [0.04])
    add("tyre_relaxation_load", [layout.slice("tyre_ptx2").start], [1.5])
    add("wheel_brake_windup_time_s", [layout.slice("wheel_brake_windup_time_s").start], [0.006])
    add("tyre_lsgal", [layout.slice("tyre_lsgal").start], [0.3])
    add("tyre_lmuy", [layout.slice("tyre_lmuy").start], [0.15])
    lift = layout.slice("vehicle_lift_coefficient")
    least = 0.0 if "vehicle_lift_coefficient" in stated else _LIFT
    for k, axle in enumerate(("front", "rear")):
        half = max(tolerance.get("vehicle_lift_coefficient", 0.0), least)
        add(f"vehicle_lift_coefficient_{axle}", [lift.start + k], [half])
        found[-1] = replace(found[-1], kind="signed")
    # the same for suspension and discs, where a set does not state them
    shares = {name: _SPRINGS if name in stated else share for name, share in _SUSPENSION.items()}
    shares |= {name: 0.0 if name in stated else share for name, share in _THERMAL.items()}
    for name, share in shares.items():
        at, size = layout.slice(name).start, layout.sizes[name]
        for k in range(size):
            half = max(tolerance.get(name, 0.0), share * float(p[at + k]))
            add(name if size == 1 else f"{name}_{('front', 'rear')[k]}", [at + k], [half])
            if name in _SIGNED:
                found[-1] = replace(found[-1], kind="signed")
    return found
