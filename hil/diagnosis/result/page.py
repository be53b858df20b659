"""The report of a diagnosis: measured against simulated, what is left over, who was in the race, what it gains."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_chi2
from hil.diagnosis.detection.threshold import INDISTINGUISHABLE
from hil.diagnosis.estimation.gauss_newton import Model
from hil.diagnosis.result.answer import Answer
from hil.diagnosis.result.cross_validation import HeldOutError, probabilities
from hil.diagnosis.result.residual_patterns import UNITS, WORDS
from hil.report.report import Chart, Curve, Number, Panel, Report, Section, Table, Trace, Verdict
from hil.report.units import BAR, Display, Unit
from plant.effects.places import JOINTS

_SENTENCE = {
    "none": "Nothing beyond noise and the stated tolerances.",
    "named": "A listed cause explains what the simulation missed.",
    "cannot_tell_apart": "Several causes explain these data equally well.",
    "unlisted": "No listed cause explains the data; where it acts is shown.",
    "not_testable": "These manoeuvres excite too little to conclude anything.",
}
_SHOWN: dict[str, Unit] = {"wheel": Display("km/h", 3.6), "pressure": BAR, "motor": "N m"}
_VARIABLES: dict[str, Unit] = {
    "speed": Display("km/h", 3.6), "wheel_speed": "rad/s", "pressure": BAR, "disc_temperature": "K",
    "time_since_on": "s", "time": "s", "motor_torque": "N m", "acceleration": "m/s²", "yaw_rate": "rad/s",
    "distance": "m", "slip": "",
}  # fmt: skip
_PANELS = (
    ("wheel", "Wheel speed, mean of all wheels"),
    ("ax", "Longitudinal acceleration"),
    ("pressure", "Pressure, mean"),
)


def build_report(answer: Answer, sources: Sequence[str]) -> Report:
    """Build the report."""
    content, found = answer.json, answer.diagnosis
    verdict = content["verdict"]
    return Report(
        title="Measured data against the simulation",
        verdict={"none": Verdict.PASSED, "named": None}.get(verdict, Verdict.INCOMPLETE),
        reason=_headline(content),
        numbers=tuple(_numbers(answer)),
        sections=(
            _comparison(answer), _missed(answer), *_laws(answer), _race(answer), _gained(answer), _limits(answer),
        ),
        provenance={
            "logs": list(sources), "segments": len(found.dataset.segments), "replays": found.fitter.simulator.runs,
            "extension": content["extension"] or "not written", "remarks": content["remarks"],
        },
    )  # fmt: skip


def _headline(content: dict[str, object]) -> str:
    causes = content["causes"]
    text = _SENTENCE[str(content["verdict"])]
    if isinstance(causes, list) and causes:
        named = "; ".join(f"{c['title'] if c['curve'] else c['effect']} ({c['wheel']})" for c in causes)
        text = f"{named}: {text[0].lower()}{text[1:]}"
    return text


def _numbers(answer: Answer) -> list[Number]:
    numbers = [Number("Verdict", answer.json["verdict"].replace("_", " "))]
    for cause in answer.json["causes"]:
        for name, entry in cause["parameters"].items():
            low, high = entry["ci95"]
            which = f" {name}" if len(cause["parameters"]) > 1 else ""
            label = f"{cause['effect']}{which}, {cause['wheel']}"
            numbers.append(Number(label, entry["value"], entry["unit"], note=f"95 %: {low:.4g} to {high:.4g}"))
        numbers.append(Number("its probability", 100.0 * cause["probability"], "%"))
    best = _most_gained(answer.held_out)
    if best is not None and best.before > 0.0:
        note = f"{WORDS[best.channel]}, on manoeuvres no fit saw"
        numbers.append(Number("Held-out error removed", 100.0 * (1.0 - best.after / best.before), "%", note=note))
    return numbers


def _most_gained(gains: Sequence[HeldOutError]) -> HeldOutError | None:
    shown = [g for g in gains if g.channel in ("wheel.mean", "ax", "gps", "pressure.mean", "motor.mean")]
    return max(shown, key=lambda g: 1.0 - g.after / max(g.before, 1e-12), default=None)


def _joined_time(answer: Answer) -> tuple[Floats, Floats]:
    """Time over all logs in a row, and a gap before each log."""
    times, gaps, begin = [], [], 0.0
    for drive in answer.diagnosis.dataset.recordings:
        times.append(begin + np.arange(drive.samples) * answer.diagnosis.dataset.sample_s)
        gap = np.zeros(drive.samples, bool)
        gap[0] = True
        gaps.append(gap)
        begin = float(times[-1][-1]) + 1.0
    return np.concatenate(times), np.concatenate(gaps)


def _mean(values: Floats) -> Floats:
    """Mean of the channels of each row that are known; NaN where none is."""
    known = np.isfinite(values).sum(axis=1)
    return np.asarray(np.where(known > 0, np.nansum(values, axis=1) / np.maximum(known, 1), np.nan))


def _comparison(answer: Answer) -> Section:
    """Measured, as handed in, and extended, over all logs in a row; residuals below."""
    found = answer.diagnosis
    t, gaps = _joined_time(answer)
    measured = found.fitter.simulator.measured()
    panels = []
    for group, title in _PANELS:
        if group not in found.dataset.groups:
            continue
        factor = found.fitter.radius if group == "wheel" else 1.0
        unit: Unit = _SHOWN.get(group, "m/s²")
        known = _mean(measured[group]) * factor
        shown = ~gaps & (found.fitter.masks.present.get("ax", ~gaps) > 0.5) if group == "ax" else ~gaps
        traces = []
        for name, model in _models(answer):
            simulated = _mean(model.channels[group]) * factor
            traces.append(
                Trace(name, t, np.where(shown, simulated, np.nan), group="rl" if name == "handed in" else "fl")
            )
        traces.append(Trace("measured", t, np.where(shown, known, np.nan), "demand"))
        panels.append(Panel(title, unit, tuple(traces)))
        residuals = []
        for name, model in _models(answer):
            left = known - _mean(model.channels[group]) * factor
            residuals.append(Trace(name, t, np.where(shown, left, np.nan), group="rl" if name == "handed in" else "fl"))
        panels.append(Panel(f"{title.split(',')[0]}: measured less simulated", unit, tuple(residuals)))
    return Section(
        "Measured against simulated", panels=tuple(panels),
        text="The logs in a row, each replayed freely from measured inputs; the speed starts anew at every segment.",
    )  # fmt: skip


def _models(answer: Answer) -> list[tuple[str, Model]]:
    found = answer.diagnosis
    extended = found.final if found.final.terms else found.base
    return [("handed in", found.nominal), ("extended" if found.final.terms else "tuned", extended)]


def _missed(answer: Answer) -> Section:
    rows = tuple(
        (
            w.channel,
            *_scaled(w.rms, w.track),
            *_scaled(w.noise, w.track)[:1],
            round(w.rms / max(w.noise, 1e-12), 1),
            w.pattern,
        )
        for w in sorted(answer.patterns, key=lambda w: -w.rms / max(w.noise, 1e-12))
    )
    table = Table(
        "What the simulation as handed in misses", ("channel", "rms", "unit", "noise", "rms/noise", "goes with"), rows
    )
    return Section("What is wrong", tables=(table,), charts=tuple(_residual_charts(answer)))


def _scaled(value: float, track: str) -> tuple[float, str]:
    group = track.split(".")[0]
    if group == "pressure":
        return float(f"{value * 1e-5:.3g}"), "bar"
    return float(f"{value:.3g}"), UNITS[group]


def _residual_charts(answer: Answer) -> list[Chart]:
    """Residual of the acceleration over what it may go with, in bins, before and after."""
    found = answer.diagnosis
    if "ax" not in found.dataset.groups:
        return []
    pressure = np.concatenate([d.pressure_pa for d in found.dataset.recordings])
    speed = np.concatenate([d.speed_mps for d in found.dataset.recordings])
    known = found.fitter.masks.present["ax"] > 0.5
    charts = []
    for title, x, mask, label, unit in (
        ("Acceleration residual over pressure", pressure, known, "pressure", BAR),
        ("Acceleration residual over speed, braking", speed, known & (pressure > 3e5), "speed", Display("km/h", 3.6)),
    ):
        curves = []
        for name, model in _models(answer):
            left = model.residual["ax"][:, 0]
            curve = _binned(x[mask], left[mask], name)
            if curve is not None:
                curves.append(curve)
        if curves:
            charts.append(Chart(title, label, unit, "measured less simulated", "m/s²", tuple(curves)))
    return charts


def _binned(x: Floats, y: Floats, name: str) -> Curve | None:
    if len(x) < 100 or np.ptp(x) <= 0.0:
        return None
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 13)))
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    rows = [
        (x[at == k].mean(), y[at == k].mean(), y[at == k].std()) for k in range(len(edges) - 1) if (at == k).sum() > 10
    ]
    if len(rows) < 3:
        return None
    centre, mean, spread = (np.array(v) for v in zip(*rows, strict=True))
    return Curve(name, centre, mean, mean - spread, mean + spread, group="rl" if name == "handed in" else "fl")


def _laws(answer: Answer) -> list[Section]:
    """The curve of a cause in no list, with its 95 % band."""
    sections = []
    for cause in answer.json["causes"]:
        if not cause["curve"]:
            continue
        x, y, low, high = (np.array([point[key] for point in cause["curve"]]) for key in ("x", "y", "low", "high"))
        (variable,) = cause["variables"]
        unit = _VARIABLES.get(variable, "")
        curve = Curve("found", x, y, low, high, group="fl")
        added = JOINTS[cause["injection_point"]][1] if cause["adds"] else ""
        label = f"added to {cause['joint']}" if cause["adds"] else f"change of {cause['joint']}, share"
        chart = Chart(f"{cause['title']}, {cause['wheel']}", variable.replace("_", " "), unit, label, added, (curve,))
        sections.append(Section("A cause in no list", charts=(chart,), text="The band is its 95 % interval."))
    return sections


def _race(answer: Answer) -> Section:
    """Who was in the race, and how far apart they are."""
    found = answer.diagnosis
    tables, charts = [], []
    for k, listed in enumerate(found.selections):
        charts += _behind(f"Cause {k + 1}: how much worse than the best each candidate fits", listed)
        chances = probabilities(listed)
        rows = tuple(
            (
                c.term.candidate.effect.title, c.term.candidate.name, float(f"{c.term.value:.4g}"),
                c.term.candidate.parameter.unit, round(delta_chi2(c, listed[0]), 1), round(100.0 * p, 1),
            )
            for c, p in zip(listed, chances, strict=True)
        )  # fmt: skip
        tables.append(
            Table(
                f"Cause {k + 1}: candidates, fitted non-linearly",
                ("candidate", "name", "value", "unit", "Δχ² to the best", "probability %"),
                rows,
                note=f"Below Δχ² {INDISTINGUISHABLE} two candidates are rivals. It is divided by the numbers' strain.",
            )
        )
    top = sorted(found.scores, key=lambda s: -s.gain)[:15]
    screened = tuple(
        (s.candidate.name, round(s.gain, 1), float(f"{s.value:.4g}"), s.candidate.parameter.unit) for s in top
    )
    tables.append(
        Table(
            "Screen: one linear step each, against noise and tolerances",
            ("candidate", "Δχ²", "value", "unit"),
            screened,
            note=f"Asked of a cause: Δχ² {found.detection_threshold:.0f}.",
        )
    )
    bars = Curve("gain", np.arange(1.0, len(top) + 1.0), np.array([s.gain for s in top]), style="points")
    asked = Curve(
        "asked of a cause", np.array([0.5, len(top) + 0.5]), np.full(2, found.detection_threshold), style="demand"
    )
    names = tuple(s.candidate.name for s in top)
    alone = Chart("Screen: explained by each candidate alone", "candidate", "", "Δχ²", "", (bars, asked), names)
    return Section("Candidates", tables=tuple(tables), charts=(*charts, alone) if top else ())


def _behind(title: str, listed: Sequence[FittedHypothesis]) -> list[Chart]:
    """Candidates for one cause, as fitted, and the line below which they are rivals."""
    if len(listed) < 2:
        return []
    rows = np.arange(1.0, len(listed) + 1.0)
    behind = Curve("fitted", rows, np.array([delta_chi2(c, listed[0]) for c in listed]), style="points", group="fl")
    rivals = Curve("rivals below", np.array([0.5, len(listed) + 0.5]), np.full(2, INDISTINGUISHABLE), style="demand")
    names = tuple(c.term.candidate.name for c in listed)
    return [Chart(title, "candidate", "", "Δχ² to the best", "", (behind, rivals), names)]


def _gained(answer: Answer) -> Section:
    rows = tuple(
        (
            WORDS[g.channel], *_scaled(g.before, g.channel)[:1], *_scaled(g.tuned, g.channel)[:1],
            None if g.best_wrong is None else _scaled(g.best_wrong, g.channel)[0], _scaled(g.after, g.channel)[0],
            f"{_scaled(g.low, g.channel)[0]:.3g} to {_scaled(g.high, g.channel)[0]:.3g}",
            _scaled(g.after, g.channel)[1],
        )
        for g in answer.held_out
    )  # fmt: skip
    table = Table(
        "Free-running error on manoeuvres that no fit saw (root mean square)",
        ("channel", "handed in", "tuned, no effect", "best wrong effect", "extended", "95 %", "unit"), rows,
    )  # fmt: skip
    return Section("Gain", tables=(table,), charts=_gain_charts(answer))


def _gain_charts(answer: Answer) -> tuple[Chart, ...]:
    """Held-out error of each channel as a share of the error as handed in."""
    gains = [g for g in answer.held_out if g.before > 0.0]
    if not gains:
        return ()
    x = np.arange(1.0, len(gains) + 1.0)
    before = np.array([g.before for g in gains])
    own = np.array([g.after for g in gains]) / before
    low, high = np.array([g.low for g in gains]) / before, np.array([g.high for g in gains]) / before
    curves = [Curve("extended", x, own, low, high, "points", "fl")]
    curves.append(Curve("tuned, no effect", x, np.array([g.tuned for g in gains]) / before, style="points", group="rr"))
    if all(g.best_wrong is not None for g in gains):
        wrong = np.array([g.best_wrong for g in gains], np.float64) / before
        curves.append(Curve("best wrong effect", x, wrong, style="points", group="rl"))
    curves.append(Curve("handed in", np.array([0.5, len(gains) + 0.5]), np.ones(2), style="demand"))
    title, names = "Held-out error against the simulation as handed in", tuple(WORDS[g.channel] for g in gains)
    return (Chart(title, "channel", "", "error / error as handed in", "", tuple(curves), names),)


def _limits(answer: Answer) -> Section:
    content = answer.json
    rows = [("not testable with these manoeuvres", ", ".join(content["undetectable_effects"]) or "-")]
    rows += [("missing channel", text) for text in content["missing"]]
    rows += [("remark", text) for text in content["remarks"]]
    if content["discriminating_manoeuvres"]:
        rows.append(
            (
                "drive this instead",
                ", ".join(Path(one["scenario"]).stem for one in content["discriminating_manoeuvres"]),
            )
        )
    return Section("What these data cannot show", tables=(Table("Limits", ("what", "which"), tuple(rows)),))
