"""Sensors against the car's own motion: what is wrong between channels where no force was measured."""
