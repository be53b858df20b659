"""Takes frames and gives them with faults, deterministic by seed: one family a file."""
