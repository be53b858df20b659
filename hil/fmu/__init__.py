"""FMUs: plant and controller for other people's benches, and their plants in ours."""
