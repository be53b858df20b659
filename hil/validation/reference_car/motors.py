"""In-wheel motors and battery of the reference car."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

import numpy as np
from numpy.typing import NDArray

from hil.validation.reference_car.car import Car
from hil.validation.reference_car.compiled import equation
from hil.validation.reference_car.strengths import LAW_MOTOR_SPEED, E, S, Y

Vector = NDArray[np.float64]
WARM_K = 350.0


@equation
def motor_target(x: Vector, i: int, demand_nm: float, car: Car, e: Vector) -> float:
    """Torque a motor may aim at, N m: map, heat, and the fading of regeneration at low speed.

    Constant torque, then constant power; linear derating between two winding temperatures; regeneration fades between
    two speeds (Elaphe M700 data sheet, M).
    """
    omega = x[S.omega_rad_s + i]
    power = car.motor_peak_power_w * (1.0 + e[E.iwm_field, i])
    able = min(car.motor_peak_torque_nm, power / max(abs(omega), 1.0))
    span = car.motor_derating_end_k - car.motor_derating_start_k
    able *= min(max((car.motor_derating_end_k - x[S.winding_k + i]) / span, 0.0), 1.0)
    able *= 1.0 - e[E.iwm_derating, i] * min(max((x[S.winding_k + i] - WARM_K) / 40.0, 0.0), 1.0)
    demand_nm *= 1.0 + e[E.iwm_gain, i]
    if demand_nm * omega < 0.0:
        begin, stop = car.motor_fade_start_mps + e[E.regen_fadeout, i], car.motor_fade_end_mps
        rim = abs(omega) * car.rolling_radius_m
        able *= min(max((rim - stop) / (begin - stop), 0.0), 1.0)
    return min(max(demand_nm, -able), able)


@equation
def motors(x: Vector, demand: Vector, car: Car, e: Vector, law: int, dx: Vector, y: Vector) -> None:
    """Rates of reported torque and winding; the true torque at the wheel.

    tau T' = T* - T within a rate limit. The battery takes charge power P up to its limit, all motors alike. The report
    is what the current tells; magnets that grow hot give less: T (1 - k (Tw - 293 K)).
    """
    charging = 0.0
    for i in range(4):
        y[Y.motor_true_nm + i] = motor_target(x, i, demand[i], car, e)
        charging += max(-y[Y.motor_true_nm + i] * x[S.omega_rad_s + i], 0.0)
    soc = x[S.state_of_charge]
    taper = (car.battery_taper_end_soc - soc) / (car.battery_taper_end_soc - car.battery_taper_start_soc)
    limit = car.battery_charge_power_w * (1.0 + e[E.battery_soc, 0]) * min(max(taper, 0.0), 1.0)
    share = min(limit / max(charging, 1.0), 1.0)
    electric = 0.0
    for i in range(4):
        omega = x[S.omega_rad_s + i]
        target = y[Y.motor_true_nm + i]
        if target * omega < 0.0:
            target *= share
        torque = x[S.motor_nm + i]
        rate = (target - torque) / (car.motor_time_constant_s + e[E.motor_tau, i])
        dx[S.motor_nm + i] = min(max(rate, -car.motor_rate_limit_nm_s), car.motor_rate_limit_nm_s)
        loss = car.motor_copper_loss_w_nm2 * torque * torque
        warm = x[S.winding_k + i] - car.ambient_k
        dx[S.winding_k + i] = (car.motor_winding_resistance_k_w * loss - warm) / car.motor_winding_time_s
        true = torque * (1.0 - e[E.current_torque, i] * warm)
        if law == LAW_MOTOR_SPEED:
            true *= 1.0 + e[E.unlisted, i] * ((omega - 60.0) / 40.0) ** 2
        y[Y.motor_true_nm + i] = true
        electric += torque * omega
    dx[S.state_of_charge] = -electric / car.battery_capacity_j
