"""One look for page and figure: colours that a colour-blind reader tells apart, on white and on dark paper."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.report.report import Curve, Severity, Style, Trace

WHEEL_COLOURS = {"fl": "#0072B2", "fr": "#D55E00", "rl": "#009E73", "rr": "#AA4499"}
NEUTRAL = "#6E7781"
PALE = "#A8B3BE"
INK = "#1B2733"  # the page shows it as its ink, light on dark paper
SERIES = ("#0072B2", "#D55E00", "#009E73", "#AA4499", "#B8860B", "#56A0D3", "#7A5C3E", "#C2577A")
SEVERITY_COLOURS: dict[Severity, str] = {"info": "#6E7781", "ok": "#2F7FB8", "warning": "#C98A00", "error": "#C0392B"}

Dash = tuple[float, ...]
_DEMAND_DASHES: tuple[Dash, ...] = ((6, 3), (2, 2.5), (8, 3, 2, 3))
_ESTIMATE_DASH: Dash = (3, 2)


@dataclass(frozen=True)
class Stroke:
    """How one trace is drawn: colour, line width and dash lengths in px (empty: solid), markers only, steps."""

    colour: str
    width: float
    dash: Dash = ()
    points: bool = False
    steps: bool = False


def strokes(traces: Sequence[Trace | Curve]) -> list[Stroke]:
    """Give every trace of a panel its stroke: demands neutral dashes, wheels their own colour, a group one colour.

    What was measured is broad and pale. Beside wheels, what belongs to the whole car is drawn in ink.
    """
    colours = dict(WHEEL_COLOURS)
    wheels = {WHEEL_COLOURS[t.group] for t in traces if t.group in WHEEL_COLOURS}
    spare = [INK] * bool(wheels) + [c for c in SERIES if c not in wheels]
    demands = taken = 0
    result = []
    for index, trace in enumerate(traces):
        if trace.style == "demand":
            result.append(Stroke(NEUTRAL, 1.4, _DEMAND_DASHES[demands % len(_DEMAND_DASHES)]))
            demands += 1
            continue
        if trace.style == "measured":
            result.append(Stroke(PALE, 4.5))
            continue
        key = trace.group or f"#{index}"
        if key not in colours:
            colours[key] = spare[taken % len(spare)]
            taken += 1
        result.append(_coloured(colours[key], trace.style))
    return result


def _coloured(colour: str, style: Style) -> Stroke:
    if style == "estimate":
        return Stroke(colour, 1.6, _ESTIMATE_DASH)
    return Stroke(colour, 1.6, points=style == "points", steps=style == "steps")
