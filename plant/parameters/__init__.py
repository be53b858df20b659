"""Parameters of the plant: frozen values, each with unit and bounds, and the sets that fill them."""

from plant.parameters.brakes import EhbParameters, FrictionBrakeParameters, OstermeyerParameters
from plant.parameters.chassis import SuspensionParameters, VehicleParameters, WheelParameters
from plant.parameters.electric import BatteryParameters, MotorParameters
from plant.parameters.plant import PlantParameters
from plant.parameters.sensing import SensorParameters
from plant.parameters.tyre import TyreParameters

__all__ = [
    "BatteryParameters",
    "EhbParameters",
    "FrictionBrakeParameters",
    "MotorParameters",
    "OstermeyerParameters",
    "PlantParameters",
    "SensorParameters",
    "SuspensionParameters",
    "TyreParameters",
    "VehicleParameters",
    "WheelParameters",
]
