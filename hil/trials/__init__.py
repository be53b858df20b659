"""Blind trials of the study against the hidden car: the one place that knows both."""

FAMILIES = (
    "null", "single", "two", "three", "onset", "unlisted", "confounded", "twin", "not_testable",
    "parameters", "gain", "calibration",
)  # fmt: skip
"""Families of trials; the last three score cases of ``single``."""
