"""What such data cannot show, and which channel or manoeuvre would."""

from collections.abc import Iterable

from hil.diagnosis.data.log import MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND
from hil.diagnosis.sensor_consistency.motion import Motion
from plant.injection.theta import THETA

_SENSORS = {"imu_gain", "imu_bias", "imu_filter", "imu_position", "timestamp_offset", "wrong_scale", "tyre_radius"}
_WHERE = {
    "pressure": "the pressure at every wheel",
    "motor": "the torque of every motor",
    "driver": "the driver's pedal",
    "wheel": "wheel speeds of 100 Hz or more, and a fast coast-down",
    "imu": "more transients",
}


def needs(motion: Motion, named: Iterable[str]) -> dict[str, str]:
    """Effect -> what it would take, for every effect that was not compared."""
    seen = set(named)
    if motion.has("ax_mps2"):
        seen |= {"imu_gain", "imu_bias", "imu_filter", "timestamp_offset", "wrong_scale"}
        if motion.has("yaw_rate_rad_s"):
            seen.add("imu_position")
    if motion.has("wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"):
        seen.add("tyre_radius")
    there = set.intersection(*(set(log.channels) for log in motion.logs))
    forces = [
        text
        for text, names in (
            ("pressure at every wheel", PRESSURE), ("torque of every motor or of the drive", MOTOR_TORQUE),
        )
        if not set(names) <= there
    ]  # fmt: skip
    found = {}
    for effect in THETA.effects:
        if effect.name in seen:
            continue
        if effect.sensing:
            channel = ", ".join(_WHERE[node] for node in effect.nodes if node in _WHERE)
            found[effect.name] = f"measure {channel}; drive {effect.manoeuvre}"
        else:
            found[effect.name] = f"measure {' and '.join(forces) or 'all forces'}; drive {effect.manoeuvre}"
    return found


def missing(motion: Motion) -> list[str]:
    """What each missing channel costs."""
    there = set.intersection(*(set(log.channels) for log in motion.logs))
    said = {
        "ax_mps2": "without acceleration: nothing is said of the accelerometer",
        "speed_mps": "without a ground speed: accelerometer scale and tyre radius of all wheels are tied",
        "yaw_rate_rad_s": "without yaw rate: unlike wheels and a bend look alike",
        "ay_mps2": "without lateral acceleration: a turned sensor shows along the car only",
        "throttle": "without throttle: drag and engine braking are one",
    }
    costs = [text for name, text in said.items() if name not in there]
    if not set(PRESSURE) <= there:
        demanded = " (only its demand)" if set(PRESSURE_DEMAND) <= there else ""
        costs.append(
            f"without pressure at the wheels{demanded}: pads, calipers and hydraulics are one gain, or nothing"
        )
    if not set(MOTOR_TORQUE) <= there:
        costs.append("without the torque that drives the car: mass, drag and grade are tied")
    return costs
