"""What a car measures, out of a replay: the model's signals behind the sensing effects, without noise."""

import numpy as np

from plant.effects.effect import GROUND
from plant.injection.bank import NO_TERMS
from plant.injection.plugin import NO_PLUGINS
from plant.injection.sensing_chain import Chain
from plant.injection.theta import THETA
from plant.layout import Vector
from plant.model import NEUTRAL, Scene, replay
from plant.open_loop_manoeuvres import Drive
from plant.road import DRY, road_table

WHEELS = ("fl", "fr", "rl", "rr")
CHANNELS: dict[str, tuple[str, ...]] = {  # node: its signals
    "wheel": tuple(f"wheel_speed_{w}_rad_s" for w in WHEELS),
    "imu": ("ax_mps2", "ay_mps2", "yaw_rate_rad_s"),
    "pressure": tuple(f"pressure_{w}_pa" for w in WHEELS),
    "motor": tuple(f"motor_torque_{w}_nm" for w in WHEELS),
    "driver": ("pedal",),
    GROUND: ("speed_mps",),
}
_COLUMNS = (
    *(f"sensed_wheel_speed_rad_s_{w}" for w in WHEELS),
    "imu_longitudinal_mps2", "imu_lateral_mps2", "imu_yaw_rate_rad_s",
    *(f"sensed_pressure_pa_{w}" for w in WHEELS),
    *(f"sensed_motor_nm_{w}" for w in WHEELS),
    "speed_mps",
)  # fmt: skip
NAMES = tuple(name for names in CHANNELS.values() for name in names)


def simulate(drive: Drive, theta: Vector = NEUTRAL, terms: Vector = NO_TERMS, plugins: Vector = NO_PLUGINS) -> Vector:
    """Signals of all cars, shape (cars, samples, len(NAMES)); one car a row of ``theta``."""
    steps = round(drive.row_s * 1e3)
    thetas = theta.reshape(-1, theta.shape[-1])
    road = road_table(DRY) if drive.road is None else drive.road
    scene = Scene(road=road, theta=thetas, terms=terms, plugins=plugins)
    model = replay(drive.start, drive.rows, drive.parameters, _COLUMNS, scene, steps=steps)
    time_s: Vector = np.arange(len(drive.rows), dtype=np.float64) * drive.row_s
    table: Vector = np.insert(model, model.shape[2] - 1, drive.pedal, axis=2)
    for k, numbers in enumerate(thetas):
        car: Vector = table[k]
        chain = Chain(numbers, THETA)
        at = 0
        for node, names in CHANNELS.items():
            if chain.touches(node):
                true: Vector = car[:, at : at + len(names)]
                car[:, at : at + len(names)] = chain.sense(node, time_s, true)
            at += len(names)
    return table


def noise(signals: Vector) -> Vector:
    """Standard deviation of one sample of each channel, as of the paper's car and its bus; shape of ``signals``.

    Wheel speeds 0.1 % and half a step of the bus, 0.02 m/s2, 1 mrad/s, 0.1 bar, 0.9 N m, 0.05 % of the pedal, 0.05 m/s.
    """
    sigma = np.empty_like(signals)
    sigma[..., :4] = np.hypot(0.001 * signals[..., :4], 0.01)
    sigma[..., 4:] = [0.02, 0.02, 0.001, *[1e4] * 4, *[0.9] * 4, 0.0005, 0.05]
    return sigma
