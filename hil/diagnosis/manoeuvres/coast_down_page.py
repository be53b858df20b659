"""The report of coast-downs: coefficients beside those stated, speed of each run, road load over speed."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.manoeuvres import stops
from hil.diagnosis.manoeuvres.coast_down import CoastDown
from hil.diagnosis.manoeuvres.coasting import CELL_S
from hil.report.report import Cell, Chart, Curve, Number, Report, Section, Table, Verdict
from hil.report.units import Display

_SENTENCE = {
    "none": "Rolling resistance and drag are as stated, within their tolerances and noise.",
    "cannot_tell_apart": "What slows the coasting car at any speed is not as stated: tyres, or pads that drag.",
    "unlisted": "What slows the coasting car with the square of its speed is not as stated: drag.",
}
_NAMES = {
    "f0": "f0, at any speed", "f2": "f2, with the speed squared", "rolling_resistance": "rolling resistance",
    "drag_area": "drag area Cd A", "slope": "slope along direction 1", "wind": "wind against direction 1",
}  # fmt: skip
_KMH = Display("km/h", 3.6)
_SHOWN = 8
"""Most runs with a chart of their own."""


def build_report(answer: CoastDown, sources: Sequence[str]) -> Report:
    """Build the report; ``sources`` are the names of the logs."""
    content = answer.json
    coast = content["coast_down"]
    numbers = [Number("Verdict", content["verdict"].replace("_", " "))]
    for name in ("f0", "f2", "rolling_resistance", "drag_area"):
        one = coast["estimates"][name]
        note = f"95 %: {_interval(one['ci95'])}; stated {one['stated']:.4g}"
        numbers.append(Number(_NAMES[name], _rounded(one["value"]), one["unit"], note))
    for error in content["held_out_error"].values():
        note = f"on coast-downs that no fit saw; as stated {error['before']:.3g}"
        numbers.append(Number("Held-out error of the speed", _rounded(error["after"]), "m/s", note))
    return Report(
        title="Coast-down: rolling resistance and drag",
        verdict=Verdict.PASSED if content["verdict"] == "none" else Verdict.INCONCLUSIVE,
        reason=_SENTENCE[content["verdict"]],
        numbers=tuple(numbers),
        sections=(*coast_section(coast), _charts(answer), *stops.section(content.get("stops", ())), _limits(content)),
        provenance={
            "logs": list(sources), "runs": len(answer.runs), "seconds": sum(run.length_s for run in answer.runs),
            "extension": content["extension"] or "not written", "remarks": content["remarks"],
        },
    )  # fmt: skip


def coast_section(coast: Mapping[str, Any]) -> tuple[Section, ...]:
    """Tables of ``coast_down`` of an answer."""
    estimates: tuple[tuple[Cell, ...], ...] = tuple(
        (
            _NAMES[name], _rounded(one["value"]), _interval(one["ci95"]), one["unit"], _rounded(one["stated"]),
            _interval(one["stated_ci95"]), round(one["sigmas"], 1),
        )
        for name, one in coast["estimates"].items()
    )  # fmt: skip
    head = ("coefficient", "found", "95 %", "unit", "stated", "as stated", "standard deviations")
    disturbance = coast["disturbance"]
    note = (
        f"Student's t; slow disturbance of {disturbance['sd_mps2']:.2g} m/s² and {disturbance['time_constant_s']:.2g} "
        f"s taken into account. Effective mass {coast['effective_mass_kg']:.0f} kg."
    )
    runs: tuple[tuple[Cell, ...], ...] = tuple(
        (
            one["log"], round(one["t_s"], 1), one["direction"], one["length_s"], round(3.6 * one["from_mps"], 1),
            round(3.6 * one["to_mps"], 1), _rounded(one["error_mps"]), _rounded(one["error_as_stated_mps"]),
        )
        for one in coast["runs"]
    )  # fmt: skip
    run_head = (
        "log", "t s", "direction", "length s", "from km/h", "to km/h", "error m/s", "error as stated m/s",
    )  # fmt: skip
    tables = (
        Table("Road load", head, estimates, note=note),
        Table("Coast-downs", run_head, runs, note="Root mean square, open loop from the measured speed at the start."),
    )
    return (Section("Coast-down", tables=tables, text=f"{coast['method']}."),)


def _charts(answer: CoastDown) -> Section:
    """Speed of each run, and the road load over the speed with its 95 % band."""
    fitted, mass = answer.fitted, answer.load.effective_kg
    top = max(float(np.nanmax(run.speed_mps)) for run in answer.runs)
    v = np.linspace(0.0, top, 60)
    columns = np.column_stack((np.ones_like(v), v**2))
    half = fitted.quantile * np.sqrt(np.maximum(np.sum((columns @ fitted.covariance[:2, :2]) * columns, axis=1), 0.0))
    force = columns @ np.array([answer.load.a_mps2, answer.load.b_1_m]) * mass
    stated = columns @ np.array([answer.stated_load.a_mps2, answer.stated_load.b_1_m]) * mass
    curves = (
        Curve("found", v, force, force - half * mass, force + half * mass, group="fl"),
        Curve("stated", v, stated, style="demand"),
    )
    charts = [Chart("Road load over speed", "speed", _KMH, "force", "N", curves)]
    for run, found, as_stated in list(zip(answer.runs, answer.found, answer.stated, strict=True))[:_SHOWN]:
        t_s: Floats = np.asarray(run.begin_s + (np.arange(len(run.speed_mps)) + 0.5) * CELL_S, np.float64)
        own = (
            Curve("measured", t_s, run.speed_mps, style="points"),
            Curve("stated", t_s, as_stated, group="rl"),
            Curve("found", t_s, found, group="fl"),
        )
        title = f"{run.log} at {run.begin_s:.0f} s, direction {run.direction}"
        charts.append(Chart(title, "time", "s", "speed", _KMH, own))
    return Section("Speed and road load", charts=tuple(charts), text="The band is the 95 % interval.")


def _limits(content: Mapping[str, Any]) -> Section:
    rows = tuple(
        [("missing channel", text) for text in content["missing"]] + [("remark", text) for text in content["remarks"]]
    )
    return Section("What these data cannot show", tables=(Table("Limits", ("what", "which"), rows),))


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _interval(ends: Sequence[float]) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}"
