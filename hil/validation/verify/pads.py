"""Pad friction in stops: what the three parameter sets of equations (3) and (4) do, and the energy beside them."""

from dataclasses import replace
from importlib import resources

import numpy as np
from scipy.integrate import solve_ivp

from hil.report.report import Chart, Curve, Panel, Section, Table, Trace
from hil.report.units import BAR, DEG_C
from hil.scenario.parameters import load_set
from hil.validation.verify.car import drive, inputs, paper_car
from hil.validation.verify.topic import Topic, below, within
from plant.integrate import RUNGE_KUTTA_4
from plant.layout import Vector
from plant.parameters import OstermeyerParameters, PlantParameters
from plant.vectors import CUT, INPUT

COLUMNS = ["speed_mps", "pad_friction_fl", "pad_temperature_k_fl", "disc_temperature_k_fl", "friction_torque_nm_fl"]
STOP = inputs(6.0, {"pressure_demand_pa": 34e5})


def car_with(name: str) -> PlantParameters:
    """The paper's car with pad set A (its own), B or C."""
    if name == "A":
        return paper_car()
    path = resources.files("plant").joinpath(f"parameters/pad_{name.lower()}.toml")
    return replace(paper_car(), pad=load_set(path, OstermeyerParameters))


def dyno(frequency_hz: float, duration_s: float, car: PlantParameters) -> tuple[Vector, Vector, Vector]:
    """A dynamometer run at a rim speed of 50 km/h, 0 to 30 bar as a sine: pressure, torque, temperature.

    The wheel torque joint is cut at zero, so that the wheel turns on while its brake works.
    """
    table = inputs(duration_s, {"pressure_pa": lambda s: 15e5 * (1.0 - np.cos(2.0 * np.pi * frequency_hz * s))})
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0
    cut[CUT.slice("wheel_torque")] = 1.0
    speed = 50.0 / 3.6
    table[:, INPUT.slice("wheel_torque_nm")] = 12.5  # about what drag and rolling take at this speed
    columns = ["pressure_pa_fl", "friction_torque_nm_fl", "pad_temperature_k_fl"]
    run = drive(table, speed, columns, car, cut=cut, disc_temperature_k=373.15)
    return run["pressure_pa_fl"], -run["friction_torque_nm_fl"], run["pad_temperature_k_fl"]


def alone(car: PlantParameters, power_w: float, duration_s: float) -> tuple[Vector, Vector, Vector]:
    """Equations (3) and (4) by themselves at constant N v, by scipy: times, friction, temperature."""
    pad = car.pad

    def rates(_: float, state: Vector) -> list[float]:
        mu, kelvin = state
        heat = power_w * (mu if pad.heating_with_mu else 1.0)
        return [
            -(pad.b_1_j * (power_w + pad.epsilon_w) * mu - pad.a_1_ks * kelvin),
            -pad.c_1_s * ((kelvin - car.friction_brake.ambient_k) - pad.gamma_k_w[0] * heat),
        ]

    start = [pad.a_1_ks / pad.b_1_j * 423.15 / pad.epsilon_w, 423.15]
    t = np.arange(round(duration_s / 0.01), dtype=np.float64) * 0.01
    result = solve_ivp(rates, (0.0, duration_s), start, t_eval=t, rtol=1e-10, atol=1e-12)
    return t, result.y[0], result.y[1]


def topic() -> Topic:
    """One stop from 72 km/h with each set; a dynamometer run; the equations by themselves."""
    panels_mu, panels_t, rows = [], [], []
    numbers = []
    for name in ("A", "B", "C"):
        run = drive(STOP, 20.0, COLUMNS, car_with(name))
        end = int(np.argmax(run["speed_mps"] <= 0.01))
        mu, kelvin = run["pad_friction_fl"][: end + 1], run["pad_temperature_k_fl"][: end + 1]
        disc = run["disc_temperature_k_fl"][: end + 1]
        degrees = [round(float(k) - 273.15, 1) for k in (kelvin[-1], disc[-1])]
        frictions = [round(float(v), 3) for v in (mu[0], mu.min(), mu[-1])]
        rows.append((name, *frictions, *degrees, round(0.01 * end, 2)))
        panels_mu.append(Trace(f"set {name}", run.time_s[: end + 1], mu))
        panels_t.append(Trace(f"set {name}", run.time_s[: end + 1], kelvin))
        if name == "A":
            panels_t.append(Trace("disc, by its energy", run.time_s[: end + 1], disc, "demand"))
            numbers += [
                within("Set A, start", float(mu[0]), 0.395, 0.401, "", "design: 0.398"),
                within("Set A, end", float(mu[-1]), 0.354, 0.370, "", "design: 0.364"),
                within("Set A, rise", float(kelvin[-1] - kelvin[0]), 26.0, 34.0, "K", "design: 29 K"),
                within("Set A, stop", 0.01 * end, 4.2, 5.0, "s", "design: 4.4 s at a constant 4.5 m/s2"),
                below("Disc by its energy", float(disc[-1] - kelvin[-1]), 4.0, "K", "against equation (4)"),
            ]
    car = paper_car()
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0
    cut[CUT.slice("wheel_torque")] = 1.0
    held = drive(
        inputs(20.0, {"pressure_pa": 20e5}), 15.0, ["pad_friction_fl", "pad_temperature_k_fl", "wheel_speed_rad_s_fl"],
        replace(car, vehicle=replace(car.vehicle, drag_coefficient=0.0, rolling_resistance=0.0)), cut=cut,
        method=RUNGE_KUTTA_4,
    )  # fmt: skip
    brake = car.friction_brake
    force = brake.efficiency * brake.piston_area_m2[0] * (20e5 - brake.threshold_pressure_pa[0])
    power = force * brake.effective_radius_m[0] * float(held["wheel_speed_rad_s_fl"][-1])
    _, mu, kelvin = alone(car, power, 20.0)
    numbers += [
        below(
            "(3) against scipy", 1e6 * float(np.abs(held["pad_friction_fl"] - mu).max()), 100.0, "ppm", "20 s, 20 bar"
        ),
        below(
            "(4) against scipy", float(np.abs(held["pad_temperature_k_fl"] - kelvin).max()), 0.05, "K", "20 s, 20 bar"
        ),
    ]
    pressure, torque, _ = dyno(0.1, 30.0, car)
    second = slice(1000, 2000)  # the second period, 10 to 20 s
    p, t = pressure[second], torque[second]
    up, down = t[: len(t) // 2], t[len(t) // 2 :]
    at = 15e5
    build = float(np.interp(at, p[: len(p) // 2], up))
    release = float(np.interp(at, p[len(p) // 2 :][::-1], down[::-1]))
    numbers.append(
        within(
            "Release below build", 100.0 * (1.0 - release / build), 5.0, 10.0, "%", "15 bar, 0.1 Hz; design: 7.5 to 7.8"
        )
    )
    chart = Chart(
        "Dynamometer, 50 km/h at the rim, 0 to 30 bar at 0.1 Hz", "pressure", BAR, "friction torque fl", "N m",
        tuple(
            Curve(f"period {k + 1}", pressure[k * 1000 : (k + 1) * 1000], torque[k * 1000 : (k + 1) * 1000])
            for k in range(3)
        ),
    )  # fmt: skip
    table = Table(
        "A stop from 72 km/h at 34 bar, pads at 150 °C",
        ("set", "friction at start", "least", "at end", "pad °C at end", "disc °C at end", "stop s"), tuple(rows),
    )  # fmt: skip
    panels = (
        Panel("Friction coefficient fl", "", tuple(panels_mu)),
        Panel("Temperature in the friction model fl", DEG_C, tuple(panels_t)),
    )
    section = Section("Pads", panels, charts=(chart,), tables=(table,))
    return Topic("Pads", "scipy, energy and the design's figures", tuple(numbers), section)
