"""Gives the controller's parameter values: frozen dataclasses beside their TOML sets."""
