"""The controller's whole parameter set."""

from dataclasses import dataclass

from ecu.parameters.control import BlendParameters, PedalParameters, SupervisionParameters
from ecu.parameters.observer import (
    CompensationParameters,
    JointFilterParameters,
    PaperObserverParameters,
    SignalParameters,
    TyreParameters,
)
from ecu.parameters.plausibility import PlausibilityParameters
from ecu.parameters.vehicle import FrictionBrakeParameters, MotorParameters, VehicleParameters


@dataclass(frozen=True, slots=True, eq=False)
class EcuParameters:
    """Everything the controller is told; read from a TOML set with one table for each field.

    Compared by identity, so that what is derived from a set can be kept beside it at no cost.
    """

    vehicle: VehicleParameters
    friction_brake: FrictionBrakeParameters
    motor: MotorParameters
    pedal: PedalParameters
    blend: BlendParameters
    supervision: SupervisionParameters
    plausibility: PlausibilityParameters
    tyre: TyreParameters
    signal: SignalParameters
    joint_filter: JointFilterParameters
    paper_observer: PaperObserverParameters
    compensation: CompensationParameters
