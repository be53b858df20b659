"""Parameter values of the vehicle: frozen dataclasses beside their TOML sets."""
