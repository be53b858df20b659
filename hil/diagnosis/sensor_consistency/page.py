"""The report of a comparison of sensors: measured against predicted, the stops, parameters, relations, limits."""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.manoeuvres import stops
from hil.diagnosis.manoeuvres.coast_down_page import coast_section
from hil.diagnosis.result.channels_table import channels_section
from hil.diagnosis.result.page_parts import (
    EXTENDED,
    NOMINAL,
    binned_curve,
    comparison_panels,
    limits,
    log_lane,
    rounded,
)
from hil.diagnosis.sensor_consistency.braking import APPLIED_PA, BrakingModel
from hil.diagnosis.sensor_consistency.check import Consistency
from hil.diagnosis.sensor_consistency.held_out import HeldOutError
from hil.diagnosis.sensor_consistency.threshold import THRESHOLD
from hil.report.report import Cell, Chart, Curve, Number, Panel, Report, Section, Table, Trace, Verdict
from hil.report.units import BAR, Display, Unit

_TITLE = {
    "ax_mps2": "Longitudinal acceleration", "ay_mps2": "Lateral acceleration", "yaw_rate_rad_s": "Yaw rate",
    "speed_in_stops": "Speed in the stops",
}  # fmt: skip
_UNIT: dict[str, Unit] = {"m/s": Display("km/h", 3.6), "rad/s": Display("deg/s", 180.0 / np.pi), "m/s2": "m/s²"}
_WINDOW_S = 25.0
_STOPS_SHOWN = 6


def build_report(answer: Consistency, sources: Sequence[str]) -> Report:
    """Build the report; ``sources`` are the names of the logs."""
    content = answer.json
    return Report(
        title="Measured sensors against the car's own motion",
        verdict={"none": Verdict.PASSED, "named": None}.get(content["verdict"], Verdict.INCONCLUSIVE),
        reason=content["headline"],
        numbers=tuple(_numbers(answer)),
        sections=(
            _overview(answer), *_details(answer), _parameters(answer), _relations(answer),
            *stops.section(content.get("stops", ())),
            *(coast_section(content["coast_down"]) if "coast_down" in content else ()),
            channels_section(content), _limits(answer),
        ),
        provenance={
            "logs": list(sources), "segments": answer.motion.segments,
            "seconds": round(len(answer.motion.t_s) * answer.motion.cell_s, 1),
            "extension": content["extension"] or "not written", "remarks": content["remarks"],
        },
    )  # fmt: skip


def _numbers(answer: Consistency) -> list[Number]:
    numbers = [Number("Verdict", answer.json["verdict"].replace("_", " "))]
    for cause in answer.json["causes"]:
        for name, entry in cause["parameters"].items():
            label = f"{', '.join(cause['channels'])}: {cause['title']}"
            note = f"{name.replace('_', ' ')}; 95 %: {_interval(entry)}"
            numbers.append(Number(label, rounded(entry["value"]), entry["unit"], note=note))
    for error in answer.errors:
        if error.before > 0.0 and error.held_out < 0.8 * error.before:
            removed = round(100.0 * (1.0 - error.held_out / error.before), 1)
            label, note = f"{_title(error)}: held-out error removed", "on manoeuvres that no fit saw"
            numbers.append(Number(label, removed, "%", note=note))
    return numbers


def _title(error: HeldOutError) -> str:
    return _TITLE.get(error.channel, error.channel.replace("_", " "))


def _interval(entry: dict[str, list[float]]) -> str:
    low, high = entry["ci95"]
    return f"{low:.3g} to {high:.3g}"


def _error_of(answer: Consistency, channel: str) -> HeldOutError | None:
    return next((error for error in answer.errors if error.channel == channel), None)


def _braking(answer: Consistency) -> BrakingModel | None:
    result = answer.models.get("braking")
    return result.model if result is not None and isinstance(result.model, BrakingModel) else None


def _time(answer: Consistency) -> Floats:
    """(cells,) all logs, one after the other."""
    return np.arange(len(answer.motion.t_s)) * answer.motion.cell_s


def _panels(error: HeldOutError, t_s: Floats, rows: slice) -> list[Panel]:
    models = {"nominal": error.nominal[rows], "extended": error.fitted[rows]}
    return comparison_panels(_title(error), _UNIT[error.unit], t_s[rows], error.measured[rows], models)


def _overview(answer: Consistency) -> Section:
    t_s, rows = _time(answer), slice(None)
    panels = [Panel("Speed", _UNIT["m/s"], (Trace("wheels", t_s, answer.motion.speed_mps, group=EXTENDED),))]
    for error in answer.errors:
        if error.channel != "speed_in_stops":
            panels += _panels(error, t_s, rows)
    motion = answer.motion
    begins = t_s[motion.log_start > 0.5].tolist()
    names = [log.name for log in motion.logs]
    return Section(
        "Measured against predicted", panels=tuple(panels),
        timeline=(log_lane(names, begins, float(t_s[-1])),),
        text="Each sensor predicted from the wheels' motion alone on a flat road, with nominal and with fitted "
        "parameters. The residual of the extended model is the road's slope and noise.",
    )  # fmt: skip


def _details(answer: Consistency) -> list[Section]:
    """The window in which the acceleration changes most, and the stops with the highest pressure."""
    motion, t_s = answer.motion, _time(answer)
    sections = []
    error = _error_of(answer, "ax_mps2")
    if error is not None and t_s[-1] > 1.5 * _WINDOW_S:
        size = int(_WINDOW_S / motion.cell_s)
        power = np.convolve(np.gradient(motion.accel_mps2) ** 2 * motion.moving, np.ones(size), "valid")
        first = int(np.argmax(power))
        panels = _panels(error, t_s, slice(first, first + size))
        sections.append(Section("Detail: the largest changes of acceleration", panels=tuple(panels)))
    model, error = _braking(answer), _error_of(answer, "speed_in_stops")
    if model is not None and error is not None:
        charts = []
        for stop in sorted(model.stops, key=lambda s: -float(model.pressure[slice(*s)].max()))[:_STOPS_SHOWN]:
            rows = slice(*stop)
            curves = (
                Curve("measured", motion.t_s[rows], error.measured[rows], style="measured"),
                Curve("nominal", motion.t_s[rows], error.nominal[rows], group=NOMINAL),
                Curve("extended", motion.t_s[rows], error.fitted[rows], group=EXTENDED),
            )
            name, begin_s = motion.logs[int(motion.log_id[stop[0]])].name, motion.t_s[stop[0]]
            title = f"{name}, stop at {begin_s:.0f} s, {float(model.pressure[rows].max()) * 1e-5:.1f} bar"
            charts.append(Chart(title, "time in the log", "s", "speed", _UNIT["m/s"], curves))
        text = "Each stop is simulated open loop from its measured initial speed."
        sections.append(Section("Stops: measured, nominal and extended", charts=tuple(charts), text=text))
    return sections


def _parameters(answer: Consistency) -> Section:
    content = answer.json
    listed = [("cause", one) for one in content["causes"]] + [("rival", one) for one in content["rivals"]]
    parameters: list[tuple[Cell, ...]] = [
        (
            kind, one["title"], ", ".join(one["channels"]), name, rounded(entry["value"]), _interval(entry),
            entry["unit"], round(100.0 * one["probability"], 1),
        )
        for kind, one in listed
        for name, entry in one["parameters"].items()
    ]  # fmt: skip
    head: tuple[str, ...] = ("", "effect", "channel", "parameter", "value", "95 %", "unit", "probability %")
    tables = [Table("Causes and rivals", head, tuple(parameters))]
    errors: list[tuple[Cell, ...]] = [
        (
            residual["channel"], residual["unit"], rounded(residual["rms"]), rounded(error["after"]), _interval(error),
            None if error["best_wrong"] is None else rounded(error["best_wrong"]), residual["pattern"],
        )
        for residual, error in zip(content["residual_patterns"], content["held_out_error"].values(), strict=True)
    ]  # fmt: skip
    head = ("channel", "unit", "nominal", "extended, held out", "95 %", "best wrong effect", "nominal residual")
    tables.append(Table("Error on manoeuvres that no fit saw (root mean square)", head, tuple(errors)))
    if content["estimates"]:
        estimates: list[tuple[Cell, ...]] = [
            (
                name.replace("hint_", "if added: ").replace("_", " "), rounded(entry["value"]), _interval(entry),
                entry["unit"], None if entry["nominal"] is None else rounded(entry["nominal"]),
            )
            for name, entry in content["estimates"].items()
        ]  # fmt: skip
        head = ("parameter", "value", "95 %", "unit", "nominal")
        note = "Student's t over the stops."
        tables.append(Table("Parameters that the stops support", head, tuple(estimates), note=note))
    return Section("Parameters", tables=(*tables, *_candidates(answer)))


def _candidates(answer: Consistency) -> list[Table]:
    """Gain of each parameter of the accelerometer in place of the first accepted one."""
    result = answer.models.get("along")
    if result is None or not result.steps:
        return []
    step = result.steps[0]
    gains = {step.parameter: step.gain} | {n: result.base.cost - f.cost for n, f in step.others.items()}
    rows = tuple((n.replace("_", " "), round(g, 1)) for n, g in sorted(gains.items(), key=lambda item: -item[1]))
    note = f"Reduction of -2 log likelihood by each parameter alone; the detection threshold is {THRESHOLD:g}."
    return [Table("Candidates for the first cause (accelerometer)", ("parameter", "gain"), rows, note)]


def _relations(answer: Consistency) -> Section:
    """Accelerometer over the wheels' acceleration, and that over the pressure."""
    motion, moving = answer.motion, answer.motion.moving > 0.5
    charts = []
    error = _error_of(answer, "ax_mps2")
    if error is not None:
        x = motion.accel_mps2[moving]
        ends = np.array([x.min(), x.max()])
        curves = [
            *_binned(x, error.measured[moving], "measured", EXTENDED),
            *_binned(x, error.fitted[moving], "extended", NOMINAL),
            Curve("nominal", ends, ends, style="demand"),
        ]
        title = "Accelerometer over the wheels' acceleration"
        charts.append(Chart(title, "wheels' acceleration", "m/s²", "accelerometer", "m/s²", tuple(curves)))
    model = _braking(answer)
    if model is not None:
        pressure = model.effective_pressure(answer.models["braking"].parameters)
        on = moving & (pressure > APPLIED_PA)
        curves = [
            *_binned(model.pressure[on], motion.accel_mps2[on], "pressure as logged", NOMINAL),
            *_binned(pressure[on], motion.accel_mps2[on], "pressure with fitted delay and lag", EXTENDED),
        ]
        title = "Deceleration over pressure"
        charts.append(Chart(title, "pressure", BAR, "wheels' acceleration", "m/s²", tuple(curves)))
    text = "Means of equal numbers of samples, and one standard deviation."
    return Section("One channel over another", charts=tuple(charts), text=text)


def _binned(x: Floats, y: Floats, name: str, group: str) -> list[Curve]:
    return binned_curve(x, y, name, group, bins=16, min_samples=5)


def _limits(answer: Consistency) -> Section:
    content = answer.json
    by_channels: dict[str, list[str]] = {}
    for effect, text in content["needs"].items():
        by_channels.setdefault(text.split("; drive ")[0], []).append(effect)
    undetectable = [(f"undetectable: {text}", ", ".join(effects)) for text, effects in by_channels.items()]
    return limits(undetectable, content, (one["scenario"] for one in content["discriminating_manoeuvres"]))
