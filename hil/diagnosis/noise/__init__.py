"""Noise: what it is made of, how likely a residual is by it, and its estimate."""
