"""Measured logs: read, brought to one table, and cut into drives and manoeuvres."""
