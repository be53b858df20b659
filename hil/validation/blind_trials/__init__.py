"""Takes drawn cases of hidden cars and gives how often `explain` is right: the one place that knows both."""

FAMILIES = (
    "null", "single", "two", "three", "onset", "unlisted", "confounded", "twin", "not_testable",
    "parameters", "gain", "calibration", "strangers", "strangers_single",
    "strangers_reference", "strangers_reference_single",
)  # fmt: skip
"""Families of trials; three score cases of ``single``, the last four are of cars that strangers wrote."""
