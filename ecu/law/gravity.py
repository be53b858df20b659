"""Gravity as the controller takes it."""

GRAVITY_MPS2 = 9.80665
"""Standard gravity (CGPM 1901), in which sensors and data sheets state g. The plant's road has 9.81
(`plant.vehicle.GRAVITY_MPS2`): the controller does not know the gravity of the place either."""
