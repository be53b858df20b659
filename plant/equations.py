# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)
"""The one right-hand side: all submodels put together.

The joints, in the order of the way of the brake: demand -> pressure -> friction torque and motor torque -> wheel torque
-> tyre force -> body. A cut lets a measured value enter at a joint in place of the simulated one.
"""

from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from plant.battery import charge_limit
from plant.brake_thermal import disc_temperature_rate
from plant.compiled import equation
from plant.contact import tyre_contact
from plant.friction import mu_rate, temperature_rate
from plant.hydraulics import pad_force, pressure_jerk, windup_held, windup_limit
from plant.motor import derating, fade_out, torque_limit, torque_rate, winding_rate
from plant.road import segment_at
from plant.suspension import link_force, spring_force
from plant.vectors import C, P, S, U, X, Y
from plant.vehicle import GRAVITY_MPS2, dynamic_pressure_area, rolling_resistance

Vector = NDArray[np.float64]


@equation
def motor_targets(x: Vector, u: Vector, switch: Vector, p: Vector, y: Vector) -> None:
    """Write the torques the inverters aim at into ``y.motor_torque_nm``, and what is available to brake.

    A quarter of the charge power is promised to each motor; what the battery enforces is the total.
    """
    limit = switch[S.battery_accepts] * charge_limit(
        x[X.state_of_charge], p[P.battery_charge_power_w], p[P.battery_taper_start_soc], p[P.battery_taper_end_soc]
    )
    y[Y.charge_power_limit_w] = limit
    charging = 0.0
    driving = 0.0
    for i in range(4):
        speed = x[X.wheel_speed_rad_s + i]
        hot = derating(x[X.winding_temperature_k + i], p[P.motor_derating_start_k], p[P.motor_derating_end_k])
        able = switch[S.motor_alive + i] * hot
        able *= torque_limit(speed, p[P.motor_peak_torque_nm], p[P.motor_peak_power_w], p[P.motor_max_speed_rad_s])
        fade = fade_out(speed * p[P.wheel_rolling_radius_m], p[P.motor_fade_end_mps], p[P.motor_fade_start_mps])
        y[Y.motor_derating + i] = hot
        y[Y.motor_available_nm + i] = min(able * fade, 0.25 * limit / max(abs(speed), 1e-3))
        demand = u[U.motor_demand_nm + i]
        if demand * speed < 0.0:
            able *= fade
        demand = min(max(demand, -able), able)
        charging += max(-demand * speed, 0.0)
        driving += max(demand * speed, 0.0)
        y[Y.motor_torque_nm + i] = demand
    for i in range(4):
        if y[Y.motor_torque_nm + i] * x[X.wheel_speed_rad_s + i] < 0.0:
            if charging > limit:
                y[Y.motor_torque_nm + i] *= limit / charging
        elif driving > p[P.battery_discharge_power_w]:
            y[Y.motor_torque_nm + i] *= p[P.battery_discharge_power_w] / driving


@equation
def friction_corner(
    i: int, axle: int, x: Vector, u: Vector, cut: Vector, p: Vector, dx: Vector, decay: Vector, y: Vector
) -> float:
    """Hydraulics, pad and disc of one wheel; returns the friction torque, N m."""
    omega = x[X.wheel_speed_rad_s + i]
    rate = x[X.pressure_rate_pa_s + i]
    dx[X.pressure_pa + i] = min(max(rate, -p[P.ehb_release_rate_pa_s]), p[P.ehb_build_rate_pa_s])
    dx[X.pressure_rate_pa_s + i] = pressure_jerk(
        min(max(u[U.pressure_demand_pa + i], 0.0), p[P.ehb_max_pressure_pa]), x[X.pressure_pa + i], rate,
        p[P.ehb_natural_frequency_hz], p[P.ehb_damping_ratio], p[P.ehb_build_rate_pa_s], p[P.ehb_release_rate_pa_s],
    )  # fmt: skip
    pressure = u[U.pressure_pa + i] if cut[C.pressure + i] > 0.5 else x[X.pressure_pa + i]
    y[Y.pressure_pa + i] = pressure

    force = pad_force(
        pressure, p[P.friction_brake_piston_area_m2 + axle], p[P.friction_brake_threshold_pressure_pa],
        p[P.friction_brake_efficiency],
    )  # fmt: skip
    mu = x[X.pad_friction + i]
    radius = p[P.friction_brake_effective_radius_m + axle]
    stiffness = p[P.wheel_brake_windup_nm_rad]
    windup_s = p[P.wheel_brake_windup_time_s]
    limit = windup_limit(mu, force, radius, stiffness)
    held = windup_held(x[X.windup_rad + i], omega, windup_s, limit)
    dx[X.windup_rad + i] = (held - x[X.windup_rad + i]) / windup_s
    if -limit < held < limit:
        decay[X.wheel_speed_rad_s + i] = stiffness * windup_s / p[P.wheel_inertia_kg_m2]
    else:
        decay[X.windup_rad + i] = 1.0 / windup_s
    torque = -stiffness * held
    y[Y.friction_torque_nm + i] = torque

    power = force * radius * abs(omega)
    of_disc = p[P.pad_temperature_of_disc]
    temperature = of_disc * x[X.disc_temperature_k + i] + (1.0 - of_disc) * x[X.pad_temperature_k + i]
    dx[X.pad_friction + i] = mu_rate(mu, power, temperature, p[P.pad_a_1_ks], p[P.pad_b_1_j], p[P.pad_epsilon_w])
    decay[X.pad_friction + i] = p[P.pad_b_1_j] * (power + p[P.pad_epsilon_w])
    heating = power * (1.0 + p[P.pad_heating_with_mu] * (mu - 1.0))
    ambient = p[P.friction_brake_ambient_k]
    dx[X.pad_temperature_k + i] = temperature_rate(
        x[X.pad_temperature_k + i], heating, ambient, p[P.pad_c_1_s], p[P.pad_gamma_k_w + axle]
    )
    dx[X.disc_temperature_k + i] = disc_temperature_rate(
        x[X.disc_temperature_k + i], -torque * omega, abs(x[X.speed_mps]), ambient,
        p[P.friction_brake_heat_capacity_j_k + axle], p[P.friction_brake_cooling_w_k + axle],
        p[P.friction_brake_cooling_speed_ws_m_k + axle],
    )  # fmt: skip
    return torque


@equation
def motor_corner(i: int, x: Vector, u: Vector, cut: Vector, p: Vector, dx: Vector, decay: Vector, y: Vector) -> float:
    """Motor of one wheel, its target already in the outputs; returns the motor torque, N m."""
    own = x[X.motor_torque_nm + i]
    rate = torque_rate(y[Y.motor_torque_nm + i], own, p[P.motor_time_constant_s], p[P.motor_rate_limit_nm_s])
    dx[X.motor_torque_nm + i] = rate
    if abs(rate) < p[P.motor_rate_limit_nm_s]:
        decay[X.motor_torque_nm + i] = 1.0 / p[P.motor_time_constant_s]
    torque = u[U.motor_torque_nm + i] if cut[C.motor_torque + i] > 0.5 else own
    dx[X.winding_temperature_k + i] = winding_rate(
        x[X.winding_temperature_k + i], p[P.motor_copper_loss_w_nm2] * torque * torque, p[P.friction_brake_ambient_k],
        p[P.motor_winding_resistance_k_w], p[P.motor_winding_time_s],
    )  # fmt: skip
    y[Y.motor_torque_nm + i] = torque
    return torque


@equation
def wheel_load(i: int, axle: int, torque: float, cos_grade: float, x: Vector, p: Vector) -> float:
    """Vertical load of one wheel, N: static share, unsprung weight, spring and links."""
    front = 1.0 if axle == 0 else -1.0
    wheel_x = front * p[P.vehicle_cog_to_axle_m + axle]
    wheel_y = (0.5 if i % 2 == 0 else -0.5) * p[P.vehicle_track_m + axle]
    share = p[P.vehicle_cog_to_axle_m + 1 - axle] / (p[P.vehicle_cog_to_axle_m] + p[P.vehicle_cog_to_axle_m + 1])
    drop = wheel_x * x[X.pitch_rad] - wheel_y * x[X.roll_rad] - x[X.heave_m]
    drop_rate = wheel_x * x[X.pitch_rate_rad_s] - wheel_y * x[X.roll_rate_rad_s] - x[X.heave_rate_mps]
    spring = spring_force(
        drop, drop_rate, x[X.roll_rad], wheel_y, p[P.suspension_ride_rate_n_m + axle],
        p[P.suspension_progression_n_m3 + axle], p[P.suspension_damping_ns_m + axle],
        p[P.suspension_anti_roll_nm_rad + axle],
    )  # fmt: skip
    links = link_force(
        torque / p[P.wheel_rolling_radius_m], p[P.vehicle_mass_kg] * share * x[X.speed_mps] * x[X.yaw_rate_rad_s],
        front, wheel_y, p[P.suspension_brake_support_tangent + axle], p[P.suspension_roll_centre_height_m + axle],
    )  # fmt: skip
    unsprung = 0.5 * p[P.vehicle_unsprung_mass_kg + axle]
    sprung = 0.5 * p[P.vehicle_mass_kg] * share - unsprung
    return max((sprung + unsprung * cos_grade) * GRAVITY_MPS2 + spring + links, 0.0)


@equation
def derivative(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, dx: Vector, decay: Vector,
    gain: Vector, y: Vector,
) -> None:  # fmt: skip
    """Rates of change of the continuous state, and the outputs.

    Parameters
    ----------
    x : state (``STATE``).  u : inputs (``INPUT``), pressure demand already delayed.
    cut : ``CUT``, above 0.5 where a measured value in ``u`` replaces the simulated one.  switch : ``SWITCH``.
    p : ``PARAMETER``.  road : rows of `plant.road.road_table`.
    dx : rates (``RATES``), written.  decay : each state's own decay rate, 1/s, written, for the semi-implicit step.
    gain : 1 / relaxation length of each wheel, 1/m, written.  y : outputs (``OUTPUT``), written.
    """
    decay[:] = 0.0
    mass = p[P.vehicle_mass_kg]
    radius = p[P.wheel_rolling_radius_m]
    speed, lateral, yaw_rate = x[X.speed_mps], x[X.lateral_speed_mps], x[X.yaw_rate_rad_s]
    pitch, roll = x[X.pitch_rad], x[X.roll_rad]
    cos_yaw, sin_yaw = cos(x[X.yaw_rad]), sin(x[X.yaw_rad])
    steer = u[U.steering_wheel_rad] / p[P.vehicle_steering_ratio]
    slope = road[segment_at(road, x[X.x_m]), 3]
    cos_grade = 1.0 / sqrt(1.0 + slope * slope)
    sin_grade = slope * cos_grade

    motor_targets(x, u, switch, p, y)
    aero = dynamic_pressure_area(speed, p[P.vehicle_air_density_kg_m3], p[P.vehicle_frontal_area_m2])
    drag = p[P.vehicle_drag_coefficient] * aero
    sum_x, sum_y, sum_yaw, sum_up, sum_pitch, sum_roll = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    battery_w, heat_w = 0.0, 0.0
    for i in range(4):
        axle = 0 if i < 2 else 1
        wheel_x = p[P.vehicle_cog_to_axle_m] if axle == 0 else -p[P.vehicle_cog_to_axle_m + 1]
        wheel_y = (0.5 if i % 2 == 0 else -0.5) * p[P.vehicle_track_m + axle]
        cos_steer, sin_steer = (cos(steer), sin(steer)) if axle == 0 else (1.0, 0.0)
        omega = x[X.wheel_speed_rad_s + i]

        friction_torque = friction_corner(i, axle, x, u, cut, p, dx, decay, y)
        motor_torque = motor_corner(i, x, u, cut, p, dx, decay, y)
        torque = u[U.wheel_torque_nm + i] if cut[C.wheel_torque + i] > 0.5 else friction_torque + motor_torque
        y[Y.wheel_torque_nm + i] = torque
        heat_w -= friction_torque * omega
        battery_w += motor_torque * omega + p[P.motor_copper_loss_w_nm2] * motor_torque * motor_torque

        load = wheel_load(i, axle, torque, cos_grade, x, p)
        ground_x, ground_y = speed - yaw_rate * wheel_y, lateral + yaw_rate * wheel_x
        along = ground_x * cos_steer + ground_y * sin_steer
        across = ground_y * cos_steer - ground_x * sin_steer
        side = x[X.y_m] + wheel_x * sin_yaw + wheel_y * cos_yaw
        row = segment_at(road, x[X.x_m] + wheel_x * cos_yaw - wheel_y * sin_yaw)
        mu_road = road[row, 1] if side > 0.0 else road[row, 2]
        force, cross = tyre_contact(i, along, across, load, mu_road, x, p, dx, decay, gain, y)
        if cut[C.force + i] > 0.5:
            force = u[U.longitudinal_force_n + i]
        y[Y.wheel_load_n + i] = load
        y[Y.road_friction + i] = mu_road
        y[Y.longitudinal_force_n + i] = force
        y[Y.lateral_force_n + i] = cross

        rolling = load * radius * rolling_resistance(
            omega * radius, p[P.vehicle_rolling_resistance], p[P.vehicle_rolling_resistance_speed_s2_m2]
        )  # fmt: skip
        y[Y.rolling_torque_nm + i] = rolling
        dx[X.wheel_speed_rad_s + i] = (torque - radius * force - rolling) / p[P.wheel_inertia_kg_m2]
        dx[X.wheel_angle_rad + i] = omega

        body_x, body_y = force * cos_steer - cross * sin_steer, force * sin_steer + cross * cos_steer
        lift = 0.5 * p[P.vehicle_lift_coefficient + axle] * abs(aero)
        up = load - 0.5 * p[P.vehicle_unsprung_mass_kg + axle] * GRAVITY_MPS2 * cos_grade + lift
        sum_x += body_x
        sum_y += body_y
        sum_yaw += wheel_x * body_y - wheel_y * body_x
        sum_up += up
        sum_pitch -= wheel_x * up + p[P.vehicle_cog_height_m] * body_x
        sum_roll += wheel_y * up + p[P.vehicle_cog_height_m] * body_y

    specific_x, specific_y = (sum_x - drag) / mass, sum_y / mass
    sprung_kg = mass - p[P.vehicle_unsprung_mass_kg] - p[P.vehicle_unsprung_mass_kg + 1]
    dx[X.x_m] = speed * cos_yaw - lateral * sin_yaw
    dx[X.y_m] = speed * sin_yaw + lateral * cos_yaw
    dx[X.yaw_rad] = yaw_rate
    dx[X.speed_mps] = specific_x - GRAVITY_MPS2 * sin_grade + yaw_rate * lateral
    dx[X.lateral_speed_mps] = specific_y - yaw_rate * speed
    dx[X.yaw_rate_rad_s] = sum_yaw / p[P.vehicle_yaw_inertia_kg_m2]
    dx[X.heave_m], dx[X.pitch_rad], dx[X.roll_rad] = x[X.heave_rate_mps], x[X.pitch_rate_rad_s], x[X.roll_rate_rad_s]
    dx[X.heave_rate_mps] = sum_up / sprung_kg - GRAVITY_MPS2 * cos_grade
    dx[X.pitch_rate_rad_s] = sum_pitch / p[P.vehicle_pitch_inertia_kg_m2]
    dx[X.roll_rate_rad_s] = sum_roll / p[P.vehicle_roll_inertia_kg_m2]
    dx[X.state_of_charge] = -battery_w / p[P.battery_capacity_j]
    dx[X.recuperated_j] = -battery_w
    dx[X.friction_heat_j] = heat_w
    dx[X.distance_m] = sqrt(speed * speed + lateral * lateral)

    up_body = GRAVITY_MPS2 * cos_grade + dx[X.heave_rate_mps]
    measured_x = specific_x * cos(pitch) - up_body * sin(pitch)
    measured_y = specific_y * cos(roll) + up_body * sin(roll)
    imu_rate = 2.0 * pi * p[P.sensor_imu_cutoff_hz]
    dx[X.imu_longitudinal_mps2] = imu_rate * (measured_x - x[X.imu_longitudinal_mps2])
    dx[X.imu_lateral_mps2] = imu_rate * (measured_y - x[X.imu_lateral_mps2])
    dx[X.imu_yaw_rate_rad_s] = imu_rate * (yaw_rate - x[X.imu_yaw_rate_rad_s])
    decay[X.imu_longitudinal_mps2] = imu_rate
    decay[X.imu_lateral_mps2] = imu_rate
    decay[X.imu_yaw_rate_rad_s] = imu_rate
    y[Y.acceleration_mps2] = dx[X.speed_mps]
    y[Y.specific_force_x_mps2] = measured_x
    y[Y.specific_force_y_mps2] = measured_y
    y[Y.battery_power_w] = battery_w
    y[Y.drag_n] = drag
    y[Y.grade] = slope
