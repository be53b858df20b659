"""The simulated car: as its vehicle set tells it, with an effect or without, replayed beside the measured one."""
