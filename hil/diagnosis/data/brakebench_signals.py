"""Signals of our own DBC as channels."""

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.log import DecodedLog

_BAR = 1e5
_SINGLE = {
    "BODY_MOTION.LONGITUDINAL_ACCELERATION": ("ax_mps2", 1.0),
    "BODY_MOTION.LATERAL_ACCELERATION": ("ay_mps2", 1.0),
    "BODY_MOTION.YAW_RATE": ("yaw_rate_rad_s", 1.0),
    "STEERING.STEERING_WHEEL_ANGLE": ("steer_rad", 1.0),
    "BRAKE_PEDAL.PEDAL_TRAVEL_1": ("pedal", 0.01),
    "BATTERY_STATUS.STATE_OF_CHARGE": ("soc", 0.01),
}
_WHEEL = {
    "WHEEL_SPEED_{axle}.WHEEL_SPEED_{wheel}": ("wheel_speed_{w}_rad_s", 1.0),
    "EHB_PRESSURE_{axle}.PRESSURE_{wheel}": ("pressure_{w}_pa", _BAR),
    "EHB_DEMAND_{axle}.PRESSURE_DEMAND_{wheel}": ("pressure_demand_{w}_pa", _BAR),
    "MOTOR_DEMAND_{axle}.TORQUE_DEMAND_{wheel}": ("motor_torque_demand_{w}_nm", 1.0),
}


def _signals(torque_constant_nm_a: float) -> dict[str, tuple[str, float]]:
    """Channel and factor to SI by signal."""
    names = dict(_SINGLE)
    for wheel in WHEELS:
        axle = "FRONT" if wheel[0] == "f" else "REAR"
        for signal, (channel, factor) in _WHEEL.items():
            names[signal.format(axle=axle, wheel=wheel.upper())] = (channel.format(w=wheel), factor)
        current = f"MOTOR_STATUS_{axle}.CURRENT_{wheel.upper()}"
        names[current] = (f"motor_torque_{wheel}_nm", torque_constant_nm_a)
    return names


def own_sources() -> tuple[dict[str, str], dict[str, str]]:
    """Signals and their units by channel."""
    signals = {channel: signal for signal, (channel, _) in _signals(1.0).items()}
    units = {channel: {_BAR: "bar", 0.01: "%"}.get(factor, "") for channel, factor in _signals(1.0).values()}
    return signals, {c: "A" if ".CURRENT_" in signals[c] else unit for c, unit in units.items()}


def own_channels(log: DecodedLog, torque_constant_nm_a: float) -> dict[str, tuple[Floats, Floats]]:
    """Times (s) and SI values by channel; the motors' torque is their current times the torque constant."""
    series = {}
    for signal, (channel, factor) in _signals(torque_constant_nm_a).items():
        if signal in log.columns and len(log.columns[signal].rows) > 1:
            t, values = log.series(signal)
            order = np.argsort(t, kind="stable")
            series[channel] = (t[order], np.asarray(values, np.float64)[order] * factor)
    return series
