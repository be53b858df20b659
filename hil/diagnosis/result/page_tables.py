"""Numbers and tables of the report: cards, numbers that moved, goodness of fit, held-out error."""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.result.answer import Answer
from hil.diagnosis.result.cross_validation import HeldOutError
from hil.diagnosis.result.headline import short_text, value_text
from hil.diagnosis.result.moved_numbers import MovedNumber, shown_numbers
from hil.diagnosis.result.page_parts import rounded
from hil.diagnosis.result.phrases import number_sentence, onset, place, shown_unit
from hil.diagnosis.result.residual_patterns import UNITS, WORDS
from hil.report.report import Cell, Chart, Curve, Number, Section, Table

_CARD_CHANNELS = ("wheel.mean", "ax", "gps", "pressure.mean", "motor.mean")


def numbers(answer: Answer) -> list[Number]:
    """The cards: verdict, causes with interval, onset and probability, held-out error."""
    listed = [Number("Verdict", answer.json["verdict"].replace("_", " "))]
    for cause in answer.json["causes"]:
        where = "" if cause["location"] == "car" else f", {place(cause['location'])}"
        for name, entry in cause["parameters"].items():
            factor, unit = shown_unit(entry["unit"])
            low, high = (factor * bound for bound in entry["ci95"])
            which = f": {name.replace('_', ' ')}" if len(cause["parameters"]) > 1 else ""
            note = (number_sentence(cause, name) or f"95 %: {low:.4g} to {high:.4g}") + onset(cause)
            listed.append(Number(f"{cause['title']}{where}{which}", factor * entry["value"], unit, note=note))
        listed.append(Number("its probability", 100.0 * cause["probability"], "%"))
    best = _best_reduced(answer.held_out)
    if best is not None and best.before > 0.0:
        listed += _reduction(best, bool(answer.json["causes"]))
    if answer.json["causes"] and not any(one.improves_on_tuning for one in answer.held_out):
        listed.append(Number("Held-out error with the cause", "in no channel less than with tuning alone"))
    return listed


def _words(channel: str) -> str:
    return WORDS[channel].replace("_", " ").removesuffix(" mps2").removesuffix(" mps").removesuffix(" rad s")


def _reduction(error: HeldOutError, has_cause: bool) -> list[Number]:
    """Held-out error of the nominal vehicle, by tuning alone, and with the cause."""
    values = {"nominal": error.before, "tuned alone": error.tuned}
    if has_cause:
        values["with the cause"] = error.after
    return [
        Number(
            f"Held-out {_words(error.channel)} error, {name}", *scaled(value, error.channel),
            note="on manoeuvres no fit saw" if name == "nominal" else _change(value, error.before),
        )
        for name, value in values.items()
    ]  # fmt: skip


def _change(value: float, before: float) -> str:
    share = 100.0 * (value / before - 1.0)
    return f"{abs(share):.0f} % {'more' if share > 0.0 else 'less'} than nominal"


def _best_reduced(errors: Sequence[HeldOutError]) -> HeldOutError | None:
    shown = [g for g in errors if g.channel in _CARD_CHANNELS]
    return max(shown, key=lambda g: 1.0 - g.after / max(g.before, 1e-12), default=None)


def moved(answer: Answer) -> Section:
    """Numbers of the car and of the logger that the fit moved, as stated and as estimated."""
    listed, others = shown_numbers(answer.moved)
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            one.words, one.key or "-", _stated(one), f"{value_text(one.estimate)} ({_interval(one)})",
            one.quantity.unit, f"{one.deviations:+.1f}{' (bound)' if one.at_bound else ''}",
        )
        for one in listed
    )  # fmt: skip
    farther = sum(abs(one.deviations) > 1.0 for one in answer.moved) - sum(abs(one.deviations) > 1.0 for one in listed)
    rest = f"{farther} of them by more than one standard deviation" if farther else "all by less than one"
    note = f"And {others} more, {rest}. A tolerance is two standard deviations."
    columns = (
        "number",
        "key in the vehicle set",
        "before the fit",
        "found (95 %)",
        "unit",
        "moved, standard deviations",
    )
    return Section(
        "Numbers that moved", tables=(Table("As stated and as found", columns, rows, note),),
        text="Uncertain numbers of the car and the logger, which are no causes: the fit moves them first.",
    )  # fmt: skip


def _stated(one: MovedNumber) -> str:
    about = f"{value_text(one.nominal)} ± {short_text(one.half_width, 2)}"
    if one.stated:
        return about
    return f"not stated: the shipped {about}" if one.nominal else f"not stated: {about}"


def _interval(one: MovedNumber) -> str:
    return f"{value_text(one.low)} to {value_text(one.high)}"


def goodness_of_fit(answer: Answer) -> list[Section]:
    """How well the model describes each channel; none where that was not tested."""
    rows = answer.json["goodness_of_fit"]
    if not rows:
        return []
    columns = tuple(rows[0])
    cells = tuple(tuple(rounded(v) if isinstance(v, float) else v for v in row.values()) for row in rows)
    heads = tuple(name.replace("_", " ") for name in columns)
    return [Section("Goodness of fit", tables=(Table("Innovations of each channel", heads, cells),))]


def held_out(answer: Answer) -> Section:
    """Error of each channel on manoeuvres that no fit saw; which ones the cause makes worse."""
    rows = tuple(
        (
            WORDS[g.channel], *scaled(g.before, g.channel)[:1], *scaled(g.tuned, g.channel)[:1],
            None if g.best_wrong is None else scaled(g.best_wrong, g.channel)[0], scaled(g.after, g.channel)[0],
            f"{scaled(g.low, g.channel)[0]:.3g} to {scaled(g.high, g.channel)[0]:.3g}",
            scaled(g.after, g.channel)[1],
        )
        for g in answer.held_out
    )  # fmt: skip
    table = Table(
        "Open-loop error on manoeuvres that no fit saw (root mean square)",
        ("channel", "nominal", "nuisances alone", "best wrong effect", "extended", "95 %", "unit"), rows,
    )  # fmt: skip
    text = against_tuning(answer.held_out) if answer.json["causes"] else ""
    return Section("Held-out error", tables=(table,), charts=_held_out_charts(answer), text=text)


def _held_out_charts(answer: Answer) -> tuple[Chart, ...]:
    """Held-out error of each channel as a share of the nominal error."""
    errors = [g for g in answer.held_out if g.before > 0.0]
    if not errors:
        return ()
    x = np.arange(1.0, len(errors) + 1.0)
    before = np.array([g.before for g in errors])
    own = np.array([g.after for g in errors]) / before
    low, high = np.array([g.low for g in errors]) / before, np.array([g.high for g in errors]) / before
    curves = [Curve("extended", x, own, low, high, "points", "fl")]
    curves.append(Curve("nuisances alone", x, np.array([g.tuned for g in errors]) / before, style="points", group="rr"))
    if all(g.best_wrong is not None for g in errors):
        wrong = np.array([g.best_wrong for g in errors], np.float64) / before
        curves.append(Curve("best wrong effect", x, wrong, style="points", group="rl"))
    curves.append(Curve("nominal", np.array([0.5, len(errors) + 0.5]), np.ones(2), style="demand"))
    title, names = "Held-out error against the nominal simulation", tuple(WORDS[g.channel] for g in errors)
    return (Chart(title, "channel", "", "error / nominal error", "", tuple(curves), names),)


def against_tuning(errors: Sequence[HeldOutError]) -> str:
    """Whether the cause improves on tuning alone, on manoeuvres that no fit saw."""
    better = [_words(error.channel) for error in errors if error.improves_on_tuning]
    text = f"Less with the cause than with tuning alone: {', '.join(better) or 'no channel'}."
    worse = [error for error in errors if error.worse_than_tuning]
    if not worse:
        return text
    listed = ", ".join(
        f"{_words(e.channel)} ({scaled(e.tuned, e.channel)[0]:g} to {scaled(e.after, e.channel)[0]:g} "
        f"{scaled(e.after, e.channel)[1]})"
        for e in worse
    )
    return f"{text} More with the cause: {listed}."


def scaled(value: float, track: str) -> tuple[float, str]:
    """Value and unit for people of a track."""
    group = track.split(".")[0]
    if group == "pressure":
        return rounded(value * 1e-5), "bar"
    return rounded(value), UNITS[group]
