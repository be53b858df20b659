"""Sensor and clock effects as pure functions of arrays."""
