"""Injection points: named places of the model where ``value' = value * factor + addend``.

Each has one place in the equations. Every number of the parameter set is an injection point too, by its own name, where
factor and addend are applied to the number itself.
"""

INJECTION_POINTS: dict[str, tuple[int, str, str]] = {  # name: (size, unit, what)
    "road.grade": (1, "", "rise over run under the car"),
    "road.friction": (4, "", "friction scale of the road under a wheel"),
    "air.speed": (1, "m/s", "speed of the car against the air"),
    "body.force": (1, "N", "sum of all forces along the car"),
    "steering.angle": (1, "rad", "angle of the front wheels"),
    "contact.speed": (4, "m/s", "speed of the wheel centre along the wheel"),
    "wheel.radius": (4, "m", "rolling radius"),
    "wheel.load": (4, "N", "load on the tyre"),
    "wheel.rolling_torque": (4, "N m", "rolling resistance"),
    "tyre.stiffness": (4, "N", "longitudinal slip stiffness"),
    "tyre.force": (4, "N", "longitudinal tyre force"),
    "tyre.side_force": (4, "N", "lateral tyre force"),
    "hydraulics.demand": (4, "Pa", "pressure that the control follows"),
    "hydraulics.rate": (4, "Pa/s", "rate of the pressure"),
    "brake.pressure": (4, "Pa", "pressure that clamps"),
    "friction.mu": (4, "", "pad friction that acts"),
    "brake.torque": (4, "N m", "friction torque of the sliding brake, a magnitude"),
    "motor.demand": (4, "N m", "torque demand"),
    "motor.available": (4, "N m", "torque the motor is able to give, a magnitude"),
    "motor.torque": (4, "N m", "torque at the wheel"),
    "imu.ax": (1, "m/s2", "longitudinal specific force before the sensor's filter"),
    "imu.ay": (1, "m/s2", "lateral specific force before the sensor's filter"),
    "imu.yaw_rate": (1, "rad/s", "yaw rate before the sensor's filter"),
    "sensor.wheel_speed": (4, "rad/s", "wheel speed as sensed"),
    "sensor.pressure": (4, "Pa", "pressure as sensed"),
    "sensor.motor_torque": (4, "N m", "motor torque as the current tells it"),
}


def field(point: str) -> str:
    """Name of an injection point in `plant.inject.J`: dots become underscores."""
    return point.replace(".", "_")


FIELDS = {field(name): 2 * size for name, (size, _, _) in INJECTION_POINTS.items()}
