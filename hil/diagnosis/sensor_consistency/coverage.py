"""Coverage: which effects such data cannot show, and which channel or manoeuvre would show them."""

from collections.abc import Iterable

from hil.diagnosis.data.log import MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND
from hil.diagnosis.sensor_consistency.motion import Motion, measured_channels
from plant.injection.theta import THETA

_CHANNELS_OF_NODE = {
    "pressure": "the pressure at every wheel",
    "motor": "the torque of every motor",
    "driver": "the driver's pedal",
    "wheel": "wheel speeds of 100 Hz or more, and a fast coast-down",
    "imu": "more transients",
}


def needs(motion: Motion, named: Iterable[str]) -> dict[str, str]:
    """Effect -> channels and manoeuvre that would show it, for every effect that was neither named nor tested."""
    tested = set(named)
    if motion.has("ax_mps2"):
        tested |= {"imu_gain", "imu_bias", "imu_filter", "timestamp_offset", "wrong_scale"}
        if motion.has("yaw_rate_rad_s"):
            tested.add("imu_position")
    if motion.has("wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"):
        tested.add("tyre_radius")
    measured = measured_channels(motion.logs)
    forces = [
        text
        for text, names in (
            ("pressure at every wheel", PRESSURE), ("torque of every motor or of the drive", MOTOR_TORQUE),
        )
        if not set(names) <= measured
    ]  # fmt: skip
    of_force = " and ".join(forces) or "all forces"
    untested = [effect for effect in THETA.effects if effect.name not in tested]
    channels = {
        effect.name: ", ".join(_CHANNELS_OF_NODE[node] for node in effect.nodes if node in _CHANNELS_OF_NODE)
        if effect.sensing
        else of_force
        for effect in untested
    }
    return {effect.name: f"measure {channels[effect.name]}; drive {effect.manoeuvre}" for effect in untested}


def missing(motion: Motion) -> list[str]:
    """The consequence of each channel that was not measured."""
    measured = measured_channels(motion.logs)
    consequences = {
        "ax_mps2": "without acceleration: no error of the accelerometer can be detected",
        "speed_mps": "without a ground speed: accelerometer scale and tyre radius of all wheels are indistinguishable",
        "yaw_rate_rad_s": "without yaw rate: unequal wheel radii and a bend look alike",
        "ay_mps2": "without lateral acceleration: a rotated sensor shows along the car only",
        "throttle": "without throttle: drag and engine braking are one parameter",
    }
    texts = [text for name, text in consequences.items() if name not in measured]
    if not set(PRESSURE) <= measured:
        demanded = " (only its demand)" if set(PRESSURE_DEMAND) <= measured else ""
        texts.append(f"without pressure at the wheels{demanded}: pads, calipers and hydraulics are one gain at most")
    if not set(MOTOR_TORQUE) <= measured:
        texts.append("without the torque that drives the car: mass, drag and grade are indistinguishable")
    return texts
