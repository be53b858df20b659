"""The numbers of a vehicle set by which its logs are tried."""

import numpy as np

from hil.diagnosis.data.trial.motion import Car
from hil.diagnosis.vehicle.priors import BRAKE_K, CONSTANT_EPSILON_W
from hil.diagnosis.vehicle.spec import Vehicle, rest_friction


def car_of(vehicle: Vehicle) -> Car:
    """The numbers of a vehicle set."""
    parameters = vehicle.parameters
    body, brake = parameters.vehicle, parameters.friction_brake
    constant = parameters.pad.epsilon_w >= CONSTANT_EPSILON_W
    pads = rest_friction(parameters, brake.ambient_k if constant else BRAKE_K)
    gain = 2.0 * pads * brake.efficiency * np.multiply(brake.piston_area_m2, brake.effective_radius_m)
    return Car(
        float(parameters.wheel.rolling_radius_m), float(body.mass_kg), float(np.mean(body.track_m)),
        np.repeat(gain, 2), float(body.steering_ratio * sum(body.cog_to_axle_m)),
    )  # fmt: skip
