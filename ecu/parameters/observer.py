"""How the controller observes: tyre, signal conditioning, joint filter, the paper's observer, compensation."""

from dataclasses import dataclass
from typing import Annotated, Literal


@dataclass(frozen=True, slots=True)
class TyreParameters:
    """The tyre as the observers model it: Burckhardt's c1, c2, c3 for the paper's, stiffness for the joint filter."""

    burckhardt: Annotated[tuple[float, float, float], "1", 0.0, 400.0]
    stiffness_per_load: Annotated[float, "1", 5.0, 100.0]
    stiffness_load_slope_1_n: Annotated[float, "1/N", -0.01, 0.01]
    peak_friction: Annotated[float, "1", 0.1, 2.0]
    cornering_stiffness_per_load: Annotated[float, "1/rad", 5.0, 50.0]
    relaxation_m: Annotated[float, "m", 0.0, 1.0]


@dataclass(frozen=True, slots=True)
class SignalParameters:
    """What is known about the sensors: their lags against the pressure signal, the pitch of the body they sit on."""

    acceleration_lag_s: Annotated[float, "s", 0.0, 0.1]
    wheel_speed_lag_s: Annotated[float, "s", 0.0, 0.1]
    teeth: Annotated[float, "1", 4.0, 1000.0]
    pitch_frequency_hz: Annotated[float, "Hz", 0.3, 5.0]
    pitch_damping: Annotated[float, "1", 0.05, 2.0]
    pressure_zero_time_s: Annotated[float, "s", 0.05, 10.0]
    pressure_zero_limit_pa: Annotated[float, "Pa", 0.0, 1e6]
    friction_speed_min_mps: Annotated[float, "m/s", 0.5, 10.0]
    sliding_slip: Annotated[float, "1", 0.02, 0.5]


@dataclass(frozen=True, slots=True)
class JointFilterParameters:
    """Standard deviations of the joint filter: of the start values, of the drift in one second, of the measurements."""

    start_bias_mps2: Annotated[float, "m/s2", 1e-4, 2.0]
    start_grade: Annotated[float, "1", 1e-5, 0.5]
    start_mass: Annotated[float, "1", 1e-5, 0.5]
    start_stiffness: Annotated[float, "1", 1e-5, 1.0]
    start_stiffness_axle: Annotated[float, "1", 1e-5, 1.0]
    start_radius: Annotated[float, "1", 1e-6, 0.1]
    start_friction: Annotated[tuple[float, float, float], "1", 1e-5, 0.5]
    drift_bias_mps2: Annotated[float, "m/s2", 0.0, 1.0]
    drift_grade: Annotated[float, "1", 0.0, 0.5]
    drift_stiffness: Annotated[float, "1", 0.0, 1.0]
    drift_friction: Annotated[tuple[float, float, float], "1", 0.0, 0.5]
    drift_friction_released: Annotated[float, "1", 0.0, 0.5]
    acceleration_mps2: Annotated[float, "m/s2", 1e-3, 2.0]
    alignment_s: Annotated[float, "s", 0.0, 0.1]
    wheel_speed: Annotated[float, "1", 1e-5, 0.1]
    gate: Annotated[float, "1", 1.0, 20.0]


@dataclass(frozen=True, slots=True)
class PaperObserverParameters:
    """The paper's linear Kalman filter, its correction factor K and its friction estimation."""

    drift_acceleration_rad_s2: Annotated[float, "rad/s2", 1e-3, 1e4]
    drift_force_n: Annotated[float, "N", 1e-3, 1e6]
    drift_torque_nm: Annotated[float, "Nm", 1e-3, 1e6]
    wheel_speed_rad_s: Annotated[float, "rad/s", 1e-4, 10.0]
    force_n: Annotated[float, "N", 1e-2, 1e5]
    k_window: Annotated[int, "1", 1, 100]
    k_limit: Annotated[float, "1", 1.0, 100.0]
    force_min_n: Annotated[float, "N", 0.0, 1e4]
    friction_window: Annotated[int, "1", 1, 100]
    pressure_delay_s: Annotated[float, "s", 0.0, 0.2]
    speed_min_mps: Annotated[float, "m/s", 0.5, 10.0]
    pressure_min_pa: Annotated[float, "Pa", 0.0, 1e6]


@dataclass(frozen=True, slots=True)
class CompensationParameters:
    """Which observer is believed, and how far its pad friction may move the pressure demand."""

    method: Literal["joint", "paper"]
    road_correction: bool
    enabled: bool
    friction_lowest: Annotated[float, "1", 0.01, 1.0]
    friction_highest: Annotated[float, "1", 0.01, 1.5]
    authority: Annotated[float, "1", 0.0, 0.9]
    rate_1_s: Annotated[float, "1/s", 0.0, 10.0]
    confidence_full: Annotated[float, "1", 1e-3, 1.0]
    motor_preference: Annotated[float, "1", 0.0, 10.0]
    motor_preference_from: Annotated[float, "1", 0.0, 1.0]
