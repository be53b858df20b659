"""A friction identification as a report: the paper's Figures 3, 4 and 5, the parameters and what they are worth."""

from dataclasses import replace

import numpy as np

from hil.identify.model import Course, Heating
from hil.identify.record import Floats, Record
from hil.identify.study import Study
from hil.identify.uncertainty import Estimate, correlations, disagreements, estimates, findings, shown_directly
from hil.identify.validation import START_S, Error, Validation
from hil.report.report import Chart, Curve, Number, Panel, Report, Section, Table, Trace
from hil.report.units import BAR, DEG_C, PERCENT

_FORMS: dict[Heating, str] = {"printed": "Nv, as printed", "friction": "µNv, what really heats"}
_STEADY = 0.05  # a speed that moves by less is a number, not a picture
_FIRM_PA = 4e5  # below, a torque over its force says little about friction


def build_report(study: Study, provenance: dict[str, object]) -> Report:
    """Put a study into a report."""
    sections = [_inputs(study), _identification(study)]
    if study.validation is not None:
        sections.append(_validated(study.validation))
    sections += [_hysteresis(study), _parameters(study)]
    return Report(
        title=f"Pad friction identified from {study.record.name}{_synthetic(study)}",
        reason=_reason(study),
        numbers=_numbers(study),
        sections=tuple(sections),
        provenance=provenance,
    )


def figures(study: Study) -> dict[str, Report]:
    """Return each of the paper's figures as a report of its own, by file name."""
    drawn = {}
    drawn["figure3_inputs.png"] = _figure(_inputs(study), _speeds(study), ())
    reason = f"Fitted: {study.record.name}{_synthetic(study)}. {_reason(study)}"
    drawn["figure4_identification.png"] = _figure(_identification(study), reason, _fit_numbers(study))
    if study.validation is not None:
        reason = f"Predicted: {study.validation.record.name}{_synthetic(study)}, free-running after {START_S:g} s."
        numbers = (*_prediction_numbers(study.validation), *_half_numbers(study.validation.halves))
        drawn["figure5_validation.png"] = _figure(_validated(study.validation), reason, numbers)
    return drawn


def _figure(section: Section, reason: str, numbers: tuple[Number, ...]) -> Report:
    return Report(section.title, reason=reason, numbers=numbers, sections=(replace(section, title="Over time"),))


def _inputs(study: Study) -> Section:
    """Return the equivalent of Figure 3: what drove the brake."""
    records = _records(study)
    panels = [
        Panel(f"Brake pressure, {record.name}", BAR, (Trace(record.name, record.time_s, record.pressure_pa),))
        for record in records
    ]
    if any(np.ptp(record.speed_mps) > _STEADY * record.speed_mps.mean() for record in records):
        speeds = tuple(Trace(record.name, record.time_s, record.speed_mps) for record in records)
        panels.append(Panel("Sliding speed", "m/s", speeds))
    return Section("Inputs (paper, Figure 3)", panels=tuple(panels), text=_speeds(study))


def _records(study: Study) -> list[Record]:
    return [study.record] + ([study.validation.record] if study.validation else [])


def _speeds(study: Study) -> str:
    """Sliding speed in words; a panel of its own only where it is not steady."""
    said = [
        f"{r.speed_mps.mean():.2f} m/s ({r.speed_mps.min():.2f} to {r.speed_mps.max():.2f})" for r in _records(study)
    ]
    return f"Sliding speed {', '.join(said)}."


def _identification(study: Study) -> Section:
    """Return the equivalent of Figure 4: the record that was fitted."""
    first, second = study.errors
    text = (
        f"All of {study.record.name} was fitted. Torque residual {study.best.torque_noise.rms:.2f} N m rms, of which "
        f"the sensor alone explains {study.best.torque_noise.floor:.2f} N m; {_halves(first, second)}. "
        f"Temperature residual {study.best.temperature_noise.rms:.2f} K rms."
    )
    return Section(
        "Identification (paper, Figure 4)", panels=_panels(study.record, study.best.course, "model"), text=text
    )


def _validated(validation: Validation) -> Section:
    """Return the equivalent of Figure 5: the record that was predicted."""
    text = (
        f"Only the start values (friction {validation.start.mu:.3f}, {validation.start.temperature_k - 273.15:.1f} °C) "
        f"are from the first {START_S:g} s of {validation.record.name}; then the model runs free. "
        f"Torque error {validation.whole.torque_rms_nm:.2f} N m rms; {_halves(*validation.halves)}. "
        f"{_warming(validation.record, validation.course)}"
    )
    panels = _panels(validation.record, validation.course, "prediction")
    return Section("Validation (paper, Figure 5)", panels=panels, text=text)


def _panels(record: Record, course: Course, name: str) -> tuple[Panel, ...]:
    t = record.time_s
    return (
        Panel(
            "Brake torque",
            "N m",
            (Trace("measured", t, record.torque_nm), Trace(name, t, course.torque_nm, "estimate")),
        ),
        Panel(
            "Temperature",
            DEG_C,
            (Trace("measured", t, record.temperature_k), Trace(name, t, course.temperature_k, "estimate")),
        ),
        Panel(f"Torque error, {name} minus measured", "N m", (Trace("error", t, course.torque_nm - record.torque_nm),)),
    )


def _hysteresis(study: Study) -> Section:
    """Friction over pressure in the last whole stroke of each record: build and release differ."""
    charts = [_loop(study, study.record, study.best.course, "model")]
    if study.validation is not None:
        charts.append(_loop(study, study.validation.record, study.validation.course, "prediction"))
    return Section("Friction over pressure", charts=tuple(charts))


def _loop(study: Study, record: Record, course: Course, name: str) -> Chart:
    stroke = _last_stroke(record.pressure_pa)
    pressure = record.pressure_pa[stroke]
    measured = record.torque_nm[stroke] / study.brake.torque_per_mu_nm(pressure)
    return Chart(
        f"Last stroke of {record.name}",
        "pressure",
        BAR,
        "friction coefficient",
        "",
        (Curve("measured", pressure, measured, style="points"), Curve(name, pressure, course.mu[stroke])),
    )


def _last_stroke(pressure: Floats) -> slice:
    """Samples from the last build of pressure to its release; a stroke that is cut off does not count."""
    firm = pressure > max(_FIRM_PA, 0.15 * float(pressure.max()))
    edges = np.flatnonzero(np.diff(firm.astype(np.int8), prepend=0, append=0))
    starts, ends = edges[::2], edges[1::2]
    whole = np.flatnonzero(ends - starts >= 0.5 * np.max(ends - starts, initial=1))
    return slice(int(starts[whole[-1]]), int(ends[whole[-1]])) if whole.size else slice(0)


def _parameters(study: Study) -> Section:
    numbers, correlation = estimates(study.best), correlations(study.best)
    repeats = estimates(study.repeat) if study.repeat else numbers
    again = (f"on {study.validation.record.name}",) if study.validation else ()
    heads = ("", "value", "95 % from", "to", "± %", "told", *again)
    rows = tuple((*_row(n), *([r.value] if again else [])) for n, r in zip(numbers, repeats, strict=True))
    symbols = [n.symbol for n in numbers]
    said = findings(study.best) + (disagreements(study.best, study.repeat) if study.repeat else ())
    directly = tuple((*_row(n), n.meaning) for n in shown_directly(study.best))
    return Section(
        "Parameters",
        tables=(
            Table("Equations (3) and (4)", heads, rows, _interval_note(study)),
            Table("What the record shows directly", (*heads[:6], "meaning"), directly),
            Table(
                "Correlation of the logarithms",
                ("", *symbols),
                tuple((symbol, *(f"{c:+.3f}" for c in row)) for symbol, row in zip(symbols, correlation, strict=True)),
            ),
            _forms(study),
        ),
        text=f"What the record does not tell: {'; '.join(said)}." if said else "",
    )


def _row(n: Estimate) -> tuple[str | float, ...]:
    name = f"{n.symbol} in {n.unit}" if n.unit else n.symbol
    share = 100.0 * n.half_width / n.value
    return name, n.value, n.low, n.high, f"{share:.1f}" if share < 1000.0 else "> 1000", n.told


def _interval_note(study: Study) -> str:
    torque = study.best.torque_noise
    if torque.white:
        return "The residual is white: intervals hold as printed."
    return (
        f"The torque residual is coloured ({100.0 * torque.colour:.0f} % of it keeps {torque.memory:.3f} from sample "
        "to sample); intervals are widened for that, but they cannot know what the model lacks."
    )


def _forms(study: Study) -> Table:
    rows = tuple(
        (
            _FORMS[form],
            fitted.torque_noise.rms,
            fitted.temperature_noise.rms,
            fitted.log_likelihood - study.best.log_likelihood,
            f"{fitted.valleys} of 3",
            form == study.heating,
        )
        for form, fitted in study.fits.items()
    )
    heads = (
        "heating by",
        "torque in N m",
        "temperature in K",
        "log-likelihood",
        "starts",
        "taken",
    )
    return Table("Form of the heating term: rms residuals", heads, rows, "The likelihood takes the residual for white.")


def _numbers(study: Study) -> tuple[Number, ...]:
    return _fit_numbers(study) + (_prediction_numbers(study.validation) if study.validation else ())


def _fit_numbers(study: Study) -> tuple[Number, ...]:
    torque, mean_nm = study.best.torque_noise, float(study.record.torque_nm.mean())
    return (
        Number("Torque residual", torque.rms, "N m", "identification, rms"),
        Number("over the mean torque", torque.rms / mean_nm, PERCENT, f"mean {mean_nm:.0f} N m"),
        Number("Torque sensor noise", torque.floor, "N m", "rms, from third differences"),
        Number("Temperature residual", study.best.temperature_noise.rms, "K", "identification, rms"),
    )


def _prediction_numbers(validation: Validation) -> tuple[Number, ...]:
    whole = validation.whole
    return (
        Number("Torque error, validation", whole.torque_rms_nm, "N m", "free-running, rms"),
        Number("over its mean torque", whole.torque_share, PERCENT),
        Number("Temp. error, validation", whole.temperature_rms_k, "K", "free-running, rms"),
    )


def _half_numbers(errors: tuple[Error, Error]) -> tuple[Number, ...]:
    names = ("Error, first half", "Error, second half")
    return tuple(Number(name, part.torque_rms_nm, "N m") for name, part in zip(names, errors, strict=True))


def _synthetic(study: Study) -> str:
    return " (synthetic)" if any("SYNTHETIC" in line for line in study.record.remarks) else ""


def _reason(study: Study) -> str:
    poor = [n.symbol for n in estimates(study.best) if n.told == "poorly"]
    told = f"poorly determined: {', '.join(poor)}" if poor else "all five parameters determined"
    return f"Heating term {_FORMS[study.heating]}; {told}."


def _halves(first: Error, second: Error) -> str:
    return (
        f"first half {first.torque_rms_nm:.2f} N m ({100.0 * first.torque_share:.1f} % of the mean torque), "
        f"second half {second.torque_rms_nm:.2f} N m ({100.0 * second.torque_share:.1f} %)"
    )


def _warming(record: Record, course: Course) -> str:
    """What the paper asks of the model: does the mean torque follow the warming?"""
    quarter = record.time_s.size // 4
    ends = [(float(y[:quarter].mean()), float(y[-quarter:].mean())) for y in (record.torque_nm, course.torque_nm)]
    (cold, hot), (cold_model, hot_model) = ends
    return (
        f"Mean torque from the first to the last quarter: {cold:.0f} to {hot:.0f} N m measured, "
        f"{cold_model:.0f} to {hot_model:.0f} N m predicted."
    )
