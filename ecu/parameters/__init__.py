"""Parameter values of the controller: frozen dataclasses beside their TOML sets."""
