"""A short log in canonical channels: known pulses of brakes and motors."""

import numpy as np

from hil.diagnosis.data.log import Log, make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.spec import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
FOLLOWED = (("pressure", "pa"), ("motor_torque", "nm"))


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


def log_as_driven(vehicle: Vehicle, radius_m: float) -> Log:
    """The same pulses as brakes and motors follow them, so that what drives the car is what was measured."""
    log = log_of_pulses()
    rig = Simulator(prepare([log], radius_m), vehicle)
    followed = [(quantity, unit, wheel) for quantity, unit in FOLLOWED for wheel in WHEELS]
    values = rig.states(nominal(vehicle), [f"state.{quantity}_{unit}_{wheel}" for quantity, unit, wheel in followed])
    told = [f"{quantity}_{wheel}_{unit}" for quantity, unit, wheel in followed]
    rows = len(values)
    channels = {name: column[:rows] for name, column in log.channels.items()}
    return make_log("log", log.t_s[:rows], channels | dict(zip(told, values.T, strict=True)))
