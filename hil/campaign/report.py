"""Report of a campaign: how many passed, how the figures are distributed, the worst runs, what the figures hang on."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
import pyarrow as pa

from hil.bench.result import MEASURED
from hil.campaign.plan import Plan
from hil.campaign.sample import sensitivities
from hil.campaign.tasks import KILLED, REFUSED
from hil.errors import Verdict
from hil.report.report import Cell, Chart, Curve, Number, Report, Section, Table
from hil.report.units import symbol
from hil.report.words import float_text

_WORST = 5  # runs listed for a figure, and for a verdict
_BINS = 40
_QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
_COUNTS = ("frames_sent", "frames_lost", "frames_corrupt")
_OF_THE_BUS = (*_COUNTS, "bus_load")  # nobody looks for a run by these
_UNITS = {"m": "m", "s": "s", "mps2": "m/s2", "j": "J"}
_ENOUGH = 8  # different values of a figure from which a distribution is drawn


def verdict_of(counts: Mapping[str, int], size: int) -> tuple[Verdict, str]:
    """How a campaign is judged, and why: the worst of its runs; incomplete while some are missing."""
    there = sum(counts.values())
    words = ", ".join(f"{n} {name}" for name, n in counts.items())
    if there < size:
        return Verdict.INCOMPLETE, f"{there} of {size} runs are done ({words or 'none'}); the same command goes on"
    if any(counts.get(name) for name in (Verdict.BROKEN.value, KILLED)):
        return Verdict.BROKEN, words
    if any(counts.get(name) for name in (Verdict.FAILED.value, REFUSED)):
        return Verdict.FAILED, words
    return Verdict.PASSED, words


def verdict_counts(table: pa.Table) -> dict[str, int]:
    """Number of runs by verdict, the most frequent first."""
    counted = table.column("verdict").value_counts().to_pylist()
    pairs = sorted(((one["values"], one["counts"]) for one in counted), key=lambda pair: (-pair[1], pair[0]))
    return dict(pairs)


def build_report(plan: Plan, table: pa.Table, rate_per_s: float | None) -> Report:
    """Everything there is to say of the results so far.

    Parameters
    ----------
    table : as of `Store.table`.  rate_per_s : runs a second of this command; None where it ran none.
    """
    counts = verdict_counts(table)
    verdict, reason = verdict_of(counts, plan.size)
    numbers = [Number("Runs", table.num_rows, note=f"of {plan.size}")]
    numbers += [Number(f"Runs {name}", n, note=f"{100.0 * n / table.num_rows:.4g} %") for name, n in counts.items()]
    if rate_per_s is not None:
        numbers.append(Number("Rate of this command", rate_per_s, "runs/s"))
    sections = [_figures(plan, table), *_sensitivities(plan, table), *_bad(plan, table)]
    provenance = {
        "campaign": str(plan.source), "fingerprint": plan.fingerprint, "method": plan.method,
        "points": len(plan.points),
        "scenarios": {name: base.sha256 for name, base in plan.bases.items()},
        "seeds": f"{plan.seeds[0]} to {plan.seeds[-1]}",
        "varied": {one.name: one.key for one in plan.varied},
    }  # fmt: skip
    return Report(plan.title, verdict, reason, tuple(numbers), tuple(sections), provenance)


def unit_of(figure: str) -> str:
    """Unit of a figure, by the end of its name."""
    return _UNITS.get(figure.rpartition("_")[2], "1")


def _title(figure: str) -> str:
    """A figure in words, without its unit."""
    name, _, unit = figure.rpartition("_")
    return (name if unit in _UNITS else figure).replace("_", " ")


def command(plan: Plan, number: int) -> str:
    """What repeats a run, with its recording and report."""
    return f"brakebench campaign {plan.source} --repeat {number}"


def _values(table: pa.Table, name: str) -> np.ndarray:
    return np.asarray(table.column(name).to_numpy(zero_copy_only=False), np.float64)


def _figures(plan: Plan, table: pa.Table) -> Section:
    """Quantiles and distribution of every figure, and its extreme runs."""
    rows: list[tuple[Cell, ...]] = []
    worst: list[tuple[Cell, ...]] = []
    charts = []
    for name in MEASURED:
        values = _values(table, name)
        known = np.flatnonzero(np.isfinite(values))
        if not known.size or np.ptp(values[known]) == 0.0:
            continue
        order = known[np.argsort(values[known], kind="stable")]
        rows.append(
            (name, symbol(unit_of(name)), known.size, *(float(q) for q in np.quantile(values[known], _QUANTILES)))
        )
        if name not in _OF_THE_BUS:
            worst.append(_extreme(table, name, "least", order[:_WORST]))
            worst.append(_extreme(table, name, "greatest", order[: -_WORST - 1 : -1]))
        if name not in _COUNTS and np.unique(values[known]).size >= _ENOUGH:
            charts.append(_distribution(name, values[known]))
    heads = ("figure", "unit", "runs", "least", "5 %", "median", "95 %", "greatest")
    tables = (
        Table("Quantiles", heads, tuple(rows), "Figures that are the same in all runs are left out."),
        Table("Extreme runs", ("figure", "", "run: value"), tuple(worst), f"{command(plan, 0).rpartition(' ')[0]} RUN "
              "repeats one, with recording and report."),
    )  # fmt: skip
    return Section("Figures of merit", charts=tuple(charts), tables=tables)


def _extreme(table: pa.Table, name: str, end: str, rows: np.ndarray) -> tuple[str, str, str]:
    runs, values = table.column("run"), table.column(name)
    return name, end, ", ".join(f"{runs[k].as_py()}: {float_text(values[k].as_py())}" for k in rows.tolist())


def _distribution(name: str, values: np.ndarray) -> Chart:
    n = values.size
    order = np.sort(values)
    keep = np.unique(np.linspace(0, n - 1, min(n, 500)).astype(np.intp))
    curve = Curve("share of the runs below", order[keep], 100.0 * (keep + 0.5) / n)
    return Chart(_title(name), _title(name), unit_of(name), "share of the runs", "%", (curve,))


def _sensitivities(plan: Plan, table: pa.Table) -> Iterator[Section]:
    """Sobol' indices where the design allows them and every run is there."""
    if plan.method != "saltelli" or table.num_rows < plan.size or len(plan.seeds) > 1:
        return
    charts, rows = [], list[tuple[Cell, ...]]()
    per_scenario = len(plan.points)
    for k, scenario in enumerate(plan.bases):
        part = table.slice(k * per_scenario, per_scenario)
        for name in MEASURED:
            values = _values(part, name)
            if not np.isfinite(values).all() or np.ptp(values) == 0.0:
                continue
            found = sensitivities(plan.varied, values, plan.seed)
            labels = tuple(one.name for one in plan.varied)
            rows += [
                (scenario, name, label, *(float(found[key][i]) for key in ("S1", "S1_conf", "ST", "ST_conf")))
                for i, label in enumerate(labels)
            ]
            if name not in _COUNTS:
                charts.append(_indices(f"{_title(name)} of {scenario}", labels, found))
    note = (
        "S1: share of the variance that goes with this input alone; ST: with its interactions (Saltelli 2010). "
        "Half-widths of 95 %, by resampling."
    )
    heads = ("scenario", "figure", "input", "S1", "+-", "ST", "+-")
    yield Section("Sensitivities (Sobol')", charts=tuple(charts), tables=(Table("", heads, tuple(rows), note),))


def _indices(title: str, labels: tuple[str, ...], found: Mapping[str, np.ndarray]) -> Chart:
    x = np.arange(1, len(labels) + 1, dtype=np.float64)
    curves = tuple(
        Curve(words, x, found[key], found[key] - found[f"{key}_conf"], found[key] + found[f"{key}_conf"], "points")
        for key, words in (("S1", "first order"), ("ST", "total order"))
    )
    return Chart(title, "input", "1", "share of the variance", "1", curves, rows=labels)


def _bad(plan: Plan, table: pa.Table) -> Iterator[Section]:
    """Runs that did not pass: the first of each verdict, with their inputs and what repeats them."""
    verdicts = np.asarray(table.column("verdict").to_pylist())
    names = [one.name for one in plan.varied]
    rows = []
    for verdict in (KILLED, Verdict.BROKEN.value, REFUSED, Verdict.FAILED.value):
        for k in np.flatnonzero(verdicts == verdict)[:_WORST].tolist():
            row = table.slice(k, 1).to_pylist()[0]
            inputs = ", ".join(f"{name} {_short(row[name])}" for name in names)
            rows.append((verdict, row["run"], row["scenario"], row["seed"], inputs, row["reason"],
                         command(plan, row["run"])))  # fmt: skip
    if rows:
        heads = ("verdict", "run", "scenario", "seed", "inputs", "why", "repeat with")
        note = f"At most {_WORST} of each verdict; all are in results/ (Parquet)."
        yield Section("Runs that did not pass", tables=(Table("", heads, tuple(rows), note),))


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else "-" if math.isnan(value) else float_text(value)
