"""A saloon with hydraulic brakes and drums behind, of equations of its own."""

from hil.validation.strangers.hydraulic_saloon.saloon import HydraulicSaloon

__all__ = ["HydraulicSaloon"]
