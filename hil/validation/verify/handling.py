"""Handling: yaw gain against single-track theory, a sine steer against the CommonRoad single-track model."""

import math
from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp

from hil.report.report import Chart, Curve, Panel, Section, Trace
from hil.report.units import Display
from hil.validation.verify.car import changed, drive, inputs, paper_car
from hil.validation.verify.topic import Topic, below
from plant.layout import Vector
from plant.model import pack
from plant.parameters import PlantParameters
from plant.tyre import cornering_stiffness
from plant.vehicle import GRAVITY_MPS2

SPEEDS_MPS = (10.0, 15.0, 20.0, 25.0, 30.0)
STEER_RAD = 0.08  # at the steering wheel: small, tyres in their linear range
SINE_RAD, SINE_HZ = 0.25, 0.5
DEG_S = Display("deg/s", math.degrees(1.0))


def no_resistance() -> PlantParameters:
    """The car without drag and rolling resistance, so that it keeps its speed as the single-track models do."""
    return changed("vehicle", drag_coefficient=0.0, rolling_resistance=0.0, rolling_resistance_speed_s2_m2=0.0)


def axle_stiffness_n_rad(car: PlantParameters) -> tuple[float, float]:
    """Cornering stiffness of both tyres of each axle at the static load, N/rad."""
    v, p = car.vehicle, pack(car)
    base = sum(v.cog_to_axle_m)
    front, rear = (v.mass_kg * GRAVITY_MPS2 * other / base / 2.0 for other in (v.cog_to_axle_m[1], v.cog_to_axle_m[0]))
    return -2.0 * cornering_stiffness(front, p), -2.0 * cornering_stiffness(rear, p)


def understeer_rad_s2_m(car: PlantParameters) -> float:
    """Understeer gradient, rad s2/m: m (lr Cr - lf Cf) / (L Cf Cr).

    Mitschke/Wallentowitz, Dynamik der Kraftfahrzeuge.
    """
    front, rear = axle_stiffness_n_rad(car)
    v = car.vehicle
    lf, lr = v.cog_to_axle_m
    return v.mass_kg * (lr * rear - lf * front) / ((lf + lr) * front * rear)


def commonroad_sine(car: PlantParameters, speed_mps: float, time_s: Vector) -> Vector:
    """Yaw rate, rad/s, of the CommonRoad single-track model (ST) under the sine steer, speed held.

    ST has one stiffness per load for both axles, given here as the mean of ours; its lateral load transfer is none.
    """
    from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

    front, rear = axle_stiffness_n_rad(car)
    v = car.vehicle
    stiffness = (front + rear) / (v.mass_kg * GRAVITY_MPS2)
    p = SimpleNamespace(
        a=v.cog_to_axle_m[0], b=v.cog_to_axle_m[1], h_s=v.cog_height_m, m=v.mass_kg, I_z=v.yaw_inertia_kg_m2,
        tire=SimpleNamespace(p_dy1=1.0, p_ky1=-stiffness),
        steering=SimpleNamespace(min=-1.0, max=1.0, v_min=-10.0, v_max=10.0),
        longitudinal=SimpleNamespace(v_min=-50.0, v_max=80.0, v_switch=80.0, a_max=12.0),
    )  # fmt: skip
    w = 2.0 * math.pi * SINE_HZ
    amplitude = SINE_RAD / v.steering_ratio

    def rates(t: float, x: Vector) -> list[float]:
        return [float(r) for r in vehicle_dynamics_st(list(x), [amplitude * w * math.cos(w * t), 0.0], p)]

    start = [0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0]
    result = solve_ivp(rates, (0.0, float(time_s[-1])), start, t_eval=time_s, rtol=1e-8, atol=1e-10)
    yaw_rate: Vector = result.y[5]
    return yaw_rate


def topic() -> Topic:
    """Yaw gain over the speed; a sine steer at 72 km/h."""
    car = no_resistance()
    base = sum(car.vehicle.cog_to_axle_m)
    steer = STEER_RAD / car.vehicle.steering_ratio
    gradient = understeer_rad_s2_m(paper_car())
    gains, theory = [], []
    for speed in SPEEDS_MPS:
        run = drive(inputs(6.0, {"steering_wheel_rad": STEER_RAD}), speed, ["yaw_rate_rad_s", "speed_mps"], car)
        actual = run["speed_mps"][-1]
        gains.append(float(run["yaw_rate_rad_s"][-1]) / steer)
        theory.append(float(actual / (base + gradient * actual**2)))
    worst = max(abs(a / b - 1.0) for a, b in zip(gains, theory, strict=True))
    # steer = L / R + K a_y: the gradient is the slope over the lateral acceleration
    lateral = np.array([gain * steer * v for gain, v in zip(gains, SPEEDS_MPS, strict=True)])
    extra = np.array([steer - base * gain * steer / v for gain, v in zip(gains, SPEEDS_MPS, strict=True)])
    slope = float(np.polyfit(lateral, extra, 1)[0])

    sine = inputs(4.0, {"steering_wheel_rad": lambda t: SINE_RAD * np.sin(2.0 * math.pi * SINE_HZ * t)})
    run = drive(sine, 20.0, ["yaw_rate_rad_s", "imu_lateral_mps2"], car)
    time_s = run.time_s
    other = commonroad_sine(car, 20.0, time_s)
    settled = slice(200, 400)
    amplitude = float(np.ptp(run["yaw_rate_rad_s"][settled]) / np.ptp(other[settled]))
    phase = np.angle(
        np.exp(-2j * math.pi * SINE_HZ * time_s[settled]) @ np.column_stack([run["yaw_rate_rad_s"], other])[settled]
    )
    delay_ms = float(1e3 * (phase[1] - phase[0]) / (2.0 * math.pi * SINE_HZ))
    numbers = (
        below("Yaw gain", 100.0 * worst, 1.0, "%", "largest difference from v / (L + K v2), 36 to 108 km/h"),
        below(
            "Understeer gradient", math.degrees(slope - gradient) * GRAVITY_MPS2, 0.03, "deg/g",
            f"{math.degrees(slope) * GRAVITY_MPS2:.3f} against {math.degrees(gradient) * GRAVITY_MPS2:.3f} deg/g",
        ),
        below("Sine amplitude", 100.0 * (amplitude - 1.0), 5.0, "%", "against CommonRoad ST"),
        below("Sine delay", delay_ms, 10.0, "ms", "ours less CommonRoad ST"),
    )  # fmt: skip
    chart = Chart(
        "Steady-state yaw gain", "speed", "m/s", "yaw rate over steering angle at the wheel", "1/s",
        (
            Curve("single-track theory", np.array(SPEEDS_MPS), np.array(theory), style="demand"),
            Curve("ours", np.array(SPEEDS_MPS), np.array(gains), style="points"),
        ),
    )  # fmt: skip
    panel = Panel(
        "Yaw rate in a sine steer of 0.5 Hz at 72 km/h", DEG_S,
        (Trace("ours", time_s, run["yaw_rate_rad_s"]), Trace("CommonRoad single-track", time_s, other, "demand")),
    )  # fmt: skip
    text = "CommonRoad ST has one tyre stiffness for both axles, rigid tyres and no roll; ours has all three."
    return Topic(
        "Handling",
        "single-track theory and CommonRoad",
        numbers,
        Section("Handling", (panel,), charts=(chart,), text=text),
    )
