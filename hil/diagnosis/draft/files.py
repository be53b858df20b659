"""The draft as two TOML files, and as lines for people; what was measured stands beside every guess."""

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from hil.diagnosis.data.log import WHEEL_SPEED, UnusableError
from hil.diagnosis.data.units import OF_CHANNEL, written
from hil.diagnosis.draft.guess import Draft, Guess, SetNumber
from hil.diagnosis.vehicle.extension_file import toml_value

MAP, SET = "CHANNELS.toml", "SET.toml"
_WIDTH = 110
_FROM_SHEET = {
    "mass_kg": "kg, as driven: kerb mass, driver, load, fuel",
    "wheelbase_m": "m",
    "cog_to_front_axle_m": "m; or front_weight_share, 0 to 1",
    "rolling_radius_m": "m, effective: way per angle; some 3 % less than the unloaded tyre's radius",
    "brake_gain_front_nm_pa": "N m at one front wheel per Pa: 2 x friction x piston area x effective radius",
    "brake_gain_rear_nm_pa": "N m at one rear wheel per Pa",
}
"""Key that a set must have -> unit, and what to look for in the sheet."""


def refuse_existing(folder: Path) -> None:
    """Refuse a folder that has one of both files: it may have been filled in.

    Raises
    ------
    UnusableError
        With the file that is there.
    """
    there = [str(path) for path in (folder / MAP, folder / SET) if path.exists()]
    if there:
        raise UnusableError(
            f"{' and '.join(there)}: there already, perhaps with what you filled in: not replaced; give another folder "
            "with --out, or move them away"
        )


def write_draft(draft: Draft, folder: Path) -> tuple[Path, Path]:
    """Write map and set into a folder, as far as they are not there (`refuse_existing`)."""
    refuse_existing(folder)
    paths = folder / MAP, folder / SET
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in zip(paths, (map_text(draft), set_text(draft)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def map_text(draft: Draft) -> str:
    """The channel map."""
    lines = _comment(
        f"Channel map drafted from {', '.join(draft.files)}. Every entry is a guess; beside it stands what it rests "
        "on, what was measured, what the data cannot tell, and what to check. Entries that lack a number are comments."
    )
    lines += [part for remark in draft.remarks for part in _comment(remark)]
    if draft.time is not None:
        lines += ["", f"time = {toml_value(draft.time)}"]
    for guess in draft.guesses:
        lines += ["", *_comment(f"{guess.channel}: by {', '.join(guess.basis)}"), *_entry(guess)]
    if draft.left_out:
        lines += ["", *_comment("Left out, whatever their names say:")]
        lines += [part for name, why in draft.left_out.items() for part in _comment(f"{name}: {why}")]
    if draft.unused:
        lines += ["", *_comment(f"Signals that no channel takes: {', '.join(draft.unused[:60])}")]
    return "\n".join(lines) + "\n"


def details(guess: Guess) -> list[str]:
    """What is known of a guess, a sentence each."""
    lines = [] if guess.evidence is None else [f"measured: {guess.evidence.text}"]
    lines += [f"measured: {text}" for text in guess.measured]
    lines += [f"cannot tell: {text}" for text in guess.unknown]
    lines += [f"check: {text}" for text in guess.check]
    return lines + ([f"or: {', '.join(guess.others[:6])}"] if guess.others else [])


def _entry(guess: Guess) -> list[str]:
    lines = [part for text in details(guess) for part in _comment(text)]
    own = [f"[{guess.channel}]", f"signal = {toml_value(guess.signal)}"]
    if guess.unit:
        own.append(f"unit = {toml_value(written(guess.unit))}")
        if guess.channel in WHEEL_SPEED and guess.unit in OF_CHANNEL["speed"]:
            own[-1] += "  # of the road: explain divides it by the set's rolling_radius_m"
    if not guess.complete:
        own.append("scale = ?  # to SI, per unit of the signal: from its maker or a measurement")
    if guess.sign < 0:
        own.append("sign = -1")
    if guess.offset is not None:
        own.append(f"offset = {toml_value(float(f'{guess.offset:.5g}'))}  # SI")
    return lines + (own if guess.complete else [f"# {line}" for line in own])


def set_text(draft: Draft) -> str:
    """The vehicle set."""
    lines = _comment(
        f"Vehicle set drafted from {', '.join(draft.files)}. `explain` refuses it until every key of `required` has a "
        "number: fill in the lines with a question mark from the car's sheet and take their # away. Add "
        "<key>_tolerance, the half-width of what a number might be; every key is in docs/vehicle-set.md."
    )
    lines += [f"required = {toml_value(list(draft.required))}"]
    by_key = {one.key: one for one in draft.numbers}
    for key in (*draft.required, *(key for key in by_key if key not in draft.required)):
        lines += ["", *_number(key, by_key.get(key))]
    return "\n".join(lines) + "\n"


def _number(key: str, number: SetNumber | None) -> list[str]:
    lines = [] if number is None else _comment(f"measured: {number.text}")
    what = _FROM_SHEET.get(key, "")
    if number is None or number.value is None:
        return [*lines, f"# {key} = ?  # from the sheet{f': {what}' if what else ''}"]
    return [
        *lines,
        f"{key} = {toml_value(number.value)}  # guess",
        f"{key}_tolerance = {toml_value(number.half_width)}",
    ]


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="#   ", break_long_words=False)


def lines_for_people(draft: Draft, paths: Sequence[Path], dbc: Path | None) -> list[str]:
    """The draft as lines for a terminal; ``paths`` of map and set as written."""
    lines = [f"drafted from {', '.join(draft.files)}", ""]
    width = max((len(one.channel) for one in draft.guesses), default=0)
    for guess in draft.guesses:
        how = " ".join(filter(None, (written(guess.unit) or "SI", "turned" if guess.sign < 0 else "")))
        state = how if guess.complete else "scale unknown: a comment in the map"
        lines.append(f"{guess.channel:<{width}}  <- {guess.signal} [{state}] ({', '.join(guess.basis)})")
        lines += list(_indented(details(guess)))
    lines += ["", "vehicle set"]
    for number in draft.numbers:
        value = "" if number.value is None else f" = {number.value:g} +- {number.half_width:g}"
        lines += list(_indented([f"{number.key}{value}: {number.text}"], "  "))
    lines += [f"  from the sheet: {', '.join(draft.missing)}"] if draft.missing else []
    for title, texts in (
        ("remarks", draft.remarks), ("left out", [f"{name}: {why}" for name, why in draft.left_out.items()]),
    ):  # fmt: skip
        lines += ["", title, *_indented(texts, "  ")] if texts else []
    lines += ["", f"written: {' and '.join(map(str, paths))}; fill in what the sheet says, then"]
    of_car = "" if dbc is None else f"--dbc {dbc} "
    lines.append(f"  brakebench explain LOG {of_car}--map {paths[0]} --vehicle {paths[1]}")
    return lines


def _indented(texts: Iterable[str], indent: str = "    ") -> Iterable[str]:
    for text in texts:
        yield from textwrap.wrap(
            text, _WIDTH + 8, initial_indent=indent, subsequent_indent=indent + "  ", break_long_words=False
        )
