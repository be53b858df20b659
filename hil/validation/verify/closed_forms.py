"""Closed forms: stopping distance, coast-down, load transfer, dive, pressure and torque steps, cooling."""

import math
from dataclasses import replace

import numpy as np

from hil.report.report import Chart, Curve, Panel, Section, Trace
from hil.report.units import BAR, KMH
from hil.validation.verify.car import changed, drive, inputs, paper_car
from hil.validation.verify.topic import Topic, below
from plant.layout import Vector
from plant.parameters import PlantParameters
from plant.vehicle import GRAVITY_MPS2


def effective_mass_kg(car: PlantParameters) -> float:
    """Mass with the rotating parts: m + 2 (I_f + I_r) / R^2."""
    return car.vehicle.mass_kg + 2.0 * sum(car.wheel.inertia_kg_m2) / car.wheel.rolling_radius_m**2


def coast_down_mps(car: PlantParameters, speed_mps: float, time_s: Vector) -> Vector:
    """Speed of a rolling car, m/s: v' = -(A + B v^2) gives v = sqrt(A/B) tan(atan(v0 sqrt(B/A)) - sqrt(A B) t).

    A is rolling resistance over effective mass, B drag over it; lift changes the load and is left out here.
    """
    mass, v = effective_mass_kg(car), car.vehicle
    a = v.rolling_resistance * v.mass_kg * GRAVITY_MPS2 / mass
    drag = 0.5 * v.air_density_kg_m3 * v.frontal_area_m2 * v.drag_coefficient
    b = (drag + v.rolling_resistance_speed_s2_m2 * v.mass_kg * GRAVITY_MPS2) / mass
    ratio, root = math.sqrt(b / a), math.sqrt(a * b)
    speed: Vector = np.tan(np.arctan(speed_mps * ratio) - root * time_s) / ratio
    return speed


def second_order_step(time_s: Vector, frequency_hz: float, damping: float) -> Vector:
    """Unit step response of a second-order system damped below 1, from time 0."""
    w = 2.0 * math.pi * frequency_hz
    root = math.sqrt(1.0 - damping**2)
    t = np.maximum(time_s, 0.0)
    step: Vector = 1.0 - np.exp(-damping * w * t) / root * np.sin(w * root * t + math.acos(damping))
    return np.where(time_s > 0.0, step, 0.0)


def constant_torque_stop() -> tuple[float, float]:
    """Stopping distance with constant motor torque, without drag and rolling: ours, and v0^2 / (2 a)."""
    car = changed("vehicle", drag_coefficient=0.0, rolling_resistance=0.0, rolling_resistance_speed_s2_m2=0.0)
    car = replace(
        car,
        motor=replace(car.motor, rate_limit_nm_s=1e6, time_constant_s=1e-3, fade_end_mps=0.0, fade_start_mps=0.1),
        battery=replace(car.battery, charge_power_w=1e6),
    )
    run = drive(inputs(8.0, {"motor_demand_nm": -400.0}), 20.0, ["speed_mps", "x_m"], car)
    deceleration = 4.0 * 400.0 / car.wheel.rolling_radius_m / effective_mass_kg(car)
    moving = run["speed_mps"] > 1.0
    ours = float(run["x_m"][moving][-1])
    return ours, (20.0**2 - float(run["speed_mps"][moving][-1]) ** 2) / (2.0 * deceleration)


def topic() -> Topic:
    """All closed forms."""
    car = paper_car()
    v = car.vehicle
    ours, exact = constant_torque_stop()
    numbers = [
        below("Stopping distance", 100.0 * (ours / exact - 1.0), 0.2, "%", f"{ours:.3f} m against {exact:.3f} m")
    ]

    free = changed("vehicle", lift_coefficient=(0.0, 0.0))
    coast = drive(inputs(120.0, {}), 36.0, ["speed_mps"], free)
    ideal = coast_down_mps(free, 36.0, coast.time_s)
    numbers.append(below("Coast-down for 120 s", float(np.abs(coast["speed_mps"] - ideal).max()), 0.01, "m/s"))

    base = v.cog_to_axle_m[0] + v.cog_to_axle_m[1]
    table = inputs(4.0, {"pressure_demand_pa": 34e5})
    stop = drive(table, 30.0, ["wheel_load_n_*", "acceleration_mps2", "pitch_rad"], free)
    late = slice(250, 350)
    axle = stop.four("wheel_load_n")[late][:, :2].sum(axis=1)
    transferred = axle - v.mass_kg * GRAVITY_MPS2 * v.cog_to_axle_m[1] / base
    lever = -v.mass_kg * stop["acceleration_mps2"][late] * v.cog_height_m / base
    numbers.append(
        below("Load transfer", 100.0 * (float(np.mean(transferred / lever)) - 1.0), 0.5, "%", "against m h a / L")
    )  # fmt: skip

    ehb = car.ehb
    small = inputs(1.0, {"pressure_demand_pa": 5e5})
    step = drive(small, 20.0, ["state.pressure_pa_fl"])
    response = 5e5 * second_order_step(step.time_s - ehb.dead_time_s, ehb.natural_frequency_hz, ehb.damping_ratio)
    difference = float(np.abs(step["state.pressure_pa_fl"] - response).max())
    numbers.append(below("Pressure step of 5 bar", difference / 1e5, 0.1, "bar", "second order after the dead time"))
    large = drive(inputs(1.0, {"pressure_demand_pa": 120e5}), 20.0, ["state.pressure_pa_fl"])
    rate = float(np.diff(large["state.pressure_pa_fl"]).max() / 0.01)
    numbers.append(
        below("Build rate, 120 bar", 100.0 * (rate / ehb.build_rate_pa_s - 1.0), 0.5, "%", "against the limit")
    )

    motor = drive(inputs(0.3, {"motor_demand_nm": -30.0}), 20.0, ["motor_torque_nm_fl"])
    lag = -30.0 * (1.0 - np.exp(-motor.time_s / car.motor.time_constant_s))
    numbers.append(below("Motor step of 30 N m", float(np.abs(motor["motor_torque_nm_fl"] - lag).max()), 1.5, "N m"))

    still = drive(inputs(200.0, {}), 0.0, ["disc_temperature_k_fl"], disc_temperature_k=573.15)
    brake = car.friction_brake
    tau = brake.heat_capacity_j_k[0] / brake.cooling_w_k[0]
    cooling = brake.ambient_k + (573.15 - brake.ambient_k) * np.exp(-still.time_s / tau)
    numbers.append(below("Cooling for 200 s", float(np.abs(still["disc_temperature_k_fl"] - cooling).max()), 0.05, "K"))

    panels = (
        Panel(
            "Coast-down", KMH,
            (Trace("ours", coast.time_s, coast["speed_mps"]), Trace("closed form", coast.time_s, ideal, "demand")),
        ),
    )  # fmt: skip
    charts = (
        Chart(
            "Pressure step of 5 bar", "time", "s", "pressure", BAR,
            (
                Curve("ours", step.time_s[:50], step["state.pressure_pa_fl"][:50]),
                Curve("closed form", step.time_s[:50], response[:50], style="demand"),
            ),
        ),
        Chart(
            "Pressure step of 120 bar: rate limited", "time", "s", "pressure", BAR,
            (Curve("ours", large.time_s, large["state.pressure_pa_fl"]),),
        ),
        Chart(
            "Motor step of 30 N m", "time", "s", "torque", "N m",
            (
                Curve("ours", motor.time_s[:12], motor["motor_torque_nm_fl"][:12]),
                Curve("closed form", motor.time_s[:12], lag[:12], style="demand"),
            ),
        ),
    )  # fmt: skip
    return Topic(
        "Closed forms", "what can be written down", tuple(numbers), Section("Closed forms", panels, charts=charts)
    )
