"""A friction identification for programs: one JSON object, and the pad table of a plant's parameter set."""

from dataclasses import asdict
from typing import Any

from hil.identify.coverage import LEVEL, Covered
from hil.identify.fit import Fit
from hil.identify.record import Record
from hil.identify.study import Study
from hil.identify.uncertainty import Estimate, correlations, disagreements, estimates, findings, shown_directly
from plant.parameters.brakes import FrictionBrakeParameters


def as_json(study: Study) -> dict[str, Any]:
    """Return the study as plain values.

    Keys
    ----
    record, validation_record : name, samples, duration_s, averaged (samples of the file in each), remarks of the
        file's head (null without validation).
    brake : geometry taken, SI units.
    heating : "printed" (N v) or "friction" (mu N v), the form taken; forms : each form's residuals and likelihood.
    parameters : symbol, unit, meaning, value, low, high (95 %), half_width, told (well, roughly, poorly); in the order
        a, b, c, gamma, eps.  shown_directly : the same for what the record shows at once.
    correlation : 5 rows of 5, of the logarithms, in that order.  findings : sentences on what is not told.
    repeat : parameters fitted to the validation record; disagreements : sentences on those that do not agree
        (both null without validation).
    start : friction and temperature at the first sample.
    residual : of the identification; torque_nm and temperature_k, each with rms, floor, colour, memory, whiteness_p.
    identification_halves, validation_halves : two errors each; validation : error over the whole record;
        keys as in `hil.identify.validation.Error` (null without validation).
    """
    best, validation = study.best, study.validation
    return {
        "record": _record(study.record),
        "validation_record": _record(validation.record) if validation else None,
        "brake": asdict(study.brake),
        "heating": study.heating,
        "forms": {form: _form(fitted) for form, fitted in study.fits.items()},
        "parameters": [_estimate(n) for n in estimates(best)],
        "shown_directly": [_estimate(n) for n in shown_directly(best)],
        "correlation": correlations(best).tolist(),
        "findings": list(findings(best)),
        "repeat": [_estimate(n) for n in estimates(study.repeat)] if study.repeat else None,
        "disagreements": list(disagreements(best, study.repeat)) if study.repeat else None,
        "start": best.start._asdict(),
        "residual": {"torque_nm": asdict(best.torque_noise), "temperature_k": asdict(best.temperature_noise)},
        "identification_halves": [asdict(e) for e in study.errors],
        "validation": asdict(validation.whole) if validation else None,
        "validation_halves": [asdict(e) for e in validation.halves] if validation else None,
    }


def coverage_json(rows: list[Covered]) -> dict[str, Any]:
    """Return the outcome of `hil.identify.coverage`: level, met, and one row for each heating form and noise."""
    return {"level": LEVEL, "met": all(row.met for row in rows), "rows": [asdict(r) | {"met": r.met} for r in rows]}


def pad_toml(study: Study, axle: int, parameters: FrictionBrakeParameters) -> str:
    """Return the fit as the plant's pad table: `hil.scenario.parameters.load_set` reads it as `OstermeyerParameters`.

    The dynamometer had one axle's brake; gamma of the other goes with the inverse of its disc's heat capacity.
    """
    best = study.best
    a, b, c, gamma, eps = estimates(best)
    capacity = parameters.heat_capacity_j_k
    both = [gamma.value * capacity[axle] / other for other in capacity]
    synthetic = ", synthetic" if any("SYNTHETIC" in line for line in study.record.remarks) else ""
    source = f"identified from {study.record.name}{synthetic}; tolerance is half of the 95 % interval"
    other = f"{source}; {('rear', 'front')[axle]} by heat capacity"
    heating = float(study.heating == "friction")
    lines = [
        f"# Pad friction, equations (3) and (4) of the paper, T0 = {study.brake.ambient_k:g} K.",
        *(f"# {said}." for said in findings(best)),
        *(f"# {said}." for said in (disagreements(best, study.repeat) if study.repeat else ())),
        _line("a_1_ks", a.value, a, source),
        _line("b_1_j", b.value, b, source),
        _line("c_1_s", c.value, c, source),
        _line("gamma_k_w", both, gamma, other),
        _line("epsilon_w", eps.value, eps, source),
        f'heating_with_mu = {{ value = {heating}, unit = "", tolerance = 0.0, source = {_text(_why(study))} }}',
        'temperature_of_disc = { value = 0.0, unit = "", tolerance = 0.0, '
        'source = "the temperature of equation (4) was fitted" }',
    ]
    return "\n".join(lines) + "\n"


def _line(key: str, value: float | list[float], n: Estimate, source: str) -> str:
    shown = f"[{', '.join(f'{v:.6g}' for v in value)}]" if isinstance(value, list) else f"{value:.6g}"
    shown = shown if any(mark in shown for mark in ".e") else f"{shown}.0"
    return f'{key} = {{ value = {shown}, unit = "{n.unit}", tolerance = {n.half_width:.3e}, source = {_text(source)} }}'


def _why(study: Study) -> str:
    return "likelier of the two forms" if len(study.fits) > 1 else "asked for"


def _text(text: str) -> str:
    """TOML string: what a file name may hold must not end it."""
    kept = "".join(c if c.isprintable() and c not in '"\\' else "?" for c in text)
    return f'"{kept}"'


def _record(record: Record) -> dict[str, Any]:
    return {
        "name": record.name,
        "samples": record.time_s.size,
        "duration_s": float(record.time_s[-1]),
        "averaged": record.averaged,
        "remarks": list(record.remarks),
    }


def _form(fitted: Fit) -> dict[str, float | int]:
    return {
        "torque_rms_nm": fitted.torque_noise.rms,
        "temperature_rms_k": fitted.temperature_noise.rms,
        "log_likelihood": fitted.log_likelihood,
        "starts_agreeing": fitted.valleys,
    }


def _estimate(n: Estimate) -> dict[str, Any]:
    return asdict(n) | {"half_width": n.half_width, "told": n.told}
