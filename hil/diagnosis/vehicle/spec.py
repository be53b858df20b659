"""The vehicle: its parameters, its nuisance parameters, and what its vehicle set does not state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, Floats, Log
from hil.diagnosis.vehicle.latency import Latency, latencies
from hil.diagnosis.vehicle.priors import BRAKE_K, CONSTANT_EPSILON_W, Nuisance
from plant.friction import mu_equilibrium
from plant.injection.theta import THETA
from plant.parameters.plant import PlantParameters
from plant.vectors import P

_CONSTANT_B_1_J = 2e-10
"""With `CONSTANT_EPSILON_W`, a rate of 20 1/s at which the friction settles."""
_FIXED_KG_M2 = 1e12
"""Yaw inertia of a car that cannot turn."""
_TURNING = (
    "vehicle_yaw_inertia_kg_m2", "vehicle_steering_ratio", "tyre_lky", "vehicle_slip_angle_share_front",
    "vehicle_slip_angle_share_rear", "tyre_side_stiffness_load", "zero_steering",
)  # fmt: skip
_STEERING = "steering.angle"


@dataclass(frozen=True, eq=False)
class Vehicle:
    """The nominal vehicle and its uncertainty.

    Attributes
    ----------
    parameters : of the plant.  p : the same, (PARAMETER.size,).
    nuisances : uncertain parameters with their priors.
    pad_temperature_matters : False where the brake has one gain and no friction model.
    remarks : unknown keys and assumed values, for the report.
    unstated : sections that the set does not state (`plant.effects.effect.Effect.baseline_section`).
    unlimited : limits that it does not state and that are out of reach.
    straight_line : lateral dynamics are off.
    suspension_stated : the set states every parameter of the suspension.
    latencies : of the frames of each of `LATENCY_NODES` behind those of the wheel speeds.
    stated : keys of the set as written there, by the name of what they state (`hil.diagnosis.vehicle.key_names`).
    """

    parameters: PlantParameters
    p: Floats
    nuisances: tuple[Nuisance, ...]
    pad_temperature_matters: bool
    remarks: tuple[str, ...] = ()
    unstated: tuple[str, ...] = ()
    unlimited: tuple[str, ...] = ()
    straight_line: bool = False
    suspension_stated: bool = True
    latencies: tuple[Latency, ...] = latencies({}, {}, measured=True)
    stated: Mapping[str, str] = field(default_factory=dict)

    @property
    def undiagnosable_effects(self) -> tuple[str, ...]:
        """Effects on unstated sections, and on the steering where the car has no lateral dynamics."""
        return tuple(
            effect.name
            for effect in THETA.effects
            if effect.baseline_section in self.unstated or (self.straight_line and _STEERING in effect.injection_points)
        )

    def with_motor_limits_from(self, logs: Sequence[Log]) -> "Vehicle":
        """The same car with the largest demand of the logs as the motors' peak torque, if the set does not state it.

        Fade-out at low speed is a share of the peak torque, so it needs a realistic value.
        """
        demands = [log.channels[name] for log in logs for name in MOTOR_DEMAND if name in log.channels]
        most = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in demands), default=0.0)
        if "motor_peak_torque_nm" not in self.unlimited or most == 0.0:
            return self
        motor = replace(self.parameters.motor, peak_torque_nm=most)
        parameters = replace(self.parameters, motor=motor)
        p = self.p.copy()
        p[P.motor_peak_torque_nm] = most
        return replace(self, parameters=parameters, p=p)

    def without_lateral_dynamics(self) -> "Vehicle":
        """The same car without lateral motion: a driver whose steering is not logged keeps it on its line."""
        p = self.p.copy()
        p[P.vehicle_yaw_inertia_kg_m2] = _FIXED_KG_M2
        nuisances = tuple(one for one in self.nuisances if one.name not in _TURNING)
        remark = "no log has the steering or shows a turn: the car is simulated without lateral motion"
        return replace(self, p=p, nuisances=nuisances, straight_line=True, remarks=(*self.remarks, remark))


def rest_friction(parameters: PlantParameters, temperature_k: float) -> float:
    """Coefficient of pad friction at rest, at a disc temperature in K."""
    pad = parameters.pad
    return mu_equilibrium(0.0, temperature_k, pad.a_1_ks, pad.b_1_j, pad.epsilon_w)


def with_constant_friction(parameters: PlantParameters) -> PlantParameters:
    """The same car with a constant pad friction: Ostermeyer's equation with a stiff equilibrium value."""
    mu, ambient = 0.38, parameters.friction_brake.ambient_k
    a = mu * _CONSTANT_B_1_J * CONSTANT_EPSILON_W / ambient
    pad = replace(
        parameters.pad, a_1_ks=a, b_1_j=_CONSTANT_B_1_J, c_1_s=0.0, gamma_k_w=(0.0, 0.0),
        epsilon_w=CONSTANT_EPSILON_W, heating_with_mu=0.0, temperature_of_disc=0.0,
    )  # fmt: skip
    return replace(parameters, pad=pad)


def with_gains(parameters: PlantParameters, gains: Mapping[str, float]) -> PlantParameters:
    """The same car with piston areas for brake ``gains`` by axle, N m at one wheel per Pa: gain = 2 mu eta A r."""
    brake = parameters.friction_brake
    is_constant = parameters.pad.epsilon_w >= CONSTANT_EPSILON_W
    mu = rest_friction(parameters, brake.ambient_k if is_constant else BRAKE_K)
    areas = list(brake.piston_area_m2)
    for k, axle in enumerate(("front", "rear")):
        if axle in gains:
            areas[k] = gains[axle] / (2.0 * mu * brake.efficiency * brake.effective_radius_m[k])
    return replace(parameters, friction_brake=replace(brake, piston_area_m2=(areas[0], areas[1])))
