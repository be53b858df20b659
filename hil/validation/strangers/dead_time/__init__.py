"""A utility vehicle without springs, motors with a dead time in its wheels (`car.DeadTime`)."""

from hil.validation.strangers.dead_time.car import DeadTime

__all__ = ["DeadTime"]
