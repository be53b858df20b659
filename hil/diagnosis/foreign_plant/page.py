"""The report of an FMU against measured logs: channels, measured and simulated, residuals, contexts, limits."""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.foreign_plant.compare import LEAST_SAMPLES, ChannelResidual
from hil.diagnosis.foreign_plant.residuals import NOTHING_LEFT, Residuals
from hil.diagnosis.result.channels_table import channels_section
from hil.diagnosis.result.page_parts import joined_time, log_lane, rounded
from hil.report.report import Number, Panel, Report, Section, Table, Trace
from hil.report.units import BAR, KMH, Display, Unit, symbol

_UNIT: dict[str, Unit] = {"m/s": KMH, "Pa": BAR, "rad/s": Display("deg/s", 180.0 / np.pi)}
_TITLE = {
    "wheel": "Wheel speed", "pressure": "Pressure", "motor": "Motor torque", "ax": "Longitudinal acceleration",
    "ay": "Lateral acceleration", "yaw": "Yaw rate", "gps": "Speed over ground",
}  # fmt: skip
_SIZES = ("channel", "unit", "rms", "bias", "noise", "rms/noise", "late, ms", "explained, %")
_SIZES_NOTE = (
    "Measured less simulated. Noise: what the residual shows of the sensor's own. Late: measurement behind simulation. "
    "Explained: share of the measured variance."
)
_PLACES = ("channel", "worst", "worst second", "its rms/noise", "autocorrelation", "goes with")
_PLACES_NOTE = (
    "Autocorrelation: from sample to sample, 0 of noise alone. Goes with: rank correlation, which is no cause."
)


def build_report(answer: Residuals, sources: Sequence[str]) -> Report:
    """Build the report."""
    content = answer.json
    fmu = content["fmu"]
    return Report(
        title=f"Measured data against {fmu['file']}",
        reason=content["headline"],
        numbers=tuple(_card(one) for one in answer.channels[:6]),
        sections=(
            _misses(answer.channels),
            _comparison(answer), _contexts(answer), channels_section(content), _limits(answer),
        ),
        provenance={
            "fmu": f"{fmu['name']}, FMI {fmu['fmi']}, {fmu['tool']}", "step": f"{fmu['step_s'] * 1e3:g} ms",
            "start speed": fmu["starts_at"] or "the FMU's own", "logs": list(sources), "segments": content["segments"],
            "remarks": content["remarks"],
        },
    )  # fmt: skip


def _card(one: ChannelResidual) -> Number:
    unit, factor = _shown(one.unit)
    return Number(one.channel, rounded(factor * one.rms), unit, note=f"rms; {one.over_noise:.3g} times its noise")


def _shown(unit: str) -> tuple[str, float]:
    """Unit as printed, and the factor to it."""
    shown = _UNIT.get(unit, unit)
    return symbol(shown), shown.factor if isinstance(shown, Display) else 1.0


def _misses(channels: Sequence[ChannelResidual]) -> Section:
    sizes, places = [], []
    for one in channels:
        unit, factor = _shown(one.unit)
        late = None if one.lag_s is None else round(1e3 * one.lag_s)
        size = (rounded(factor * value) for value in (one.rms, one.bias, one.noise))
        sizes.append((one.channel, unit, *size, rounded(one.over_noise), late, round(100.0 * one.explained, 1)))
        second = f"{one.worst_log} {one.worst_s[0]:.1f} s"
        share = rounded(one.worst_rms / one.noise)
        places.append((one.channel, one.worst_context, second, share, round(one.autocorrelation, 2), one.goes_with))
    tables = (Table("How far", _SIZES, tuple(sizes), _SIZES_NOTE), Table("Where", _PLACES, tuple(places), _PLACES_NOTE))
    return Section("What it misses", tables=tables)


def _comparison(answer: Residuals) -> Section:
    """Each group of channels measured and simulated, its residuals below."""
    t, gaps = joined_time(answer.dataset)
    panels: list[Panel] = []
    for group in dict.fromkeys(pair.group for pair in answer.pairs.values()):
        of = {channel: pair for channel, pair in answer.pairs.items() if pair.group == group}
        unit = _UNIT.get(next(iter(of.values())).unit, next(iter(of.values())).unit)
        traces, residuals = [], []
        for channel, pair in of.items():
            wheel = next((w for w in WHEELS if f"_{w}_" in channel), "")
            at, name = ~gaps, f" {wheel}" if wheel else ""
            traces.append(Trace(f"measured{name}", t, _at(pair.measured, at), "measured", wheel))
            traces.append(Trace(f"simulated{name}", t, _at(pair.simulated, at), group=wheel or "fl"))
            residuals.append(Trace(f"residual{name}", t, _at(pair.residual, at), group=wheel or "fl"))
        measured_first = sorted(traces, key=lambda trace: trace.style != "measured")
        panels.append(Panel(_TITLE[group], unit, tuple(measured_first)))
        panels.append(Panel(f"{_TITLE[group]}: residual", unit, tuple(residuals)))
    names = [one.log.name for one in answer.dataset.recordings]
    return Section(
        "Measured against simulated", panels=tuple(panels),
        timeline=(log_lane(names, t[gaps].tolist(), float(t[-1])),),
        text="All logs, one after the other. The FMU is driven by what driver and controller demanded in the log; "
        "each stretch begins anew at the measured speed. Residuals only where the channel is compared.",
    )  # fmt: skip


def _at(values: Floats, at: Floats) -> Floats:
    return np.asarray(np.where(at, values, np.nan))


def _contexts(answer: Residuals) -> Section:
    """Rms over noise of every channel by what the car does."""
    names = list(dict.fromkeys(name for one in answer.channels for name in one.contexts))
    rows = tuple(
        (one.channel, *(rounded(one.contexts[name] / one.noise) if name in one.contexts else None for name in names))
        for one in answer.channels
    )
    note = f"Up to {NOTHING_LEFT:g} is noise; below {LEAST_SAMPLES} samples nothing is listed."
    return Section(
        "Where it misses", tables=(Table("rms over noise, by what the car does", ("channel", *names), rows, note),)
    )


def _limits(answer: Residuals) -> Section:
    rows = [
        ("causes", "the FMU has no effects that could be tried in it: none is named; explain without --plant does"),
        ("heat and wear", "each stretch begins with a new instance of the FMU"),
    ]
    rows += [("not compared", name) for name in answer.json["not_compared"]]
    rows += [("remark", text) for text in answer.json["remarks"]]
    return Section("What this cannot show", tables=(Table("Limits", ("what", "which"), tuple(rows)),))
