"""Motion of the reference car: two tracks, load transfer with pitch, relaxed tyres, drag, road."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from math import atan, atan2, cos, exp, sin, sqrt, tanh

import numpy as np
from numpy.typing import NDArray

from hil.validation.reference_car.brake import brake_pressure_rates, friction_brake
from hil.validation.reference_car.car import GRAVITY_MPS2, Car
from hil.validation.reference_car.compiled import equation
from hil.validation.reference_car.motors import motors
from hil.validation.reference_car.strengths import LAW_STEER_DRAG, LAW_STEP_DRAG, LAW_WAVE_ROLLING, E, S, Y

Vector = NDArray[np.float64]
NOMINAL_LOAD_N, RELAXATION_LOAD_N = 4000.0, 3590.0
SHAPE_X, SHAPE_Y, SIDE_FRICTION = 1.64, 1.35, 0.9
FILM_S2_M3 = 0.33
SHORTEST_S = 1.25e-3  # a tyre about to lift follows no faster: half a step
LINKS = 0.4  # share of the load transfer that the links pass at once, past the springs
HUB_HZ, HUB_DAMPING = 15.0, 0.1
TYRE_HEAT_J_K, TYRE_COOLING_W_K = 9000.0, 30.0
LOW_SPEED_MPS, LOW_SPEED_DAMPING_NS_M = 3.0, 3000.0


@equation
def road_height(s: float) -> float:
    """Height of a rough road over the distance for an amplitude of 1 m, m: six waves of 2 to 31 m."""
    height = 0.0
    for k in range(6):
        wave = 2.0 * 1.73**k
        height += sqrt(wave / 31.0) * sin(6.283185307 * s / wave + 1.7 * k * k)
    return height


@equation
def wheel_load(x: Vector, i: int, mass: float, car: Car, e: Vector) -> float:
    """Load of one wheel, N: static share, transfer by springs, dampers and links, lateral transfer, lift, rough road.

    Links pass a share of what the tyres' forces move; of drag, which acts along the road, nothing.

    Mitschke/Wallentowitz, Dynamik der Kraftfahrzeuge: m h a / L between the axles, m h a / t across.
    """
    front = i < 2
    rear_m = car.wheelbase_m - car.cog_to_front_axle_m
    share = (rear_m if front else car.cog_to_front_axle_m) / car.wheelbase_m
    side = 1.0 - 2.0 * (i % 2)
    height = car.cog_height_m + e[E.cog_height, 0]
    softer = 1.0 + e[E.pitch_dive, 0]
    damper_s = softer * car.pitch_damping / (3.141592654 * car.pitch_frequency_hz)
    sprung = -(x[S.pitch_rad] + damper_s * x[S.pitch_rate_rad_s]) / (car.dive_rad_s2_m * softer)
    along = LINKS * x[S.load_ax_mps2] + (1.0 - LINKS) * sprung
    load = 0.5 * mass * GRAVITY_MPS2 * share
    load += (-0.5 if front else 0.5) * mass * height * along / car.wheelbase_m
    load -= side * share * mass * height * x[S.load_ay_mps2] / car.track_m
    lift = (car.lift_front if front else car.lift_rear) + e[E.aero_lift, i]
    load -= 0.25 * car.air_density_kg_m3 * car.frontal_area_m2 * lift * x[S.speed_mps] ** 2
    if e[E.road_roughness, 0] != 0.0:
        place = x[S.distance_m] - (0.0 if front else car.wheelbase_m)
        load += 60000.0 * e[E.road_roughness, 0] * road_height(place)
    return max(load, 50.0)


@equation
def pitch_by_lift(x: Vector, mass: float, car: Car, e: Vector) -> float:
    """Pitch on the springs by the lift of the axles, rad; nose down where the rear is lifted more."""
    front_m, rear_m = car.cog_to_front_axle_m, car.wheelbase_m - car.cog_to_front_axle_m
    moment_m = rear_m * (car.lift_rear + e[E.aero_lift, 2]) - front_m * (car.lift_front + e[E.aero_lift, 0])
    lifted_n = 0.5 * car.air_density_kg_m3 * car.frontal_area_m2 * x[S.speed_mps] ** 2
    stiffness = (1.0 - LINKS) * mass * (car.cog_height_m + e[E.cog_height, 0])
    return lifted_n * moment_m * car.dive_rad_s2_m * (1.0 + e[E.pitch_dive, 0]) / stiffness


@equation
def road_friction(x: Vector, i: int, e: Vector) -> float:
    """Friction the road leaves of the dry one: low friction, split, a film of water that lifts with v^2."""
    film = FILM_S2_M3 * e[E.aquaplaning, i] * x[S.speed_mps] * x[S.speed_mps]
    warm = 1.0 + 0.2 * e[E.tyre_temperature, i] * (x[S.tyre_k + i] - 313.15)
    return max((1.0 + e[E.mu_road, i]) * (1.0 + e[E.split_mu, i]) * (1.0 - film) * warm, 0.05)


@equation
def wheel(x: Vector, i: int, steer: float, mass: float, car: Car, e: Vector, law: int, dx: Vector, y: Vector) -> None:
    """Tyre forces of one wheel and the rates of its slips, speed, hub and temperature.

    Relaxation: sigma k' = vs - |v| k (Pacejka, Tire and Vehicle Dynamics, section 7.2). Force: both slips, each scaled
    by its stiffness, act as one along their direction; F = D sin(C atan(x - E (x - atan(x)))), x = k / (C D)
    (Pacejka 1987), C and D between their longitudinal and lateral values.
    """
    front = i < 2
    side = 1.0 - 2.0 * (i % 2)
    half_track = 0.5 * car.track_m
    place = car.cog_to_front_axle_m if front else car.cog_to_front_axle_m - car.wheelbase_m
    angle = steer if front else 0.0
    vx = x[S.speed_mps] - side * half_track * x[S.yaw_rate_rad_s]
    vy = x[S.lateral_mps] + place * x[S.yaw_rate_rad_s]
    along = vx * cos(angle) + vy * sin(angle) + x[S.hub_rate_mps + i]
    across = -vx * sin(angle) + vy * cos(angle)

    load = wheel_load(x, i, mass, car, e)
    loss = e[E.tyre_pressure_loss, i]
    radius = car.rolling_radius_m * (1.0 + e[E.tyre_radius, i] - 0.01 * loss)
    if e[E.road_roughness, 0] != 0.0:
        radius -= 0.3 * e[E.road_roughness, 0] * road_height(x[S.distance_m] - (0.0 if front else car.wheelbase_m))
    dfz = load / NOMINAL_LOAD_N - 1.0
    mu = car.tyre_friction * (1.0 + (car.tyre_friction_load + e[E.load_sensitivity, i]) * dfz)
    mu *= road_friction(x, i, e)
    carcass = (1.0 + e[E.slip_stiffness, i]) * (1.0 + 0.25 * loss)
    carcass *= 1.0 + e[E.tyre_temperature, i] * (x[S.tyre_k + i] - 313.15)
    stiff_x = car.slip_stiffness * (1.0 + car.slip_stiffness_load * dfz) * load * carcass
    stiff_y = car.cornering_stiffness * (1.0 - 0.43 * dfz) * load

    omega = x[S.omega_rad_s + i]
    sliding = radius * omega - along
    speed = abs(along)
    length = max(car.relaxation_length_m * (1.0 + e[E.tyre_relaxation, i]) * load / RELAXATION_LOAD_N, 0.03)
    spare = max(1.0 - abs(x[S.slip + i]) * stiff_x / (3.0 * mu * load), 0.15)
    relaxing = max(length * spare, speed * SHORTEST_S)
    dx[S.slip + i] = (sliding - speed * x[S.slip + i]) / relaxing
    dx[S.side_slip + i] = (-across - speed * x[S.side_slip + i]) / (2.0 * length)

    slow = max(1.0 - speed / LOW_SPEED_MPS, 0.0) * LOW_SPEED_DAMPING_NS_M
    pull_x = stiff_x * x[S.slip + i] + slow * sliding
    pull_y = stiff_y * x[S.side_slip + i] - slow * across
    pull = sqrt(pull_x * pull_x + pull_y * pull_y) + 1e-9
    share = (pull_x / pull) ** 2
    shape = SHAPE_Y + (SHAPE_X - SHAPE_Y) * share
    peak = mu * load * (SIDE_FRICTION + (1.0 - SIDE_FRICTION) * share)
    bent = pull / (shape * peak)
    bent -= share * (car.tyre_curvature + car.tyre_curvature_load * dfz) * (bent - atan(bent))
    force = peak * sin(shape * atan(bent))
    force_x, force_y = force * pull_x / pull, force * pull_y / pull
    y[Y.tyre_n + i], y[Y.load_n + i] = force_x, load

    resistance = car.rolling_resistance * (1.0 + 0.33 * loss) * (1.0 + e[E.rolling_resistance, i])
    if law == LAW_WAVE_ROLLING:
        resistance += e[E.unlisted, i] * exp(-(((x[S.speed_mps] - 14.0) / 4.0) ** 2))
    rolling = load * radius * resistance * tanh(omega / 0.5)
    inertia = car.wheel_inertia_kg_m2 + e[E.rotating_inertia, i]
    torque = y[Y.brake_nm + i] + y[Y.motor_true_nm + i]
    dx[S.omega_rad_s + i] = (torque - radius * force_x - rolling) / inertia
    dx[S.angle_rad + i] = omega

    if e[E.sus_compliance, i] > 0.0:
        w = 6.283185307 * HUB_HZ
        dx[S.hub_m + i] = x[S.hub_rate_mps + i]
        bend = e[E.sus_compliance, i] * force_x - x[S.hub_m + i]
        dx[S.hub_rate_mps + i] = w * w * bend - 2.0 * HUB_DAMPING * w * x[S.hub_rate_mps + i]
    heat = abs(force_x * sliding) + rolling * omega
    dx[S.tyre_k + i] = (heat - TYRE_COOLING_W_K * (x[S.tyre_k + i] - 303.15)) / TYRE_HEAT_J_K

    y[Y.slip_w] += force_x * sliding - force_y * across
    y[Y.rolling_w] += rolling * omega
    total_x = force_x * cos(angle) - force_y * sin(angle)
    total_y = force_x * sin(angle) + force_y * cos(angle)
    dx[S.speed_mps] += total_x
    dx[S.lateral_mps] += total_y
    dx[S.yaw_rate_rad_s] += place * total_y - side * half_track * total_x


@equation
def rates(
    x: Vector, demand_pa: Vector, demand_nm: Vector, steering_wheel: float, gust_mps2: float, slope_mps2: float,
    direction: float, car: Car, e: Vector, law: int, play_pa: Vector, since_s: Vector, dx: Vector, y: Vector,
) -> None:  # fmt: skip
    """Rates of all states.

    m (v' - vy r) = sum Fx - 1/2 rho CdA (v + wind)^2 - m g sin(grade) + m (gust - slope). What the accelerometer feels
    has no g sin(grade) of the road, but turns with the body: a cos(pitch) - g sin(pitch), nose down positive, and
    g sin(roll) across.
    """
    dx[:] = 0.0
    y[:] = 0.0
    speed, yaw = x[S.speed_mps], x[S.yaw_rate_rad_s]
    mass = car.mass_kg + e[E.mass_offset, 0]
    steer = steering_wheel / car.steering_ratio + e[E.steer_lateral, 0]
    motors(x, demand_nm, car, e, law, dx, y)
    for i in range(4):
        brake_pressure_rates(x, i, demand_pa[i], car, e, dx)
        friction_brake(x, i, car, e, law, play_pa[i], since_s[i], dx, y)
        wheel(x, i, steer, mass, car, e, law, dx, y)

    air = speed + direction * e[E.headwind, 0]
    moving = tanh(abs(speed) / 0.2)
    drag = 0.5 * car.air_density_kg_m3 * car.drag_coefficient * car.frontal_area_m2 * air * abs(air) * moving
    if law == LAW_STEP_DRAG:
        drag += e[E.unlisted, 0] * (0.5 + 0.5 * tanh((speed - 17.0) / 0.5))
    elif law == LAW_STEER_DRAG:
        drag += e[E.unlisted, 0] * sqrt(abs(steer) + 1e-12)
    y[Y.drag_w] = drag * speed
    specific_x = (dx[S.speed_mps] - drag) / mass + gust_mps2 * moving
    specific_y = dx[S.lateral_mps] / mass
    grade = direction * e[E.road_grade, 0]
    along = (GRAVITY_MPS2 * sin(atan2(grade, 1.0)) + slope_mps2) * moving  # a standing car is held
    dx[S.speed_mps] = specific_x + x[S.lateral_mps] * yaw - along
    dx[S.lateral_mps] = (specific_y - speed * yaw) * moving - (1.0 - moving) * 5.0 * x[S.lateral_mps]
    dx[S.yaw_rate_rad_s] = dx[S.yaw_rate_rad_s] / car.yaw_inertia_kg_m2 * moving - (1.0 - moving) * 5.0 * yaw
    dx[S.distance_m] = speed

    softer = 1.0 + e[E.pitch_dive, 0]  # springs; inertia and dampers stay
    dive = car.dive_rad_s2_m * softer
    w = 6.283185307 * car.pitch_frequency_hz
    carried = specific_x - LINKS / (1.0 - LINKS) * drag / mass  # links pass nothing of the drag
    dx[S.pitch_rad] = x[S.pitch_rate_rad_s]
    dx[S.pitch_rate_rad_s] = (
        w * w * (-dive * carried - x[S.pitch_rad]) / softer - 2.0 * car.pitch_damping * w * x[S.pitch_rate_rad_s]
    )
    dx[S.load_ax_mps2] = (specific_x + drag / mass - x[S.load_ax_mps2]) / 0.02
    dx[S.load_ay_mps2] = (specific_y - x[S.load_ay_mps2]) / 0.04
    held = GRAVITY_MPS2 * sin(atan2(grade, 1.0)) * (1.0 - moving)  # what keeps a standing car on the slope is felt
    nose = x[S.pitch_rad] + pitch_by_lift(x, mass, car, e)
    felt = (specific_x + held) * cos(nose) - GRAVITY_MPS2 * sin(nose)
    arm = e[E.imu_position, 0]
    felt -= arm * yaw * yaw
    turned = specific_y + arm * dx[S.yaw_rate_rad_s]
    turned += GRAVITY_MPS2 * sin(car.roll_rad_s2_m * x[S.load_ay_mps2])
    quick = 6.283185307 * car.imu_cutoff_hz
    dx[S.imu_ax_mps2] = quick * (felt - x[S.imu_ax_mps2])
    dx[S.imu_ay_mps2] = quick * (turned - x[S.imu_ay_mps2])
    dx[S.imu_yaw_rate_rad_s] = quick * (yaw - x[S.imu_yaw_rate_rad_s])
    y[Y.specific_x_mps2] = specific_x
