"""Nuisance parameters and their priors: what a vehicle set states, what no set states, and what the logs leave open."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.vehicle.checks import lowest
from hil.diagnosis.vehicle.latency import LATENCY_NODES, Latency
from plant.effects.effect import NODES
from plant.injection.theta import THETA
from plant.vectors import PARAMETER, P

CONSTANT_EPSILON_W = 1e11
"""Pad parameter epsilon from which on the pad friction is constant: hard stops make 1e5 W at a pad face, so within
1e-6."""
BRAKE_K = 423.15
"""Disc temperature that brake gains are stated at."""
HALF_WIDTH_TO_SIGMA = 0.5
"""A tolerance is two standard deviations."""
_WIDE_BOUND = 8.0
_WIDE, _MOST_FACTOR, _MOST_TIMES = 0.1, 1.7, 5.0
"""Share of a standard deviation in a positive value from which on the value is multiplied; the largest factor of one
standard deviation, and of the bound of a wide prior."""


class NuisanceKind(StrEnum):
    """What a nuisance parameter moves in a parameter set, and how."""

    VEHICLE = "vehicle"
    """A positive parameter of the vehicle: added to, or multiplied where it is uncertain (`factor_of`)."""
    SIGNED = "signed"
    """A parameter of the vehicle of either sign: added to."""
    SENSOR = "sensor"
    """Zero of a sensor, in theta."""
    SIDE_TO_SIDE = "side_to_side"
    """Deviation of one brake, motor, tyre or clock from the others, in theta."""
    LINE_LAG = "line_lag"
    """Lag of the pads behind the pressure sensors, in theta; not negative."""
    LATENCY = "latency"
    """Latency of a node's frames behind those of the wheel speeds, or from a logged demand to its action."""
    DISC_TEMPERATURE = "disc_temperature"
    """Temperature of the discs at the start."""
    TOOTH_LAG = "tooth_lag"
    """Lag of a toothed wheel's speed."""
    TOOTH_WINDOW = "tooth_window"
    """Time over which a toothed wheel's speed is a mean; not negative."""
    LEARNED = "learned"
    """Strength of a listed effect that reference logs and the others share, in theta."""
    LEARNED_CURVE = "learned_curve"
    """Coefficient of a nonparametric term that they share, in its rows, row by row."""
    OF_THE_DAY = "of_the_day"
    """What differs from the day of the reference logs to that of the others, in theta."""
    DISC_TEMPERATURE_OF_THE_DAY = "disc_temperature_of_the_day"
    """Temperature of the discs at the start, beside that of the reference logs."""


_NOT_NEGATIVE = (NuisanceKind.TOOTH_WINDOW, NuisanceKind.LINE_LAG)


@dataclass(frozen=True, eq=False)
class Nuisance:
    """An uncertain parameter of no interest: ``value[at] += z * step``, z normal with standard deviation 1.

    Attributes
    ----------
    at : indices in the vector that ``kind`` says.  step : (len(at),) prior standard deviations, in its units.
    bound : largest z; a parameter farther off is a cause to be named.
    upper_bound, lower_bound : largest and smallest z for which the equation has a meaning.
    difference : z of a finite difference, where nothing is known yet of what the data tell.
    """

    name: str
    at: tuple[int, ...]
    step: tuple[float, ...]
    kind: NuisanceKind = NuisanceKind.VEHICLE
    bound: float = 3.0
    upper_bound: float = np.inf
    lower_bound: float = -np.inf
    difference: float = 0.5

    @property
    def lower(self) -> float:
        """Smallest z."""
        return 0.0 if self.kind in _NOT_NEGATIVE else max(-self.bound, self.lower_bound)

    @property
    def upper(self) -> float:
        """Largest z."""
        return min(self.bound, self.upper_bound)


def factor_of(value: float, step: float) -> float:
    """Factor that one standard deviation multiplies an uncertain positive value by; 1 where ``step`` is added."""
    wide = value > 0.0 and abs(step) >= _WIDE * value
    return min(1.0 + abs(step) / value, _MOST_FACTOR) if wide else 1.0


def with_wide_prior(nuisance: Nuisance, p: Floats) -> Nuisance:
    """A parameter that no set states, with a wide bound: a positive one at most five times or a fifth of its value."""
    if nuisance.kind is NuisanceKind.SIGNED:
        return replace(nuisance, bound=_WIDE_BOUND)
    factor = max(factor_of(p[at], step) for at, step in zip(nuisance.at, nuisance.step, strict=True))
    limit = np.log(_MOST_TIMES) / np.log(factor) if factor > 1.0 else _WIDE_BOUND
    return replace(nuisance, bound=min(_WIDE_BOUND, float(limit)))


class _Prior(NamedTuple):
    """Row of the table: half-width of a parameter of the plant.

    It is the set's tolerance, and at least ``share`` of the value and ``half_width``; where the set states the value,
    at least ``if_stated`` of it instead.  ``fixed``: whatever the set says.
    ``split``: one nuisance per axle.  ``signed``: of either sign.  ``name`` of the nuisance, if not the parameter's.
    ``to_zero``: the value may be zero, not less: it is added to, as a factor never leads there.
    ``reciprocal`` of another parameter is the upper limit.
    """

    parameter: str
    share: float = 0.0
    if_stated: float = 0.0
    half_width: float = 0.0
    fixed: bool = False
    split: bool = False
    signed: bool = False
    to_zero: bool = False
    name: str = ""
    reciprocal: str = ""


_WHOLE_CAR = (
    _Prior("vehicle_mass_kg"), _Prior("vehicle_cog_height_m", 0.04, 0.04), _Prior("vehicle_drag_coefficient"),
    _Prior("vehicle_rolling_resistance"), _Prior("wheel_rolling_radius_m"), _Prior("wheel_inertia_kg_m2", 0.05, 0.05),
    _Prior("tyre_lkx"), _Prior("tyre_lsgkp"), _Prior("ehb_natural_frequency_hz"), _Prior("ehb_damping_ratio"),
    _Prior("ehb_dead_time_s", 0.1, 0.1), _Prior("ehb_build_rate_pa_s"), _Prior("ehb_release_rate_pa_s"),
    _Prior("tyre_lmux"), _Prior("motor_time_constant_s", 0.1, 0.1), _Prior("motor_rate_limit_nm_s"),
    _Prior("motor_peak_torque_nm"), _Prior("motor_fade_end_mps"), _Prior("motor_fade_start_mps"),
    _Prior("battery_charge_power_w"), _Prior("sensor_imu_cutoff_hz"), _Prior("tyre_lky"),
    _Prior("vehicle_yaw_inertia_kg_m2", 0.05, 0.05), _Prior("vehicle_steering_ratio", 0.02, 0.02),
)  # fmt: skip
"""Both axles are moved together. A share counts however well the set states the value: a parameter of an equation is
not quite what was measured."""
_AXLES = (
    _Prior("friction_brake_threshold_pressure_pa", split=True, to_zero=True),
    _Prior("vehicle_slip_angle_share", split=True),
)
_CURVES = (
    _Prior("pad_a_1_ks"),
    _Prior("pad_epsilon_w"),
    _Prior("pad_c_1_s"),
    _Prior("tyre_lex", half_width=1.5, fixed=True, signed=True, name="tyre_curve", reciprocal="tyre_pex1"),
    _Prior("tyre_lcx", half_width=0.25, fixed=True, name="tyre_shape"),
    _Prior("tyre_partial_sliding", to_zero=True),
    _Prior("tyre_pkx3", half_width=0.3, fixed=True, signed=True, name="tyre_stiffness_load"),
    _Prior("tyre_pky2", 0.5, fixed=True, name="tyre_side_stiffness_load"),
    _Prior("tyre_pdx2", half_width=0.04, name="tyre_friction_load"),
    _Prior("tyre_ptx2", half_width=1.5, fixed=True, name="tyre_relaxation_load"),
    _Prior("wheel_brake_windup_time_s", half_width=0.006, fixed=True),
    _Prior("tyre_lsgal", half_width=0.3, fixed=True),
    _Prior("tyre_lmuy", half_width=0.15, fixed=True),
    _Prior("vehicle_lift_coefficient", half_width=0.1, split=True, signed=True),
    _Prior("suspension_ride_rate_n_m", 0.3, 0.05, split=True),
    _Prior("suspension_progression_n_m3", 1.0, 0.05, split=True, signed=True),
    _Prior("suspension_damping_ns_m", 0.3, 0.05, split=True),
    _Prior("suspension_brake_support_tangent", 0.6, 0.05, split=True, signed=True),
    _Prior("suspension_drive_support_tangent", 0.6, 0.05, split=True, signed=True),
    _Prior("suspension_anti_roll_nm_rad", 0.7, 0.05, split=True),
    _Prior("suspension_roll_centre_height_m", 3.0, 0.05, split=True, signed=True),
    _Prior("vehicle_pitch_inertia_kg_m2", 0.6, 0.05),
    _Prior("vehicle_roll_inertia_kg_m2", 0.2, 0.05),
    _Prior("friction_brake_heat_capacity_j_k", 0.2, split=True),
    _Prior("friction_brake_cooling_w_k", 0.3, split=True),
)
"""Pads; curves of the tyre near its peak and sideways, which hardly a set states; body, suspension and discs."""


def nuisance_parameters(
    p: Floats, tolerance: Mapping[str, float], stated: Collection[str], exact: Collection[str] = ()
) -> list[Nuisance]:
    """Nuisances of a car: one per parameter or axle; parameters with the same action (pad radius and area) are one.

    Parameters
    ----------
    p : (PARAMETER.size,).  tolerance : half-widths by parameter.  stated : parameters that the vehicle set gives.
    exact : those that are known exactly, which have no nuisance.  Names end in the axle where it is one axle's alone.
    """

    def of(rows: tuple[_Prior, ...]) -> list[Nuisance]:
        return [nuisance for row in rows for nuisance in _nuisances(row, p, tolerance, stated, exact)]

    cog = PARAMETER.slice("vehicle_cog_to_axle_m").start
    nuisances = of(_WHOLE_CAR)
    if step := HALF_WIDTH_TO_SIGMA * _cog_half_width(p, tolerance):
        nuisances.append(Nuisance("vehicle_cog_to_axle_m", (cog, cog + 1), (step, -step)))
    of_axles = of(_AXLES)
    for k, axle in enumerate(("front", "rear")):
        area = PARAMETER.slice("friction_brake_piston_area_m2").start + k
        if step := HALF_WIDTH_TO_SIGMA * (_brake_gain_share(p, tolerance, k, axle) * float(p[area])):
            nuisances.append(Nuisance(f"brake_gain_{axle}", (area,), (step,)))
        nuisances += [one for one in of_axles if one.name.endswith(axle)]
    return nuisances + of(_CURVES)


def _cog_half_width(p: Floats, tolerance: Mapping[str, float]) -> float:
    """Half-width of the centre of gravity's place along the car, m, from whichever key states it."""
    wheelbase = float(p[PARAMETER.slice("vehicle_cog_to_axle_m")].sum())
    keys = {"cog_to_front_axle_m": 1.0, "cog_to_rear_axle_m": 1.0, "front_weight_share": wheelbase}
    stated = (tolerance[key] * factor for key, factor in keys.items() if key in tolerance)
    return next(stated, tolerance.get("vehicle_cog_to_axle_m", 0.0))


def _nuisances(
    row: _Prior, p: Floats, tolerance: Mapping[str, float], stated: Collection[str], exact: Collection[str]
) -> list[Nuisance]:
    """Nuisances of one row, without those of no half-width."""
    own, name = PARAMETER.slice(row.parameter), row.name or row.parameter
    members = [(at,) for at in range(own.start, own.stop)] if row.split else [tuple(range(own.start, own.stop))]
    kind = NuisanceKind.SIGNED if row.signed or row.to_zero else NuisanceKind.VEHICLE
    nuisances = []
    for at, axle in zip(members, ("_front", "_rear") if row.split else ("",), strict=True):
        value, keys = float(p[list(at)].mean()), {row.parameter, f"{row.parameter}{axle}"}
        is_stated = not keys.isdisjoint(stated) and not row.fixed
        share, least = (row.if_stated, 0.0) if is_stated else (row.share, row.half_width)
        given = tolerance.get(f"{row.parameter}{axle}", tolerance.get(row.parameter, 0.0))
        half_width = max(0.0 if row.fixed else given, share * abs(value), least)
        if half_width and keys.isdisjoint(exact):
            step = HALF_WIDTH_TO_SIGMA * half_width
            limit = np.inf
            if row.reciprocal and (factor := float(p[PARAMETER.slice(row.reciprocal)][0])) > 0.0:
                limit = max((1.0 / factor - value) / step, 0.0)  # E is 1 at most (Pacejka 2012, eq. 4.E14)
            is_zero = value == 0.0 and not keys.isdisjoint(stated) and lowest(row.parameter) == 0.0
            least_z = -value / step if row.to_zero else 0.0 if is_zero else -np.inf  # brakes that grip at once
            steps = (step,) * len(at)
            nuisances.append(Nuisance(f"{name}{axle}", at, steps, kind, upper_bound=limit, lower_bound=least_z))
    return nuisances


def _brake_gain_share(p: Floats, tolerance: Mapping[str, float], k: int, axle: str) -> float:
    """Half-width of an axle's brake gain as a share of it: as stated, else of its piston, radius and efficiency."""
    area, radius = (
        float(p[PARAMETER.slice(f"friction_brake_{name}").start + k])
        for name in ("piston_area_m2", "effective_radius_m")
    )
    gain = tolerance.get(f"brake_gain_{axle}")
    if gain is None or not np.isfinite(gain):
        share = np.hypot(
            tolerance.get("friction_brake_piston_area_m2", 0.0) / area,
            tolerance.get("friction_brake_effective_radius_m", 0.0) / radius,
        )
        return float(np.hypot(share, tolerance.get("friction_brake_efficiency", 0.0)))
    brake_gain = 2.0 * p[P.pad_a_1_ks] / p[P.pad_b_1_j]
    brake_gain *= p[P.friction_brake_efficiency] * area * radius
    epsilon = p[P.pad_epsilon_w]
    temperature = p[P.friction_brake_ambient_k] if epsilon >= CONSTANT_EPSILON_W else BRAKE_K
    return float(gain / (brake_gain * temperature / epsilon))


_SIDE = NuisanceKind.SIDE_TO_SIDE
_SIDE_TO_SIDE = (
    ("pressure_offset", "offset_pa"), ("pressure_gain", "gain"), ("iwm_gain", "gain"), ("iwm_gain", "unseen"),
    ("pad_mu_gain", "gain"), ("tyre_radius", "gain"),
)  # fmt: skip
"""Effect and parameter by wheel: zero and gain of a pressure sensor; torque of a motor beside its demand and beside its
measured value; friction of the pads; radius of a wheel. Their prior sd is that from part to part
(docs/decisions/nuisance-parameters.md)."""
INSTRUMENTS = {
    "motor_torque_scale": ("iwm_gain", "unseen", 0.03), "motor_demand_scale": ("iwm_gain", "gain", 0.03),
    "ax_scale": ("imu_gain", "gain", 0.02), "ax_zero_mps2": ("imu_bias", "ax_mps2", 0.05),
    "ground_speed_scale": ("speed_scale", "gain", 0.01), "road_grade": ("road_grade", "grade", 0.005),
    "wind_mps": ("headwind", "wind_mps", 2.0),
}  # fmt: skip
"""Effect, parameter and half-width of what instruments and the road usually differ from what they are taken for, where
a set does not state it: true beside measured, and measured beside demanded torque of all motors (3 %: an estimate by
current), scale and zero of the accelerometer (2 %, 0.05 m/s2 within a run), a satellite receiver's speed, a level
road's slope, a light breeze (Beaufort 2). Sizes: docs/effects.md."""
_STRAIGHT_AHEAD_RAD = 0.01
"""Prior sd of the steering wheel's angle straight ahead: half a degree. Workshop manuals let the sensor's zero be set
within 3 to 5 degrees (Hyundai Motor, Grandeur 2006: within 5, nonlinear by 2.5)."""


def side_to_side_variation(p: Floats, motors: bool) -> list[Nuisance]:
    """Nuisances of a car ``p`` of usual quality: single brakes, motors, tyres and clocks, and its steering wheel.

    ``motors``: the motors' torques are compared with their demands.
    """
    wheels = [
        _in_theta(f"{effect}.{parameter}_{wheel}", effect, parameter, _sd(effect, parameter), _SIDE, k)
        for effect, parameter in _SIDE_TO_SIDE
        if motors or (effect, parameter) != ("iwm_gain", "gain")
        for k, wheel in enumerate(WHEELS)
    ]
    clocks = [
        _in_theta(f"clock_drift.share_{node}", "clock_drift", "share", _sd("clock_drift", "share"), _SIDE, k)
        for k, node in enumerate(NODES)
        if node != "driver"
    ]
    zero = _STRAIGHT_AHEAD_RAD / float(p[P.vehicle_steering_ratio])  # as an angle of the front wheels
    return [*wheels, *clocks, _in_theta("zero_steering", "steer_lateral", "offset_rad", zero)]


def instruments(tolerances: Mapping[str, float], measured: bool, motors: bool) -> list[Nuisance]:
    """Nuisances of what instruments and the road differ from what they are taken for: one for all wheels or motors.

    ``tolerances``: half-widths by key; what is not stated there has a usual one, or none in a set that is ``measured``,
    with every limit stated. ``motors``: the motors' torques are compared with their demands.
    """
    nuisances = []
    for key, (effect, parameter, usual) in INSTRUMENTS.items():
        half_width = tolerances.get(key, 0.0 if measured else usual)
        if half_width and (motors or key != "motor_demand_scale"):
            own = THETA.slice(effect, parameter)
            at = tuple(range(own.start, own.stop))
            step = (HALF_WIDTH_TO_SIGMA * half_width,) * len(at)
            nuisances.append(Nuisance(key, at, step, NuisanceKind.SENSOR))
    return nuisances


def line_lag(half_s: float) -> list[Nuisance]:
    """Lag of the pads behind the pressure sensors with half-width ``half_s``, s; none if that is zero."""
    if not half_s:
        return []
    step = HALF_WIDTH_TO_SIGMA * half_s
    return [_in_theta("line_lag", "pressure_location", "lag_s", step, NuisanceKind.LINE_LAG)]


def _sd(effect: str, parameter: str) -> float:
    """Standard deviation of an effect's parameter from part to part."""
    return THETA.effect(effect).parameter(parameter).part_to_part


def _in_theta(
    name: str, effect: str, parameter: str, step: float, kind: NuisanceKind = NuisanceKind.SENSOR, member: int = 0
) -> Nuisance:
    return Nuisance(name, (THETA.slice(effect, parameter).start + member,), (step,), kind)


ZERO_SD = {name: _sd("imu_bias", name) for name in ("ay_mps2", "yaw_rate_rad_s")}
"""Prior sd of the zeros of an inertial unit: a roll of a tenth of a degree, and 0.03 deg/s."""
DISC_MEASURED_SD_K, DISC_ASSUMED_SD_K = 5.0, 15.0
"""Prior sd of the discs' temperature at the start, K: of a thermocouple, and assumed."""


def recording_nuisances(disc_measured: bool, latencies: Sequence[Latency]) -> list[Nuisance]:
    """Nuisances of the logs: disc temperature, toothed wheels, latencies and sensor zeros.

    ``disc_measured``: all logs have the discs' temperature at the start. ``latencies``: of each of `LATENCY_NODES`.
    """
    late = [
        Nuisance(f"late_{node}", (k,), (step,), NuisanceKind.LATENCY, lower_bound=(one.least_s - one.value_s) / step)
        for k, (node, one) in enumerate(zip(LATENCY_NODES, latencies, strict=True))
        if (step := HALF_WIDTH_TO_SIGMA * one.half_width_s)
    ]
    disc_sd_k = DISC_MEASURED_SD_K if disc_measured else DISC_ASSUMED_SD_K
    return [
        Nuisance("disc_temperature_k", (0,), (disc_sd_k,), NuisanceKind.DISC_TEMPERATURE),
        Nuisance("tooth_lag", (0,), (0.5,), NuisanceKind.TOOTH_LAG),
        Nuisance("tooth_window", (0,), (1.0,), NuisanceKind.TOOTH_WINDOW),
        *late,
        *(_in_theta(f"zero_{name}", "imu_bias", name, sd) for name, sd in ZERO_SD.items()),
    ]


_TWO_DAYS = 2.0**0.5
"""Each of two days is off by itself."""
_OF_THE_DAY = (
    ("headwind", "wind_mps", 1.0), ("headwind", "drag_gain", 0.03), ("road_grade", "grade", 0.0025),
    ("rolling_resistance", "gain", 0.05), ("imu_bias", "ax_mps2", 0.025), ("imu_bias", "ay_mps2", 0.01),
    ("imu_bias", "yaw_rate_rad_s", 0.0005), ("steer_lateral", "offset_rad", 0.0005), ("imu_gain", "gain", 0.004),
    ("speed_scale", "gain", 0.002),
)  # fmt: skip
"""Effect, parameter and standard deviation on one day, of the whole car: wind and slope as in `INSTRUMENTS`, density of
the air (10 K and 10 hPa), rolling resistance (10 K of air: SAE J1263 corrects 0.6 % a kelvin), zeros of the inertial
unit (`INSTRUMENTS`, `ZERO_SD`), steering wheel straight ahead (a tenth of `_STRAIGHT_AHEAD_RAD`), scales
(`_DAY_SHARE`)."""
_DAY_SHARE = 0.4
"""Share of what parts differ by from one to the other (`_SIDE_TO_SIDE`, `INSTRUMENTS`) that one part differs by from
day to day: a tyre of 0.05 % other radius has 1 to 2 kPa more."""
_PHASE_SD_S = 0.003
"""Of the time between a node's sample and its frame, which each start draws anew: cycles of 10 ms, evenly."""


def of_the_day(nuisances: Sequence[Nuisance], p: Floats, disc_measured: bool) -> list[Nuisance]:
    """What differs between the day of reference logs and that of the others, with a car unchanged.

    Load and the road's friction vary within the tolerances of ``nuisances``, the car's own; temperature of the discs,
    wind, slope, air, single wheels, sensors and the phases of their frames as they usually do.
    """
    whole = list(_OF_THE_DAY)
    steps = {one.name: one.step[0] for one in nuisances}
    if mass := steps.get("vehicle_mass_kg"):
        whole.append(("mass_offset", "mass_kg", mass / _TWO_DAYS))
    if grip := steps.get("tyre_lmux"):
        whole.append(("mu_road", "scale", grip / float(p[P.tyre_lmux]) / _TWO_DAYS))
    single = [(*one, _DAY_SHARE * _sd(*one)) for one in _SIDE_TO_SIDE] + [("timestamp_offset", "delay_s", _PHASE_SD_S)]
    rows = [(*row, False) for row in whole] + [(*row, True) for row in single]
    found = []
    for effect, parameter, sd, each in rows:
        own, step = THETA.slice(effect, parameter), _TWO_DAYS * sd
        declared = THETA.effect(effect).parameter(parameter)
        members = [(at,) for at in range(own.start, own.stop)] if each else [tuple(range(own.start, own.stop))]
        found += [
            Nuisance(
                f"{effect}.{parameter}_of_the_day_{k}", at, (step,) * len(at), NuisanceKind.OF_THE_DAY,
                upper_bound=declared.high / step, lower_bound=declared.low / step,
            )
            for k, at in enumerate(members)
        ]  # fmt: skip
    disc_sd_k = _TWO_DAYS * (DISC_MEASURED_SD_K if disc_measured else DISC_ASSUMED_SD_K)
    kind = NuisanceKind.DISC_TEMPERATURE_OF_THE_DAY
    return [*found, Nuisance("disc_temperature_of_the_day", (0,), (disc_sd_k,), kind)]
