"""The report of a diagnosis: measured against simulated, residual patterns, candidates, held-out error, limits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_chi2
from hil.diagnosis.detection.threshold import INDISTINGUISHABLE
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.manoeuvres import stops
from hil.diagnosis.result import reference
from hil.diagnosis.result.answer import Answer
from hil.diagnosis.result.channels_table import channels_section
from hil.diagnosis.result.cross_validation import probabilities
from hil.diagnosis.result.page_parts import (
    EXTENDED,
    NOMINAL,
    binned_curve,
    comparison_panels,
    joined_time,
    limits,
    log_lane,
)
from hil.diagnosis.result.page_tables import goodness_of_fit, held_out, moved, numbers, scaled
from hil.diagnosis.result.phrases import place
from hil.report.report import Chart, Curve, Lane, Panel, Report, Section, Table, Verdict
from hil.report.units import BAR, Display, Unit
from plant.injection_points import INJECTION_POINTS

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
    content, diagnosis = answer.json, answer.diagnosis
    verdict = content["verdict"]
    return Report(
        title="Measured data against " + ("reference logs" if diagnosis.reference else "the simulation"),
        verdict={"none": Verdict.PASSED, "named": None}.get(verdict, Verdict.INCONCLUSIVE),
        reason=content["headline"],
        numbers=tuple(numbers(answer)),
        sections=(
            _comparison(answer), *reference.section(diagnosis), moved(answer), *goodness_of_fit(answer),
            _patterns(answer), *_curves(answer), _candidates(answer), held_out(answer),
            *stops.section(content.get("stops", ())), channels_section(content), _limits(answer),
        ),
        provenance={
            "logs": list(sources), "segments": len(diagnosis.dataset.segments),
            "simulations": diagnosis.fitter.simulator.runs,
            "extension": content["extension"] or "not written", "remarks": content["remarks"],
        } | ({"reference": content["reference"]["logs"]} if diagnosis.reference else {}),
    )  # fmt: skip


def _mean(values: Floats) -> Floats:
    """Mean of the known channels of each row; NaN where none is known."""
    known = np.isfinite(values).sum(axis=1)
    return np.asarray(np.where(known > 0, np.nansum(values, axis=1) / np.maximum(known, 1), np.nan))


def _comparison(answer: Answer) -> Section:
    """Measured, nominal and extended over all logs, the residuals below."""
    diagnosis = answer.diagnosis
    t, gaps = joined_time(diagnosis.dataset)
    measured = diagnosis.fitter.simulator.measured()
    panels: list[Panel] = []
    for group, title in _PANELS:
        if group not in diagnosis.dataset.groups:
            continue
        factor = diagnosis.fitter.radius if group == "wheel" else 1.0
        unit: Unit = _SHOWN.get(group, "m/s²")
        known = _mean(measured[group]) * factor
        shown = ~gaps & (diagnosis.fitter.masks.present.get("ax", ~gaps) > 0.5) if group == "ax" else ~gaps
        simulated = {
            name: np.where(shown, _mean(model.channels[group]) * factor, np.nan) for name, model in _models(answer)
        }
        panels += comparison_panels(title, unit, t, np.where(shown, known, np.nan), simulated)
    return Section(
        "Measured against simulated", panels=tuple(panels), timeline=(_logs(answer, t, gaps),),
        text="All logs, one after the other, simulated open loop from measured inputs; a segment restarts the speed.",
    )  # fmt: skip


def _logs(answer: Answer, t: Floats, gaps: Floats) -> Lane:
    names = [recording.log.name for recording in answer.diagnosis.dataset.recordings]
    return log_lane(names, t[gaps].tolist(), float(t[-1]))


def _models(answer: Answer) -> list[tuple[str, Model]]:
    diagnosis = answer.diagnosis
    extended = diagnosis.final if diagnosis.final.terms else diagnosis.base
    return [("nominal", diagnosis.nominal), ("extended" if diagnosis.final.terms else "nuisances fitted", extended)]


def _patterns(answer: Answer) -> Section:
    rows = tuple(
        (
            w.channel,
            *scaled(w.rms, w.track),
            *scaled(w.noise, w.track)[:1],
            round(w.rms / max(w.noise, 1e-12), 1),
            w.pattern,
        )
        for w in sorted(answer.patterns, key=lambda w: -w.rms / max(w.noise, 1e-12))
    )
    table = Table(
        "What the nominal simulation misses", ("channel", "rms", "unit", "noise", "rms/noise", "correlates with"), rows
    )
    return Section("What is wrong", tables=(table,), charts=tuple(_residual_charts(answer)))


def _residual_charts(answer: Answer) -> list[Chart]:
    """Binned residual of the acceleration over pressure and speed, nominal and extended."""
    diagnosis = answer.diagnosis
    if "ax" not in diagnosis.dataset.groups:
        return []
    pressure = np.concatenate([d.pressure_pa for d in diagnosis.dataset.recordings])
    speed = np.concatenate([d.speed_mps for d in diagnosis.dataset.recordings])
    known = diagnosis.fitter.masks.present["ax"] > 0.5
    charts = []
    for title, x, mask, label, unit in (
        ("Acceleration residual over pressure", pressure, known, "pressure", BAR),
        ("Acceleration residual over speed, braking", speed, known & (pressure > 3e5), "speed", Display("km/h", 3.6)),
    ):
        curves: list[Curve] = []
        for (name, model), group in zip(_models(answer), (NOMINAL, EXTENDED), strict=True):
            curves += binned_curve(
                x[mask], model.residual["ax"][mask, 0], name, group, bins=12, min_samples=10, min_bins=3
            )
        if curves:
            charts.append(Chart(title, label, unit, "measured less simulated", "m/s²", tuple(curves)))
    return charts


def _curves(answer: Answer) -> list[Section]:
    """The curve of a nonparametric term with its 95 % band."""
    sections = []
    for cause in answer.json["causes"]:
        if not cause["curve"]:
            continue
        x, y, low, high = (np.array([point[key] for point in cause["curve"]]) for key in ("x", "y", "low", "high"))
        (variable,) = cause["variables"]
        unit = _VARIABLES.get(variable, "")
        curve = Curve("estimate", x, y, low, high, group="fl")
        added = INJECTION_POINTS[cause["injection_point"]][1] if cause["adds"] else ""
        label = (
            f"added to {cause['injection_point']}" if cause["adds"] else f"change of {cause['injection_point']}, share"
        )
        chart = Chart(
            f"{cause['title']}, {place(cause['location'])}", variable.replace("_", " "), unit, label, added, (curve,)
        )
        sections.append(Section("Nonparametric term", charts=(chart,), text="The band is its 95 % interval."))
    return sections


def _candidates(answer: Answer) -> Section:
    """The fitted hypotheses for each cause, and the score test of all candidates."""
    diagnosis = answer.diagnosis
    tables, charts = [], []
    for k, listed in enumerate(diagnosis.selections):
        charts += _differences(f"Cause {k + 1}: Δχ² of each fitted candidate to the best", listed)
        chances = probabilities(listed)
        rows = tuple(
            (
                _shown(c.term.candidate), c.term.candidate.name, float(f"{c.term.value:.4g}"),
                c.term.candidate.parameter.unit, round(delta_chi2(c, listed[0]), 1), round(100.0 * p, 1),
            )
            for c, p in zip(listed, chances, strict=True)
        )  # fmt: skip
        tables.append(
            Table(
                f"Cause {k + 1}: profile fits",
                ("candidate", "name", "value", "unit", "Δχ² to the best", "probability %"),
                rows,
                note=f"Below Δχ² {INDISTINGUISHABLE} a candidate is a rival. Δχ² is divided by the Birge ratio.",
            )
        )
    top = sorted(diagnosis.scores, key=lambda s: -s.gain)[:15]
    screened = tuple(
        (_shown(s.candidate), s.candidate.name, round(s.gain, 1), float(f"{s.value:.4g}"), s.candidate.parameter.unit)
        for s in top
    )
    tables.append(
        Table(
            "Score test: one linear step each, nuisance parameters marginalised",
            ("candidate", "name", "Δχ²", "value", "unit"),
            screened,
            note=f"Detection threshold: Δχ² {diagnosis.detection_threshold:.0f}.",
        )
    )
    bars = Curve("gain", np.arange(1.0, len(top) + 1.0), np.array([s.gain for s in top]), style="points")
    limit = Curve(
        "detection threshold",
        np.array([0.5, len(top) + 0.5]),
        np.full(2, diagnosis.detection_threshold),
        style="demand",
    )
    names = tuple(_shown(s.candidate) for s in top)
    alone = Chart("Score test: gain of each candidate alone", "candidate", "", "Δχ²", "", (bars, limit), names)
    return Section("Candidates", tables=tuple(tables), charts=(*charts, alone) if top else ())


def _shown(candidate: Candidate) -> str:
    """A candidate for people: place first, as charts cut long names, title, which of several numbers."""
    which = "" if len(candidate.effect.strengths) == 1 else f": {candidate.parameter.name.replace('_', ' ')}"
    where = "" if candidate.location == "car" else f"{place(candidate.location)}: "
    text = f"{where}{candidate.effect.title}{which}"
    return text[0].upper() + text[1:]


def _differences(title: str, listed: Sequence[FittedHypothesis]) -> list[Chart]:
    """Fitted candidates for one cause, and the line below which they are rivals."""
    if len(listed) < 2:
        return []
    rows = np.arange(1.0, len(listed) + 1.0)
    fitted = Curve("fitted", rows, np.array([delta_chi2(c, listed[0]) for c in listed]), style="points", group="fl")
    rivals = Curve("rivals below", np.array([0.5, len(listed) + 0.5]), np.full(2, INDISTINGUISHABLE), style="demand")
    names = tuple(_shown(c.term.candidate) for c in listed)
    return [Chart(title, "candidate", "", "Δχ² to the best", "", (fitted, rivals), names)]


def _limits(answer: Answer) -> Section:
    content = answer.json
    undetectable = ", ".join(content["undetectable_effects"]) or "-"
    manoeuvres = (Path(one["scenario"]).stem for one in content["discriminating_manoeuvres"])
    return limits([("undetectable in these manoeuvres", undetectable)], content, manoeuvres)
