"""Limits: battery and motors while regenerating, a slippery patch, split friction."""

import math

import numpy as np

from hil.report.report import Chart, Curve, Panel, Section, Trace
from hil.report.units import KMH, Display
from hil.validation.verify.car import drive, inputs, paper_car
from hil.validation.verify.topic import Topic, below, within
from plant.road import RoadSegment

KW = Display("kW", 1e-3)
DEG = Display("deg", math.degrees(1.0))


def topic() -> Topic:
    """Regeneration from 130 km/h against the charge limit; braking over a patch of 0.2; braking on split friction."""
    car = paper_car()
    columns = ["speed_mps", "motor_torque_nm_*", "wheel_speed_rad_s_*", "motor_available_nm_*", "charge_power_limit_w"]
    regen = drive(inputs(20.0, {"motor_demand_nm": -600.0}), 130.0 / 3.6, columns)
    power = -(regen.four("motor_torque_nm") * regen.four("wheel_speed_rad_s"))
    promised = (regen.four("motor_available_nm") * regen.four("wheel_speed_rad_s")).sum(axis=1)
    total, limit = power.sum(axis=1), regen["charge_power_limit_w"]
    full = drive(inputs(2.0, {"motor_demand_nm": -300.0}), 30.0, columns, state_of_charge=0.96)
    last = regen["speed_mps"] < car.motor.fade_end_mps

    patch = (RoadSegment(-1e9), RoadSegment(30.0, 0.17, 0.17), RoadSegment(45.0))  # 0.17 x 1.19 = 0.2
    slide = drive(
        inputs(6.0, {"pressure_demand_pa": 34e5}), 20.0,
        ["speed_mps", "x_m", "longitudinal_force_n_*", "wheel_load_n_*", "wheel_speed_rad_s_*", "road_friction_fl"],
        road=patch,
    )  # fmt: skip
    on = (slide["road_friction_fl"] < 1.0) & (slide["x_m"] > 32.0)
    used = -slide.four("longitudinal_force_n")[on, 0] / slide.four("wheel_load_n")[on, 0]

    split = drive(
        inputs(1.5, {"pressure_demand_pa": 60e5}), 25.0, ["yaw_rad", "yaw_rate_rad_s", "longitudinal_force_n_*"],
        road=(RoadSegment(-1e9, 1.0, 0.2),),
    )  # fmt: skip
    moments = split.four("longitudinal_force_n") @ -np.array(_lateral_positions())
    begun = int(0.15 / 0.01)  # before the tyres' side forces answer the yaw
    turned = car.vehicle.yaw_inertia_kg_m2 * float(split["yaw_rate_rad_s"][begun])
    pushed = float(moments[:begun].sum() + 0.5 * moments[begun]) * 0.01
    radius = car.wheel.rolling_radius_m
    behind = slide.four("wheel_speed_rad_s")[-1, 0] * radius - slide["speed_mps"][-1]
    over_kw = float((total - limit).max()) / 1e3
    numbers = (
        below("Over charge limit", over_kw, 2.0, "kW", "the motors' lag lets it pass shortly"),
        below("Promised over limit", float((promised - limit).max()) / 1e3, 0.01, "kW", "sum of torque times speed"),
        below("Full battery", float(np.abs(full.four("motor_torque_nm")).max()), 1e-6, "N m", "charge of 96 %"),
        below("Below 3 km/h", float(np.abs(regen.four("motor_torque_nm")[last][20:]).max()), 0.01, "N m", "faded out"),
        within("Friction used", float(used.max()), 0.10, 0.21, "", "locked wheels slide below the peak of 0.2"),
        within("Wheel recovers", float(behind), -0.1, 0.1, "m/s", "behind the patch"),
        within("Yaw, split", turned / pushed, 0.85, 1.02, "", "angular momentum over the forces' moment, 0.15 s"),
    )
    braking = slice(0, 1300)
    time_s = regen.time_s[braking]
    power_traces = (
        Trace("motors", time_s, total[braking]),
        Trace("battery accepts", time_s, limit[braking], "demand"),
        Trace("promised", time_s, promised[braking], "estimate"),
    )
    wheels = [
        Curve(f"wheel {w}", slide.time_s, slide[f"wheel_speed_rad_s_{w}"] * radius, group=w) for w in ("fl", "rl")
    ]
    car_speed = Curve("car", slide.time_s, slide["speed_mps"])
    yaw = Curve("yaw", split.time_s, split["yaw_rad"])
    panels = (Panel("Regeneration from 130 km/h", KW, power_traces),)
    charts = (
        Chart("A patch of 0.2 from 30 to 45 m, 34 bar", "time", "s", "speed", KMH, (car_speed, *wheels)),
        Chart("Split friction 1 left, 0.2 right, 60 bar, no steering", "time", "s", "yaw angle", DEG, (yaw,)),
    )
    return Topic("Limits", "their own statements", numbers, Section("Limits", panels, charts=charts))


def _lateral_positions() -> tuple[float, float, float, float]:
    front, rear = paper_car().vehicle.track_m
    return front / 2.0, -front / 2.0, rear / 2.0, -rear / 2.0
