"""Logs with something hidden in them: another car, another integrator, other sensors than the engine's own plant."""
