"""Faults of signals and frames, one family a file, deterministic by seed."""
