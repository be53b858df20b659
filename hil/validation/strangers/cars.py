"""The strangers' cars by name."""

from hil.validation.strangers.car import StrangerCar

CARS: dict[str, StrangerCar] = {}
