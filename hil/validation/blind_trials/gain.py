"""What the extended model gains on manoeuvres that no fit saw, against a model that knows what was hidden."""

from collections.abc import Sequence

from hil.validation.blind_trials.metrics import Metric, Metrics, Record, median, share
from hil.validation.blind_trials.reading import is_top

_LEAST_GAIN = 0.02
"""Share of its own error that the oracle must take away for a case to tell anything."""


def gain(records: Sequence[Record]) -> Metrics:
    """Against the oracle, against the nominal vehicle, and against the best wrong cause.

    ``never_1_percent_worse`` holds every channel by itself to it, ``all_channels_no_worse`` their mean.
    """
    reached = [record for record in records if record["reached"]]
    return {
        "gain_of_oracle": gain_of_oracle(reached, 0.9),
        "gain_of_oracle_where_named": gain_of_oracle([record for record in reached if is_top(record)], None),
        "never_1_percent_worse": share(records, _no_worse, 1.0),
        "all_channels_no_worse": share(records, _together_no_worse),
        "beats_best_wrong": share([record for record in records if record["causes"]], _beats_wrong),
    }


def gain_of_oracle(records: Sequence[Record], mark: float | None) -> Metric:
    """Median share of the oracle's gain; cases with no oracle, or where it hardly gains, tell nothing."""
    ratios = [ratio for ratio in map(_of_oracle, records) if ratio is not None]
    return median(ratios, mark)


def _of_oracle(record: Record) -> float | None:
    """Errors taken away over those that the oracle takes away, each in units of what the oracle leaves."""
    oracle, gains = record.get("oracle"), record["held_out_error"]
    if not oracle or not gains:
        return None
    channels = [name for name in gains if oracle.get(name, 0.0) > 0.0]
    before = sum(gains[name]["before"] / oracle[name] for name in channels)
    after = sum(gains[name]["after"] / oracle[name] for name in channels)
    if before - len(channels) < _LEAST_GAIN * len(channels):
        return None
    return float((before - after) / (before - len(channels)))


def _no_worse(record: Record) -> bool:
    return all(g["after"] <= 1.01 * g["before"] for g in record["held_out_error"].values())


def _together_no_worse(record: Record) -> bool:
    shares = [g["after"] / g["before"] for g in record["held_out_error"].values() if g["before"] > 0.0]
    return float(sum(shares)) <= 1.01 * len(shares)


def _beats_wrong(record: Record) -> bool:
    """Over all channels together, each against its own nominal error."""
    gains = [g for g in record["held_out_error"].values() if g["best_wrong"] is not None and g["before"] > 0.0]
    own = sum((g["after"] / g["before"]) ** 2 for g in gains)
    other = sum((g["best_wrong"] / g["before"]) ** 2 for g in gains)
    return bool(gains) and own < other
