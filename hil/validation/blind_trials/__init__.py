"""Takes drawn cases of the reference car and gives how often `explain` is right: the one place that knows both."""

FAMILIES = (
    "null", "single", "two", "three", "onset", "unlisted", "confounded", "twin", "not_testable",
    "parameters", "gain", "calibration",
)  # fmt: skip
"""Families of trials; the last three score cases of ``single``."""
