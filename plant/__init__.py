"""The vehicle: submodels, model and node. No I/O in here."""
