"""Courses over time by formula: what identification and life on a bench ask of a pedal, a motor or a brake."""

import math
from collections.abc import Callable
from dataclasses import dataclass

Points = tuple[tuple[float, float], ...]

SAMPLE_S = 0.01  # the nodes' period: what lies between two ticks is not seen
MOST_CYCLES = 10_000.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a generator; ``default`` None demands it."""

    name: str
    default: float | None = None
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True, slots=True)
class Generator:
    """A course by name: what it needs, and the function that makes its points."""

    parameters: tuple[Parameter, ...]
    make: Callable[..., Points]


def steps(start_s: float, low: float, high: float, count: float, hold_s: float, ramp_s: float) -> Points:
    """Stairs from ``low`` to ``high`` in ``count`` equal steps, each held, then back to ``low``."""
    if ramp_s >= hold_s:
        raise ValueError(f"ramp_s must be shorter than hold_s, got {ramp_s:g} s and {hold_s:g} s")
    number = round(count)
    points = [(start_s, low)]
    for k in range(1, number + 1):
        begin = start_s + (k - 1) * hold_s
        value = low + (high - low) * k / number
        points += [(begin, points[-1][1]), (begin + ramp_s, value)]
    end = start_s + number * hold_s
    return (*points, (end, high), (end + ramp_s, low))


def pulses(
    start_s: float, low: float, high: float, count: float, period_s: float, width_s: float, ramp_s: float
) -> Points:
    """Pulses from ``low`` to ``high``, ``width_s`` long without their two ramps."""
    if width_s + 2.0 * ramp_s > period_s:
        raise ValueError(
            f"width_s and two ramp_s must fit into period_s, got {width_s:g}, {ramp_s:g} and {period_s:g} s"
        )
    points: list[tuple[float, float]] = []
    for k in range(round(count)):
        begin = start_s + k * period_s
        up = begin + ramp_s
        points += [(begin, low), (up, high), (up + width_s, high), (up + width_s + ramp_s, low)]
    return tuple(points)


def triangle(start_s: float, low: float, high: float, count: float, period_s: float) -> Points:
    """Triangles from ``low`` up to ``high`` and back."""
    points = [(start_s, low)]
    for k in range(round(count)):
        points += [(start_s + (k + 0.5) * period_s, high), (start_s + (k + 1) * period_s, low)]
    return tuple(points)


def chirp(start_s: float, duration_s: float, from_hz: float, to_hz: float, mean: float, amplitude: float) -> Points:
    """Sine whose frequency runs linearly: ``mean + amplitude sin(2 pi (f0 t + (f1 - f0) t^2 / (2 T)))``."""
    if max(from_hz, to_hz) > 0.25 / SAMPLE_S:
        raise ValueError(f"a node's period of {SAMPLE_S:g} s carries at most {0.25 / SAMPLE_S:g} Hz")
    points = [(start_s, 0.0), (start_s, mean)] if start_s > 0.0 else [(start_s, mean)]
    for k in range(1, int(duration_s / SAMPLE_S) + 1):
        t = k * SAMPLE_S
        phase = 2.0 * math.pi * (from_hz * t + (to_hz - from_hz) * t * t / (2.0 * duration_s))
        points.append((start_s + t, mean + amplitude * math.sin(phase)))
    return (*points, (start_s + duration_s, 0.0))


_START = Parameter("start_s", None, 0.0, 3600.0)
_LEVELS = (Parameter("low", 0.0), Parameter("high"))
_COUNT = Parameter("count", 1.0, 1.0, MOST_CYCLES)
_PERIOD = Parameter("period_s", None, 0.02, 3600.0)
_RAMP = Parameter("ramp_s", 0.0, 0.0, 3600.0)

GENERATORS: dict[str, Generator] = {
    "steps": Generator((_START, *_LEVELS, _COUNT, Parameter("hold_s", None, 0.02, 3600.0), _RAMP), steps),
    "pulses": Generator((_START, *_LEVELS, _COUNT, _PERIOD, Parameter("width_s", None, 0.0, 3600.0), _RAMP), pulses),
    "triangle": Generator((_START, *_LEVELS, _COUNT, _PERIOD), triangle),
    "chirp": Generator(
        (
            _START,
            Parameter("duration_s", None, 0.1, 3600.0),
            Parameter("from_hz", None, 0.0, 25.0),
            Parameter("to_hz", None, 0.0, 25.0),
            Parameter("mean", 0.0),
            Parameter("amplitude"),
        ),
        chirp,
    ),
}
"""Courses by name, as a scenario writes them: ``{ triangle = { start_s = 1.0, high = 20e5, period_s = 4.0 } }``."""
