"""What can be hidden: rows A to E of the effect catalogue, laws in no list, and their sizes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.errors import BrakebenchError
from hil.validation.reference_car import strengths
from hil.validation.reference_car.sensors import NODES
from hil.validation.reference_car.strengths import E

WHEELS = {
    "car": (0, 1, 2, 3), "front": (0, 1), "rear": (2, 3), "left": (0, 2), "right": (1, 3),
    "fl": (0,), "fr": (1,), "rl": (2,), "rr": (3,),
}  # fmt: skip
"""Words for wheels, with their columns of the strength table."""
CAR, AXLE, WHEEL, NODE = ("car",), ("front", "rear"), ("fl", "fr", "rl", "rr"), NODES


@dataclass(frozen=True)
class Hideable:
    """One thing that can be hidden.

    Attributes
    ----------
    name : field name of the effect catalogue; laws in no list begin with ``unlisted_``.
    parameter, unit, typical : what ``--magnitude`` means and a usual size.
    low, high : physical bounds.  where : words for the wheels or nodes it may act on.
    law : number of a law in no list, else 0.  joint, variables : of such a law.
    shows : whether the full manoeuvre set excites it.
    scales : whether its signature is a function of time at all (jitter, lost frames and steps of a converter are not).
    """

    name: str
    parameter: str
    unit: str
    typical: float
    low: float
    high: float
    where: tuple[str, ...] = CAR
    law: int = 0
    joint: str = ""
    variables: tuple[str, ...] = ()
    shows: bool = True
    scales: bool = True

    @property
    def senses(self) -> bool:
        """Whether it acts on sensors, clocks or the bus, not on the car."""
        return self.law == 0 and not hasattr(E, self.name)

    def strength(self, magnitude: float, wheel: str) -> NDArray[np.float64]:
        """Row of the strength table, (4,)."""
        row = np.zeros(4)
        columns = (NODES.index(wheel),) if wheel in NODES else WHEELS[wheel]
        if self.name == "split_mu":
            columns = WHEELS["right"]
        row[list(columns)] = magnitude
        return row


LISTED: tuple[Hideable, ...] = (
    Hideable("road_grade", "grade", "", 0.01, -0.1, 0.1),
    Hideable("mass_offset", "mass_kg", "kg", 150.0, -250.0, 600.0),
    Hideable("rotating_inertia", "inertia_kg_m2", "kg m2", 0.5, -0.7, 2.0),
    Hideable("headwind", "wind_mps", "m/s", 5.0, -15.0, 15.0),
    Hideable("rolling_resistance", "gain", "", 0.4, -0.6, 1.5, (*CAR, *AXLE)),
    Hideable("aero_lift", "coefficient", "", 0.15, -0.4, 0.4, AXLE),
    Hideable("cog_height", "height_m", "m", 0.1, -0.2, 0.4),
    Hideable("pitch_dive", "softness", "", 0.3, -0.4, 1.0),
    Hideable("sus_compliance", "compliance_m_n", "m/N", 5e-7, 0.0, 2e-6, AXLE),
    Hideable("steer_lateral", "offset_rad", "rad", 0.005, -0.01, 0.01),
    Hideable("road_roughness", "height_m", "m", 0.001, 0.0, 0.004, scales=False),
    Hideable("split_mu", "right", "", -0.5, -0.8, 0.2),
    Hideable("tyre_radius", "gain", "", -0.008, -0.05, 0.05, WHEEL),
    Hideable("tyre_pressure_loss", "share", "", 0.3, 0.0, 0.7, WHEEL),
    Hideable("tyre_relaxation", "gain", "", 1.0, -0.7, 2.0),
    Hideable("slip_stiffness", "gain", "", -0.25, -0.5, 0.6, (*CAR, *AXLE)),
    Hideable("mu_road", "scale", "", -0.3, -0.7, 0.3),
    Hideable("aquaplaning", "film_m", "m", 0.0005, 0.0, 0.002),
    Hideable("tyre_temperature", "stiffness_1_k", "1/K", -0.01, -0.03, 0.01),
    Hideable("load_sensitivity", "per_load", "", -0.16, -0.4, 0.4),
    Hideable("pad_mu_gain", "gain", "", -0.1, -0.6, 0.6, (*AXLE, *WHEEL)),
    Hideable("pad_temp_fade", "fade_1_k", "1/K", 0.0015, 0.0, 0.004, (*CAR, *AXLE)),
    Hideable("mu_nv_dynamics", "rate", "", 1.0, -0.7, 3.0),
    Hideable("mu_warmup", "cold_loss", "", 0.15, -0.3, 0.5, (*CAR, *AXLE)),
    Hideable("mu_speed", "slope_s_m", "s/m", -0.004, -0.01, 0.01, (*CAR, *AXLE)),
    Hideable("mu_pressure", "exponent", "", 0.08, -0.2, 0.3, (*CAR, *AXLE)),
    Hideable("pressure_hysteresis", "half_width_pa", "Pa", 1.0e5, 0.0, 4.0e5, (*CAR, *AXLE, *WHEEL)),
    Hideable("threshold", "pressure_pa", "Pa", 8.0e4, -4.0e4, 4.0e5, (*CAR, *AXLE, *WHEEL)),
    Hideable("residual_drag", "torque_nm", "N m", 8.0, 0.0, 40.0, (*AXLE, *WHEEL)),
    Hideable("stuck_corner", "loss", "", 0.4, 0.0, 1.0, WHEEL),
    Hideable("air_in_line", "volume_m3", "m3", 2e-6, 0.0, 6e-6, (*AXLE, *WHEEL)),
    Hideable("fluid_temp", "slowness", "", 0.6, 0.0, 3.0),
    Hideable("bedding", "deficit", "", 0.15, -0.3, 0.4, (*CAR, *AXLE)),
    Hideable("glazing", "drift_1_mj", "1/MJ", 0.2, -0.3, 1.0, (*AXLE, *WHEEL)),
    Hideable("water", "wet", "", 0.3, -0.5, 0.7, (*CAR, *AXLE)),
    Hideable("dtv_judder", "amplitude", "", 0.05, -0.3, 0.3, WHEEL),
    Hideable("hot_spot", "amplitude", "", 0.1, -0.3, 0.3, AXLE),
    Hideable("thermal_growth", "growth_pa_k", "Pa/K", 400.0, 0.0, 2000.0, AXLE),
    Hideable("ehb_dead_time", "time_s", "s", 0.015, -0.015, 0.08),
    Hideable("ehb_bandwidth", "frequency", "", -0.3, -0.7, 1.5),
    Hideable("ehb_rate_limit", "gain", "", -0.5, -0.9, 1.0),
    Hideable("ehb_deadband", "band_pa", "Pa", 8.0e4, 0.0, 4.0e5),
    Hideable("accumulator", "droop", "", 0.3, 0.0, 0.8),
    Hideable("valve_leak", "leak_1_s", "1/s", 1.5, 0.0, 8.0, WHEEL),
    Hideable("iwm_gain", "gain", "", -0.05, -0.3, 0.3, (*CAR, *AXLE, *WHEEL)),
    Hideable("iwm_derating", "loss", "", 0.4, 0.0, 1.0, shows=False),
    Hideable("iwm_field", "power", "", -0.6, -0.9, 0.5),
    Hideable("battery_soc", "power", "", -0.4, -0.95, 1.0),
    Hideable("regen_fadeout", "speed_mps", "m/s", 2.0, -1.8, 5.0),
    Hideable("motor_tau", "time_s", "s", 0.01, -0.004, 0.06),
    Hideable("pressure_location", "lag_s", "s", 0.012, 0.0, 0.06),
    Hideable("current_torque", "loss_1_k", "1/K", 0.001, -0.001, 0.004),
    Hideable("imu_bias", "bias_mps2", "m/s2", 0.05, -1.0, 1.0),
    Hideable("imu_gain", "gain", "", 0.03, -0.2, 0.2),
    Hideable("imu_position", "distance_m", "m", 0.5, -2.0, 2.0),
    Hideable("imu_filter", "lag_s", "s", 0.01, 0.0, 0.1),
    Hideable("wheel_tooth_error", "amplitude", "", 0.003, -0.03, 0.03, WHEEL),
    Hideable("wheel_speed_lowv", "speed_mps", "m/s", 2.5, 0.0, 4.0, scales=False),
    Hideable("pressure_offset", "offset_pa", "Pa", 1.0e5, -5.0e5, 5.0e5, (*CAR, *WHEEL)),
    Hideable("pressure_gain", "gain", "", 0.03, -0.2, 0.2, (*CAR, *WHEEL)),
    Hideable("quantisation", "step_mps2", "m/s2", 0.1, 0.0, 0.5, scales=False),
    Hideable("timestamp_offset", "time_s", "s", 0.02, -0.05, 0.1, NODE),
    Hideable("clock_drift", "rate", "", 1e-3, -0.02, 0.02, ("imu", "pressure", "motor")),
    Hideable("jitter", "time_s", "s", 0.01, 0.0, 0.05, ("imu", "pressure", "motor"), scales=False),
    Hideable("frame_drop", "share", "", 0.05, 0.0, 0.5, NODE, scales=False),
    Hideable("wrong_scale", "gain", "", 0.05, -2.5, 3.0, NODE),
)  # fmt: skip
"""Effects with a row in the catalogue."""

UNLISTED: tuple[Hideable, ...] = (
    Hideable("unlisted_cubic_mu", "strength", "", 0.1, -0.8, 0.8, WHEEL,
             strengths.LAW_CUBIC_MU, "friction.mu", ("speed",)),
    Hideable("unlisted_step_drag", "force_n", "N", 120.0, -400.0, 800.0, CAR,
             strengths.LAW_STEP_DRAG, "body.force", ("speed",)),
    Hideable("unlisted_bump_pressure", "strength", "", 0.15, -0.7, 1.0, (*AXLE, *WHEEL),
             strengths.LAW_BUMP_PRESSURE, "friction.mu", ("pressure",)),
    Hideable("unlisted_wave_rolling", "strength", "", 0.01, -0.01, 0.05, CAR,
             strengths.LAW_WAVE_ROLLING, "wheel.rolling_torque", ("speed",)),
    Hideable("unlisted_motor_speed", "strength", "", 0.05, -0.3, 0.4, (*CAR, *AXLE),
             strengths.LAW_MOTOR_SPEED, "motor.torque", ("speed",)),
    Hideable("unlisted_apply_time", "strength", "", 0.1, -0.7, 1.0, (*CAR, *AXLE),
             strengths.LAW_APPLY_TIME, "friction.mu", ("time_since_on",)),
    Hideable("unlisted_steer_drag", "force_n", "N", 800.0, -3000.0, 6000.0, CAR,
             strengths.LAW_STEER_DRAG, "body.force", ("steer",)),
)  # fmt: skip
"""Laws that are in no list."""

TWINS: tuple[tuple[str, str], ...] = (
    ("road_grade", "imu_bias"), ("pressure_offset", "pad_mu_gain"), ("tyre_radius", "speed_scale"),
)  # fmt: skip
"""Physical effect and the sensor effect it is taken for."""

NOT_DRAWN = (
    Hideable("speed_scale", "gain", "", 0.01, -0.1, 0.1),
    Hideable("caliper_asymmetry", "gain", "", 0.06, -0.3, 0.3, WHEEL),
)
"""Effects that no family draws but as a twin: the scale of the speed over ground; what a pad does unlike in reverse,
which is weak pads by another name wherever a car drives forward."""

HIDEABLE = {effect.name: effect for effect in (*LISTED, *UNLISTED, *NOT_DRAWN)}


def find(name: str) -> Hideable:
    """What is hidden by that name.

    Raises
    ------
    BrakebenchError
        Nothing is called so.
    """
    if name not in HIDEABLE:
        raise BrakebenchError(
            f"--effect {name}: nothing of that name can be hidden; expected none or {', '.join(HIDEABLE)}"
        )
    return HIDEABLE[name]
