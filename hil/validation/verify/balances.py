"""Energy and momentum: what leaves the motion must turn up somewhere."""

import numpy as np

from hil.report.report import Panel, Section, Trace
from hil.report.units import KJ
from hil.validation.verify.car import ROW_S, drive, inputs, paper_car
from hil.validation.verify.topic import Topic, below
from plant.integrate import RUNGE_KUTTA_4
from plant.layout import Vector
from plant.vehicle import GRAVITY_MPS2

COLUMNS = [
    "speed_mps", "lateral_speed_mps", "yaw_rate_rad_s", "yaw_rad", "wheel_speed_rad_s_*", "friction_torque_nm_*",
    "motor_torque_nm_*", "wheel_torque_nm_*", "rolling_torque_nm_*", "longitudinal_force_n_*", "lateral_force_n_*",
    "slip_speed_mps_*", "across_mps_*", "drag_n", "disc_temperature_k_*", "friction_heat_j", "recuperated_j",
    "state_of_charge", "battery_power_w", "wheel_load_n_*", "heave_rate_mps",
]  # fmt: skip


def _integral(values: Vector) -> Vector:
    steps = 0.5 * (values[1:] + values[:-1]) * ROW_S
    return np.concatenate([[0.0], np.cumsum(steps)])


def topic() -> Topic:
    """A stop from 108 km/h with friction brakes and motors in a bend: energy, impulse and angular impulse."""
    car = paper_car()
    table = inputs(
        6.0,
        {
            "pressure_demand_pa": lambda t: 25e5 * np.clip((t - 0.5) / 0.3, 0.0, 1.0),
            "motor_demand_nm": lambda t: -150.0 * np.clip((t - 0.5) / 0.3, 0.0, 1.0),
            "steering_wheel_rad": lambda t: 0.12 * np.clip(t / 1.0, 0.0, 1.0),
        },
    )
    run = drive(table, 30.0, COLUMNS, method=RUNGE_KUTTA_4)
    moving = run["speed_mps"] > 1.0
    mass, inertia, yaw_inertia = (
        car.vehicle.mass_kg,
        np.repeat(car.wheel.inertia_kg_m2, 2),
        car.vehicle.yaw_inertia_kg_m2,
    )
    omega = run.four("wheel_speed_rad_s")
    kinetic = 0.5 * mass * (run["speed_mps"] ** 2 + run["lateral_speed_mps"] ** 2)
    kinetic += 0.5 * yaw_inertia * run["yaw_rate_rad_s"] ** 2 + 0.5 * (inertia * omega**2).sum(axis=1)
    sinks = {
        "friction brakes": _integral(-(run.four("friction_torque_nm") * omega).sum(axis=1)),
        "motors": _integral(-(run.four("motor_torque_nm") * omega).sum(axis=1)),
        "tyre slip": _integral(
            (
                run.four("longitudinal_force_n") * run.four("slip_speed_mps")
                - run.four("lateral_force_n") * run.four("across_mps")
            ).sum(axis=1)
        ),
        "air": _integral(run["drag_n"] * run["speed_mps"]),
        "rolling": _integral((run.four("rolling_torque_nm") * omega).sum(axis=1)),
    }
    total = sum(sinks.values(), np.zeros_like(kinetic))
    lost = kinetic[0] - kinetic
    last = int(np.flatnonzero(moving)[-1])

    thermal = car.friction_brake
    rise = run.four("disc_temperature_k") - run.four("disc_temperature_k")[0]
    capacity = np.repeat(thermal.heat_capacity_j_k, 2)
    cooling = np.repeat(thermal.cooling_w_k, 2) + np.outer(run["speed_mps"], np.repeat(thermal.cooling_speed_ws_m_k, 2))
    cooled = _integral((cooling * (run.four("disc_temperature_k") - thermal.ambient_k)).sum(axis=1))
    stored = (rise * capacity).sum(axis=1) + cooled
    charge = (run["state_of_charge"] - run["state_of_charge"][0]) * car.battery.capacity_j

    cos, sin = np.cos(run["yaw_rad"]), np.sin(run["yaw_rad"])
    steer = table[:, 8] / car.vehicle.steering_ratio
    turn = np.column_stack([steer, steer, np.zeros_like(steer), np.zeros_like(steer)])
    along, across = run.four("longitudinal_force_n"), run.four("lateral_force_n")
    force_x = (along * np.cos(turn) - across * np.sin(turn)).sum(axis=1) - run["drag_n"]
    force_y = (along * np.sin(turn) + across * np.cos(turn)).sum(axis=1)
    world_x = run["speed_mps"] * cos - run["lateral_speed_mps"] * sin
    impulse = _integral(force_x * cos - force_y * sin)
    radius = car.wheel.rolling_radius_m
    spin = _integral(
        (run.four("wheel_torque_nm") - radius * along - run.four("rolling_torque_nm")).sum(axis=1)
    )  # fmt: skip
    weight = run.four("wheel_load_n")[0].sum()

    scale = float(lost[last])
    numbers = (
        below("Energy missing", 100.0 * float(total[last] - lost[last]) / scale, 0.1, "%", "of what was lost"),
        below("Heat not in the discs", 100.0 * float(stored[last] / run["friction_heat_j"][last] - 1.0), 0.1, "%"),
        below("Charge against energy", 100.0 * float(charge[last] / run["recuperated_j"][last] - 1.0), 0.01, "%"),
        below(
            "Momentum missing",
            100.0 * float(mass * (world_x[last] - world_x[0]) - impulse[last]) / (mass * 30.0), 0.1, "%", "of m v0",
        ),
        below(
            "Spin missing",
            100.0 * float((inertia * (omega[last] - omega[0])).sum() - spin[last]) / float((inertia * omega[0]).sum()),
            0.3, "%", "of the wheels' at the start",
        ),
        below("Weight on the wheels", 100.0 * float(weight / (mass * GRAVITY_MPS2) - 1.0), 0.01, "%", "at the start"),
    )  # fmt: skip
    t = run.time_s
    traces = [Trace(name, t, values) for name, values in sinks.items()]
    panels = (
        Panel("Where the kinetic energy went", KJ, (*traces, Trace("lost kinetic energy", t, lost, "demand"))),
        Panel("Lost and not found", KJ, (Trace("missing", t, lost - total),)),
    )
    text = "A stop from 108 km/h in a bend, 25 bar and 150 N m a wheel; integrals by the trapezoidal rule over 10 ms."
    return Topic("Energy and momentum", "conservation", numbers, Section("Energy and momentum", panels, text=text))
