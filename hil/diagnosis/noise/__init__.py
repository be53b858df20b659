"""Noise: takes residuals of a simulation; gives their noise model, innovations and log-likelihood."""
