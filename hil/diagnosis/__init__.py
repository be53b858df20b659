"""Measured data against the simulation: what is wrong, why, the extended model, and what it gains."""
