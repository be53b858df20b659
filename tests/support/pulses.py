"""A short log in canonical channels: known pulses of brakes and motors."""

import numpy as np

from hil.study.table import Log, make_log

WHEELS = ("fl", "fr", "rl", "rr")


def log_of_pulses() -> Log:
    """A car that brakes by pulses of its motors and of its brakes, both known."""
    t = np.arange(2000) * 0.01
    brakes, pulses = (t % 7.0 > 3.0) & (t % 7.0 < 4.5), t % 4.0 < 1.5
    speed = 33.0 - np.cumsum(0.3 + 1.4 * brakes + 0.6 * pulses) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS}
    channels |= {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    for wheel in WHEELS:
        channels |= {f"pressure_{wheel}_pa": 9e5 * brakes, f"pressure_demand_{wheel}_pa": 9e5 * brakes}
        channels |= {f"motor_torque_{wheel}_nm": -60.0 * pulses, f"motor_torque_demand_{wheel}_nm": -60.0 * pulses}
    return make_log("log", t, channels)
