"""The controller's whole parameter set."""

from dataclasses import dataclass

from ecu.parameters.control import BlendParameters, PedalParameters, SupervisionParameters
from ecu.parameters.vehicle import FrictionBrakeParameters, MotorParameters, VehicleParameters


@dataclass(frozen=True, slots=True)
class EcuParameters:
    """Everything the controller is told; read from a TOML set with one table for each field."""

    vehicle: VehicleParameters
    friction_brake: FrictionBrakeParameters
    motor: MotorParameters
    pedal: PedalParameters
    blend: BlendParameters
    supervision: SupervisionParameters
