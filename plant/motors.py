"""The four motors and the battery between them: demand -> target -> torque, heat, what is available."""

import numpy as np
from numpy.typing import NDArray

from plant.battery import charge_limit
from plant.compiled import equation
from plant.inject import J, inject_wheel
from plant.motor import derating, fade_out, torque_limit, torque_rate, winding_rate
from plant.vectors import C, P, S, U, X, Y

Vector = NDArray[np.float64]


@equation
def _turning(x: Vector, u: Vector, cut: Vector, i: int) -> float:
    """Wheel speed that a motor's limits see."""
    measured, own = float(u[U.wheel_speed_rad_s + i]), float(x[X.wheel_speed_rad_s + i])
    return measured if cut[C.motor_speed + i] > 0.5 else own


@equation
def motors(x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, y: Vector, wheels: int) -> None:
    """Rates of torque and winding temperature; ``y.motor_torque_nm``, what is available, the charge limit announced.

    A quarter of the charge power is promised to each motor; what the battery enforces is the total.
    """
    full = charge_limit(
        x[X.state_of_charge], p[P.battery_charge_power_w], p[P.battery_taper_start_soc], p[P.battery_taper_end_soc]
    )
    y[Y.charge_power_limit_w] = switch[S.battery_announces] * full
    limit = switch[S.battery_accepts] * full
    for i in range(wheels):
        omega = _turning(x, u, cut, i)
        hot = derating(x[X.winding_temperature_k + i], p[P.motor_derating_start_k], p[P.motor_derating_end_k])
        able = torque_limit(omega, p[P.motor_peak_torque_nm], p[P.motor_peak_power_w], p[P.motor_max_speed_rad_s])
        able = max(inject_wheel(able * (switch[S.motor_alive + i] * hot), y, J.motor_available, i), 0.0)
        fade = fade_out(omega * p[P.wheel_rolling_radius_m], p[P.motor_fade_end_mps], p[P.motor_fade_start_mps])
        y[Y.motor_derating + i] = hot
        y[Y.motor_available_nm + i] = min(able * fade, 0.25 * limit / max(abs(omega), 1e-3))
        demand = inject_wheel(u[U.motor_demand_nm + i], y, J.motor_demand, i)
        able *= fade if demand * omega < 0.0 else 1.0
        y[Y.motor_target_nm + i] = min(max(demand, -able), able)

    charging, driving = 0.0, 0.0
    for i in range(4):
        power = y[Y.motor_target_nm + i] * _turning(x, u, cut, i)
        charging += max(-power, 0.0)
        driving += max(power, 0.0)
    charge_share = min(limit / max(charging, 1.0), 1.0)
    drive_share = min(p[P.battery_discharge_power_w] / max(driving, 1.0), 1.0)

    for i in range(wheels):
        target = y[Y.motor_target_nm + i]
        target *= charge_share if target * _turning(x, u, cut, i) < 0.0 else drive_share
        own, measured = x[X.motor_torque_nm + i], u[U.motor_torque_nm + i]
        rate = torque_rate(target, own, p[P.motor_time_constant_s], p[P.motor_rate_limit_nm_s])
        y[Y.motor_target_nm + i] = target
        y[Y.rate + X.motor_torque_nm + i] = rate
        lagging = abs(rate) < p[P.motor_rate_limit_nm_s]
        y[Y.decay_1_s + X.motor_torque_nm + i] = 1.0 / p[P.motor_time_constant_s] if lagging else 0.0
        current = measured if cut[C.motor_torque + i] > 0.5 else own
        y[Y.motor_current_nm + i] = current
        torque = inject_wheel(current, y, J.motor_torque, i)
        y[Y.motor_torque_nm + i] = torque
        y[Y.rate + X.winding_temperature_k + i] = winding_rate(
            x[X.winding_temperature_k + i], p[P.motor_copper_loss_w_nm2] * torque * torque,
            p[P.friction_brake_ambient_k], p[P.motor_winding_resistance_k_w], p[P.motor_winding_time_s],
        )  # fmt: skip
