"""Numbers that the reference car and the plant call differently, and effects that only one of them has."""

from collections.abc import Mapping
from typing import Any

_NUMBERS = {
    ("imu_bias", "bias_mps2"): "ax_mps2", ("imu_position", "distance_m"): "x_m", ("imu_filter", "lag_s"): "time_s",
    ("timestamp_offset", "time_s"): "delay_s", ("clock_drift", "rate"): "share",
}  # fmt: skip
_OF_ANY_PHASE = ("hot_spot",)
"""Effects whose sign is half a turn of a phase that nobody knows."""


def numbers(hidden: Mapping[str, Any]) -> dict[str, float]:
    """Values of a hidden cause by the plant's name; one that the plant has not (an amplitude at a phase) keeps its own.

    Parameters
    ----------
    hidden : a cause of the sealed answer.
    """
    effect = hidden["effect"]
    values = {_NUMBERS.get((effect, name), name): float(p["value"]) for name, p in hidden["parameters"].items()}
    return {name: abs(value) for name, value in values.items()} if effect in _OF_ANY_PHASE else values
