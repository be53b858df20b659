"""Down to standstill: holding on a grade, no chatter, no creep."""

import numpy as np

from hil.report.report import Panel, Section, Trace
from hil.validation.verify.car import drive, inputs
from hil.validation.verify.topic import Topic, below
from plant.integrate import RUNGE_KUTTA_4, SEMI_IMPLICIT
from plant.road import RoadSegment

COLUMNS = ["speed_mps", "x_m", "wheel_speed_rad_s_*", "longitudinal_force_n_*", "acceleration_mps2"]
HOLD_S = 30.0


def topic() -> Topic:
    """Stops on 5 % uphill, downhill and on a steep hill, then 30 s of standing; a locked stop on the flat."""
    numbers, position, speed = [], [], []
    for grade in (0.05, -0.05, 0.20):
        for name, method in (("semi-implicit", SEMI_IMPLICIT), ("RK4", RUNGE_KUTTA_4)):
            table = inputs(36.0, {"pressure_demand_pa": 40e5})
            run = drive(table, 8.0, COLUMNS, road=(RoadSegment(-1e9, grade=grade),), method=method)
            stood = int(np.argmax(run["speed_mps"] <= 0.0)) + 300  # 3 s to come to rest
            held = slice(stood, stood + round(HOLD_S / 0.01))
            drift = float(np.ptp(run["x_m"][held]))
            numbers.append(below(f"{100 * grade:+.0f} %, {name}", 1e3 * drift, 1.0, "mm", "drift in 30 s"))
            if method == SEMI_IMPLICIT:
                first = slice(stood - 310, stood - 150)  # from 0.1 s before standing
                t = run.time_s[first] - run.time_s[stood - 300]
                label = f"{100 * grade:+.0f} %"
                position.append(Trace(label, t, 1e3 * (run["x_m"][first] - run["x_m"][stood])))
                speed.append(Trace(label, t, run["speed_mps"][first]))
    locked = drive(inputs(8.0, {"pressure_demand_pa": 140e5}), 20.0, COLUMNS)
    end = slice(int(np.argmax(locked["speed_mps"] <= 0.0)) - 10, None)
    t = (locked.time_s[end] - locked.time_s[end][10])[:160]
    rest = float(np.abs(locked["speed_mps"][-200:]).max())
    force = float(np.ptp(locked.four("longitudinal_force_n")[-200:], axis=0).max())
    numbers += [
        below("Speed after locking", 1e3 * rest, 1.0, "mm/s", "3 s after it"),
        below("Force ripple then", force, 20.0, "N", "a chattering tyre would show hundreds"),
    ]
    panels = (
        Panel("Speed as the car comes to rest on a grade", "m/s", tuple(speed)),
        Panel("Position from the resting place", "mm", tuple(position)),
        Panel("Stop with locked wheels on the flat", "m/s", (Trace("speed", t, locked["speed_mps"][end][:160]),)),
    )
    text = "The rocking after a stop is the car on its tyres and brakes, at about 4 Hz."
    return Topic("Standstill", "rest", tuple(numbers), Section("Standstill", panels, text=text))
