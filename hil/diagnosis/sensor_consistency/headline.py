"""The answer of a comparison of sensors in one sentence: each channel that differs, and by what."""

from collections.abc import Sequence

from hil.diagnosis.result.phrases import sentence
from hil.diagnosis.sensor_consistency.labels import Cause
from plant.injection.theta import THETA

_AGREE = "The sensors agree with the car's own motion within noise."


def headline(causes: Sequence[Cause]) -> str:
    """Channels with the effects that explain their error; that they agree where there is none."""
    by_channel: dict[str, list[str]] = {}
    for cause in causes:
        by_channel.setdefault(", ".join(cause.channels), []).append(_words(cause))
    if not causes:
        return _AGREE
    return "; ".join(f"{channel}: {', '.join(words)}" for channel, words in by_channel.items()) + "."


def _words(cause: Cause) -> str:
    if cause.labels[0].effect == "wrong_scale":
        low, high = sorted((1.0 + cause.low, 1.0 + cause.high))
        return f"reads {1.0 + cause.value:.2f} times the true value (95 %: {low:.2f} to {high:.2f})"
    others = cause.indistinguishable[1:]
    return " or ".join([sentence(cause.as_json()), *(_lower(THETA.effect(name).title) for name in others)])


def _lower(text: str) -> str:
    return text if text[:2].isupper() else text[0].lower() + text[1:]
