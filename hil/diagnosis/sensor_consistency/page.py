"""The report of a comparison of sensors: measured against foretold, before and after, and what cannot be told."""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.braking import BrakingModel
from hil.diagnosis.sensor_consistency.check import Consistency
from hil.diagnosis.sensor_consistency.held_out import HeldOutError
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.selection import THRESHOLD
from hil.report.report import Cell, Chart, Curve, Number, Panel, Report, Section, Table, Trace, Verdict
from hil.report.units import BAR, Display, Unit

_SENTENCE = {
    "none": "The sensors agree with the car's own motion within noise.",
    "named": "What is wrong between the sensors and the car's own motion has a name.",
    "cannot_tell_apart": "Something is wrong, and more than one name explains it.",
}
_TITLE = {
    "ax_mps2": "Longitudinal acceleration", "ay_mps2": "Lateral acceleration", "yaw_rate_rad_s": "Yaw rate",
    "speed_in_stops": "Speed in the stops",
}  # fmt: skip
_UNIT: dict[str, Unit] = {"m/s": Display("km/h", 3.6), "rad/s": Display("deg/s", 180.0 / np.pi), "m/s2": "m/s²"}
_WINDOW_S = 25.0


def build_report(answer: Consistency, sources: Sequence[str]) -> Report:
    """Build the report."""
    content = answer.json
    sections = [_overview(answer), *_windows(answer), _numbers_section(answer), _relations(answer), _limits(answer)]
    return Report(
        title="Measured sensors against the car's own motion",
        verdict={"none": Verdict.PASSED, "named": None}.get(content["verdict"], Verdict.INCOMPLETE),
        reason=_headline(answer) or _SENTENCE[content["verdict"]],
        numbers=tuple(_cards(answer)),
        sections=tuple(sections),
        provenance={
            "logs": list(sources), "manoeuvres": answer.motion.blocks,
            "seconds": round(len(answer.motion.t_s) * answer.motion.cell_s, 1),
            "extension": content["extension"] or "not written",
            "remarks": content["remarks"],
        },
    )  # fmt: skip


def _cards(answer: Consistency) -> list[Number]:
    cards = [Number("Verdict", answer.json["verdict"].replace("_", " "))]
    for cause in answer.json["causes"]:
        for name, entry in cause["parameters"].items():
            low, high = entry["ci95"]
            label = f"{', '.join(cause['channels'])}: {cause['effect'].replace('_', ' ')}"
            note = f"{name.replace('_', ' ')}; 95 %: {low:.3g} to {high:.3g}"
            cards.append(Number(label, _short(entry["value"]), entry["unit"], note=note))
    for miss in answer.misses:
        if miss.before > 0.0 and miss.held_out < 0.8 * miss.before:
            note = "on manoeuvres that no fit saw"
            cards.append(
                Number(
                    f"{_title(miss)}: error removed",
                    round(100.0 * (1.0 - miss.held_out / miss.before), 1),
                    "%",
                    note=note,
                )
            )
    return cards


def _headline(answer: Consistency) -> str:
    """The channels and what is wrong with them; the numbers follow as cards."""
    by_channel: dict[str, list[str]] = {}
    for cause in answer.causes:
        words = " or ".join(effect.replace("_", " ") for effect in cause.as_likely)
        if cause.labels[0].effect == "wrong_scale":
            words = "wrong sign" if cause.exact == -1.0 else "wrong scale or sign"
        by_channel.setdefault(", ".join(cause.channels), []).append(words)
    said = "; ".join(f"{channel}: {', '.join(words)}" for channel, words in by_channel.items())
    return f"{said}." if said else ""


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def _title(miss: HeldOutError) -> str:
    return _TITLE.get(miss.channel, miss.channel.replace("_", " "))


def _time(motion: Motion) -> Floats:
    """All logs in a row."""
    return np.arange(len(motion.t_s)) * motion.cell_s


def _panels(miss: HeldOutError, t: Floats, rows: Floats) -> list[Panel]:
    unit = _UNIT[miss.unit]
    shown = [("measured", miss.measured, "line", ""), ("as handed in", miss.nominal, "line", "rl")]
    shown.append(("extended", miss.fitted, "line", "fl"))
    # mypy takes the style for any string
    traces = tuple(Trace(n, t[rows], y[rows], style, group) for n, y, style, group in shown)  # type: ignore[arg-type]
    return [Panel(_title(miss), unit, traces)]


def _left(miss: HeldOutError, t: Floats, rows: Floats) -> Panel:
    traces = [
        Trace(name, t[rows], (miss.measured - y)[rows], group=group)
        for name, y, group in (("as handed in", miss.nominal, "rl"), ("extended", miss.fitted, "fl"))
    ]
    return Panel(f"{_title(miss)}: what is missed", _UNIT[miss.unit], tuple(traces))


def _overview(answer: Consistency) -> Section:
    motion, t = answer.motion, _time(answer.motion)
    rows = np.ones(len(t), bool)
    speed = Trace("wheels", t, motion.speed_mps, group="fl")
    panels = [Panel("Speed", _UNIT["m/s"], (speed,))]
    for miss in answer.misses:
        if miss.channel != "speed_in_stops":
            panels += [*_panels(miss, t, rows), _left(miss, t, rows)]
    return Section(
        "Before and after", panels=tuple(panels),
        text="What each sensor should have shown, foretold from the wheels' motion alone (flat road), with the numbers "
        "as handed in and with what was learnt. What is left after that goes with the road's slope and the noise.",
    )  # fmt: skip


def _windows(answer: Consistency) -> list[Section]:
    """A close look where the acceleration changes most, and every stop."""
    motion, t = answer.motion, _time(answer.motion)
    sections = []
    miss = next((m for m in answer.misses if m.channel == "ax_mps2"), None)
    if miss is not None and t[-1] > 1.5 * _WINDOW_S:
        size = int(_WINDOW_S / motion.cell_s)
        power = np.convolve(np.gradient(motion.accel_mps2) ** 2 * motion.moving, np.ones(size), "valid")
        first = int(np.argmax(power))
        rows = (np.arange(len(t)) >= first) & (np.arange(len(t)) < first + size)
        sections.append(Section("A close look", panels=(*_panels(miss, t, rows), _left(miss, t, rows))))
    braking = answer.models.get("braking")
    stops = next((m for m in answer.misses if m.channel == "speed_in_stops"), None)
    if braking is not None and stops is not None and isinstance(braking.model, BrakingModel):
        charts, model = [], braking.model
        for first, last in sorted(model.stops, key=lambda s: -float(model.pressure[slice(*s)].max()))[:6]:
            rows = np.zeros(len(t), bool)
            rows[first:last] = True
            curves = [
                Curve("measured", t[rows], stops.measured[rows]),
                Curve("as handed in", t[rows], stops.nominal[rows], group="rl"),
                Curve("extended", t[rows], stops.fitted[rows], group="fl"),
            ]
            bar = float(model.pressure[first:last].max()) * 1e-5
            charts.append(
                Chart(f"Stop at {t[first]:.0f} s, {bar:.1f} bar", "time", "s", "speed", _UNIT["m/s"], tuple(curves))
            )
        text = "Each stop runs freely from its measured start: no speed is fed back."
        sections.append(Section("Stops: simulated before and after, and measured", charts=tuple(charts), text=text))
    return sections


def _numbers_section(answer: Consistency) -> Section:
    rows: list[tuple[Cell, ...]] = []
    for at, cause in enumerate(answer.json["causes"] + answer.json["rivals"]):
        for name, entry in cause["parameters"].items():
            low, high = entry["ci95"]
            kind = "cause" if at < len(answer.json["causes"]) else "rival"
            rows.append((
                kind, cause["effect"], ", ".join(cause["channels"]), name, _short(entry["value"]),
                f"{low:.3g} to {high:.3g}", entry["unit"], round(100.0 * cause["probability"], 1),
            ))  # fmt: skip
    head = ("", "effect", "channel", "number", "value", "95 %", "unit", "probability %")
    tables = [Table("What is wrong, by name", head, tuple(rows))]
    gains: tuple[tuple[Cell, ...], ...] = tuple(
        (
            w["channel"], w["unit"], _short(w["rms"]), _short(g["after"]), f"{g['ci95'][0]:.3g} to {g['ci95'][1]:.3g}",
            None if g["best_wrong"] is None else _short(g["best_wrong"]), w["pattern"],
        )
        for w, g in zip(answer.json["residual_patterns"], answer.json["held_out_error"].values(), strict=True)
    )  # fmt: skip
    heads = ("channel", "unit", "handed in", "extended, held out", "95 %", "best wrong effect", "the error handed in")
    tables.append(Table("Error (root mean square) on manoeuvres that no fit saw", heads, gains))
    if answer.json["estimates"]:
        estimates: tuple[tuple[Cell, ...], ...] = tuple(
            (
                name.replace("hint_", "and further: ").replace("_", " "), _short(e["value"]),
                f"{e['ci95'][0]:.3g} to {e['ci95'][1]:.3g}", e["unit"],
                None if e["handed_in"] is None else _short(e["handed_in"]),
            )
            for name, e in answer.json["estimates"].items()
        )  # fmt: skip
        names = ("number", "value", "95 %", "unit", "handed in")
        tables.append(Table("What the stops support", names, estimates, note="Student's t over the stops."))
    return Section("Numbers", tables=(*tables, *_race(answer)))


def _race(answer: Consistency) -> list[Table]:
    """What each number would have gained in the place of the first one taken up."""
    found = answer.models.get("along")
    if found is None or not found.steps:
        return []
    step = found.steps[0]
    gains = {step.parameter: step.gain} | {n: found.base.cost - f.cost for n, f in step.others.items()}
    rows = tuple((n.replace("_", " "), round(g, 1)) for n, g in sorted(gains.items(), key=lambda item: -item[1]))
    note = f"Twice the log-likelihood, each number alone in the first place; {THRESHOLD:g} is asked of a cause."
    return [Table("Who else was in the race (accelerometer)", ("number", "gain"), rows, note)]


def _relations(answer: Consistency) -> Section:
    """The acceleration measured over the wheels' own, and over pressure."""
    motion = answer.motion
    charts = []
    miss = next((m for m in answer.misses if m.channel == "ax_mps2"), None)
    good = motion.moving > 0.5
    if miss is not None:
        curves = [
            c for c in (
                _binned(motion.accel_mps2[good], miss.measured[good], "measured", "fl"),
                _binned(motion.accel_mps2[good], miss.fitted[good], "extended", "rl"),
            ) if c is not None
        ]  # fmt: skip
        ends = np.array([motion.accel_mps2[good].min(), motion.accel_mps2[good].max()])
        curves.append(Curve("if nothing were wrong", ends, ends, style="demand"))
        charts.append(
            Chart(
                "Accelerometer over the wheels' acceleration",
                "wheels' acceleration",
                "m/s²",
                "accelerometer",
                "m/s²",
                tuple(curves),
            )
        )
    braking = answer.models.get("braking")
    if braking is not None and isinstance(braking.model, BrakingModel):
        model = braking.model
        later = {
            **braking.parameters,
            "brake_mps2_pa": -1.0,
            "drag_mps2": 0.0,
            "drag_1_m": 0.0,
            "drive_mps2": 0.0,
            "engine_mps2": 0.0,
        }
        felt = model.force(later)
        on = good & (felt > 2e4)
        curves = [
            c for c in (
                _binned(model.pressure[on], motion.accel_mps2[on], "pressure as stamped", "rl"),
                _binned(felt[on], motion.accel_mps2[on], "pressure at the learnt time", "fl"),
            ) if c is not None
        ]  # fmt: skip
        charts.append(
            Chart("Deceleration over pressure", "pressure", BAR, "wheels' acceleration", "m/s²", tuple(curves))
        )
    return Section(
        "One channel over another",
        charts=tuple(charts),
        text="Means of equal numbers of samples, and one standard deviation.",
    )


def _binned(x: Floats, y: Floats, name: str, group: str) -> Curve | None:
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) < 100 or np.ptp(x) <= 0.0:
        return None
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 17)))
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    rows = [
        (x[at == k].mean(), y[at == k].mean(), y[at == k].std()) for k in range(len(edges) - 1) if (at == k).sum() > 5
    ]
    centre, mean, spread = (np.array(v) for v in zip(*rows, strict=True))
    return Curve(name, centre, mean, mean - spread, mean + spread, group=group)


def _limits(answer: Consistency) -> Section:
    content = answer.json
    grouped: dict[str, list[str]] = {}
    for effect, text in content["needs"].items():
        grouped.setdefault(text.split("; drive ")[0], []).append(effect)
    rows = [(f"not testable: {text}", ", ".join(names)) for text, names in grouped.items()]
    rows += [("missing channel", text) for text in content["missing"]]
    rows += [("remark", text) for text in content["remarks"]]
    if content["discriminating_manoeuvres"]:
        rows.append(
            ("drive this to decide", ", ".join(one["scenario"] for one in content["discriminating_manoeuvres"]))
        )
    return Section("What these data cannot show", tables=(Table("Limits", ("what", "which"), tuple(rows)),))
