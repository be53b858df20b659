"""A van with electro-mechanical brakes and one motor on its rear axle, of equations of its own."""

from hil.validation.strangers.brake_by_wire_van.van import BrakeByWireVan

__all__ = ["BrakeByWireVan"]
