"""The one right-hand side: all submodels put together.

Cut points, in the order of the way of the brake: demand -> pressure -> friction torque and motor torque -> wheel torque
-> tyre force -> body. A cut lets a measured value enter at a cut point in place of the simulated one.
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from plant.brakes import brakes
from plant.compiled import block, equation
from plant.contact import contacts, static_load
from plant.fastmath import cos, sin
from plant.inject import J, inject_car, inject_wheel
from plant.injection.apply import after, before
from plant.motors import motors
from plant.road import segment_at
from plant.vectors import CUT_PARTS, P, U, X, Y
from plant.vehicle import GRAVITY_MPS2, dynamic_pressure_area

Vector = NDArray[np.float64]


@equation
def road_wheel_angle(u: Vector, p: Vector, y: Vector) -> float:
    """Steering angle of the front wheels, rad."""
    return inject_car(u[U.steering_wheel_rad] / p[P.vehicle_steering_ratio], y, J.steering_angle)


@equation
def over_the_road(
    x: Vector, p: Vector, road: Vector, y: Vector, cos_yaw: float, sin_yaw: float, cos_steer: float, sin_steer: float
) -> None:
    """Velocity of each contact in its wheel's axes and the road's friction under it."""
    for i in range(4):
        axle = 0 if i < 2 else 1
        wheel_x = p[P.vehicle_cog_to_axle_m] if i < 2 else -p[P.vehicle_cog_to_axle_m + 1]
        wheel_y = (0.5 - i % 2) * p[P.vehicle_track_m + axle]
        ground_x = x[X.speed_mps] - x[X.yaw_rate_rad_s] * wheel_y
        ground_y = x[X.lateral_speed_mps] + x[X.yaw_rate_rad_s] * wheel_x
        c, s = (cos_steer, sin_steer) if i < 2 else (1.0, 0.0)
        y[Y.along_mps + i] = inject_wheel(ground_x * c + ground_y * s, y, J.contact_speed, i)
        y[Y.across_mps + i] = ground_y * c - ground_x * s
        row = segment_at(road, x[X.x_m] + wheel_x * cos_yaw - wheel_y * sin_yaw)
        left = x[X.y_m] + wheel_x * sin_yaw + wheel_y * cos_yaw > 0.0
        y[Y.road_friction + i] = inject_wheel(road[row, 1] if left else road[row, 2], y, J.road_friction, i)


@equation
def body(
    x: Vector, p: Vector, y: Vector, cos_grade: float, sin_grade: float, cos_yaw: float, sin_yaw: float,
    cos_steer: float, sin_steer: float,
) -> None:  # fmt: skip
    """Rates of the body and of the inertial measurement unit, from the forces at the wheels.

    Lift and drag are those a wind tunnel tells: drag acts along the road, what it does higher up is in the lift of the
    axles (SAE J1594).
    """
    mass = p[P.vehicle_mass_kg]
    height = p[P.vehicle_cog_height_m]
    speed, lateral, yaw_rate = x[X.speed_mps], x[X.lateral_speed_mps], x[X.yaw_rate_rad_s]
    pitch, roll = x[X.pitch_rad], x[X.roll_rad]
    against_air = inject_car(speed, y, J.air_speed)
    aero = dynamic_pressure_area(against_air, p[P.vehicle_air_density_kg_m3], p[P.vehicle_frontal_area_m2])
    drag = p[P.vehicle_drag_coefficient] * aero
    sum_x, sum_y, sum_yaw, sum_up, sum_pitch, sum_roll = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        axle = 0 if i < 2 else 1
        wheel_x = p[P.vehicle_cog_to_axle_m] if i < 2 else -p[P.vehicle_cog_to_axle_m + 1]
        wheel_y = (0.5 - i % 2) * p[P.vehicle_track_m + axle]
        c, s = (cos_steer, sin_steer) if i < 2 else (1.0, 0.0)
        force, cross = y[Y.longitudinal_force_n + i], y[Y.lateral_force_n + i]
        body_x, body_y = force * c - cross * s, force * s + cross * c
        lift = 0.5 * p[P.vehicle_lift_coefficient + axle] * abs(aero)
        up = y[Y.wheel_load_n + i] - static_load(i, cos_grade, p) + lift
        sum_x += body_x
        sum_y += body_y
        sum_yaw += wheel_x * body_y - wheel_y * body_x
        sum_up += up
        sum_pitch -= wheel_x * up + height * body_x
        sum_roll += wheel_y * up + height * body_y

    sum_pitch += height * drag
    rate = Y.rate
    specific_x, specific_y = inject_car(sum_x - drag, y, J.body_force) / mass, sum_y / mass
    sprung = mass - p[P.vehicle_unsprung_mass_kg] - p[P.vehicle_unsprung_mass_kg + 1]
    y[rate + X.x_m] = speed * cos_yaw - lateral * sin_yaw
    y[rate + X.y_m] = speed * sin_yaw + lateral * cos_yaw
    y[rate + X.yaw_rad] = yaw_rate
    y[rate + X.speed_mps] = specific_x - GRAVITY_MPS2 * sin_grade + yaw_rate * lateral
    y[rate + X.lateral_speed_mps] = specific_y - yaw_rate * speed
    y[rate + X.yaw_rate_rad_s] = sum_yaw / p[P.vehicle_yaw_inertia_kg_m2]
    y[rate + X.heave_m] = x[X.heave_rate_mps]
    y[rate + X.pitch_rad] = x[X.pitch_rate_rad_s]
    y[rate + X.roll_rad] = x[X.roll_rate_rad_s]
    y[rate + X.heave_rate_mps] = sum_up / sprung + GRAVITY_MPS2 * (1.0 - cos_grade)
    y[rate + X.pitch_rate_rad_s] = sum_pitch / p[P.vehicle_pitch_inertia_kg_m2]
    y[rate + X.roll_rate_rad_s] = sum_roll / p[P.vehicle_roll_inertia_kg_m2]
    y[rate + X.distance_m] = sqrt(speed * speed + lateral * lateral)

    up_body = GRAVITY_MPS2 * cos_grade + y[rate + X.heave_rate_mps]
    measured_x = inject_car(specific_x * cos(pitch) - up_body * sin(pitch), y, J.imu_ax)
    measured_y = inject_car(specific_y * cos(roll) + up_body * sin(roll), y, J.imu_ay)
    imu = 2.0 * pi * p[P.sensor_imu_cutoff_hz]
    y[rate + X.imu_longitudinal_mps2] = imu * (measured_x - x[X.imu_longitudinal_mps2])
    y[rate + X.imu_lateral_mps2] = imu * (measured_y - x[X.imu_lateral_mps2])
    y[rate + X.imu_yaw_rate_rad_s] = imu * (inject_car(yaw_rate, y, J.imu_yaw_rate) - x[X.imu_yaw_rate_rad_s])
    y[Y.decay_1_s + X.imu_longitudinal_mps2] = imu
    y[Y.decay_1_s + X.imu_lateral_mps2] = imu
    y[Y.decay_1_s + X.imu_yaw_rate_rad_s] = imu
    y[Y.acceleration_mps2] = y[rate + X.speed_mps]
    y[Y.specific_force_x_mps2] = measured_x
    y[Y.specific_force_y_mps2] = measured_y
    y[Y.drag_n] = drag


@equation
def energy(x: Vector, p: Vector, y: Vector) -> None:
    """Rates of what the battery and the friction brakes have taken up."""
    battery, heat = 0.0, 0.0
    for i in range(4):
        torque, omega = y[Y.motor_torque_nm + i], x[X.wheel_speed_rad_s + i]
        battery += torque * omega + p[P.motor_copper_loss_w_nm2] * torque * torque
        heat -= y[Y.friction_torque_nm + i] * omega
    y[Y.battery_power_w] = battery
    y[Y.rate + X.state_of_charge] = -battery / p[P.battery_capacity_j]
    y[Y.rate + X.recuperated_j] = -battery
    y[Y.rate + X.friction_heat_j] = heat


@equation
def sensed(x: Vector, y: Vector) -> None:
    """What the sensors of the wheels stand at, from the other outputs."""
    for i in range(4):
        y[Y.sensed_wheel_speed_rad_s + i] = inject_wheel(x[X.wheel_speed_rad_s + i], y, J.sensor_wheel_speed, i)
        y[Y.sensed_pressure_pa + i] = inject_wheel(y[Y.pressure_pa + i], y, J.sensor_pressure, i)
        y[Y.sensed_motor_nm + i] = inject_wheel(y[Y.motor_current_nm + i], y, J.sensor_motor_torque, i)


@block
def derivative(x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, y: Vector) -> None:
    """Rates of change of the continuous state, in ``y.rate``, and all outputs but those of `sensed`.

    Parameters
    ----------
    x : state (``STATE``).  u : inputs (``INPUT``), pressure demand already delayed.
    cut : ``CUT``, above 0.5 where a measured value in ``u`` replaces the simulated one.  switch : ``SWITCH``.
    p : as of `plant.injection.apply.Q`.  road : rows of `plant.road.road_table`.  y : ``OUTPUT``, written.
    """
    wheels = cut.size // CUT_PARTS  # 4, but unknown to the compiler: it puts four wheels in one register
    before(x, u, cut, p, y)
    slope = inject_car(road[segment_at(road, x[X.x_m]), 3], y, J.road_grade)
    cos_grade = 1.0 / sqrt(1.0 + slope * slope)
    y[Y.grade] = slope
    yaw, steer = x[X.yaw_rad], road_wheel_angle(u, p, y)
    cos_yaw, sin_yaw, cos_steer, sin_steer = cos(yaw), sin(yaw), cos(steer), sin(steer)
    over_the_road(x, p, road, y, cos_yaw, sin_yaw, cos_steer, sin_steer)
    brakes(x, u, cut, switch, p, y, wheels)
    motors(x, u, cut, switch, p, y, wheels)
    contacts(x, u, cut, p, y, cos_grade, wheels)
    body(x, p, y, cos_grade, slope * cos_grade, cos_yaw, sin_yaw, cos_steer, sin_steer)
    energy(x, p, y)
    after(x, u, p, y)
