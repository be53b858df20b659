"""Everything the plant is made of, as one frozen value."""

from dataclasses import dataclass

from plant.parameters.brakes import EhbParameters, FrictionBrakeParameters, OstermeyerParameters
from plant.parameters.chassis import SuspensionParameters, VehicleParameters, WheelParameters
from plant.parameters.electric import BatteryParameters, MotorParameters
from plant.parameters.sensing import SensorParameters
from plant.parameters.tyre import TyreParameters


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """The whole vehicle; one table of a parameter file for each field."""

    vehicle: VehicleParameters
    suspension: SuspensionParameters
    wheel: WheelParameters
    tyre: TyreParameters
    ehb: EhbParameters
    friction_brake: FrictionBrakeParameters
    pad: OstermeyerParameters
    motor: MotorParameters
    battery: BatteryParameters
    sensor: SensorParameters
