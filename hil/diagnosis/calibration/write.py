"""A calibration as a vehicle set in TOML, and as lines for people."""

from collections.abc import Sequence
from pathlib import Path

from hil.diagnosis.calibration.calibrate import Calibration
from hil.diagnosis.calibration.fitted_set import FittedNumber, Value
from hil.diagnosis.vehicle.extension_file import toml_key, toml_value

_DIGITS = 6


def write_set(found: Calibration, path: Path, source: Path) -> None:
    """Write the set; comments say what it was fitted to, what moved by how much, and its held-out error."""
    lines = [
        f"# Fitted by brakebench calibrate to {', '.join(found.logs)}, starting from {source}.",
        "# A tolerance is two standard deviations after the fit; keys without a comment are as they were.",
    ]
    lines += [f"# {text}" for text in error_lines(found)]
    by_key = {one.key: one for one in found.numbers}
    for key, value in found.table.items():
        rounded = _rounded(value) if key.removesuffix("_tolerance") in by_key else value
        moved = f"  # moved {_moved(by_key[key])}" if key in by_key else ""
        lines.append(f"{toml_key(key)} = {toml_value(rounded)}{moved}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def lines_for_people(found: Calibration, path: Path) -> list[str]:
    """What was fitted, by how much it moved, and what the reference still shows."""
    lines = [f"fitted to {', '.join(found.logs)}", ""]
    for one in found.numbers:
        before, after = _text(one.before, one.tolerance_before), _text(one.after, one.tolerance_after)
        where = "" if one.stated else ", not in the set before"
        lines.append(f"  {one.key}: {before} -> {after} {one.unit}".rstrip() + f" (moved {_moved(one)}{where})")
    if not found.numbers:
        lines.append("  the logs teach no number of the set more than its tolerance says")
    lines += ["", "root mean square error", *(f"  {text}" for text in error_lines(found))]
    if found.left:
        lines += ["", f"the reference itself is not explained: {found.left}; see `brakebench explain` on it"]
    lines += ["", "remarks", *(f"  {text}" for text in found.remarks)] if found.remarks else []
    return [*lines, "", f"written: {path}"]


def error_lines(found: Calibration) -> list[str]:
    """Error of each channel: of the set as it was, and of manoeuvres that the fit did not see."""
    return [
        f"{one.channel}: {one.before:.4g} as stated, {one.after:.4g} ({one.low:.4g} to {one.high:.4g}) held out"
        for one in found.errors
    ]


def _moved(one: FittedNumber) -> str:
    bound = ", as far as it may" if one.at_bound else ""
    return f"{one.moved:+.2f} tolerances{bound}"


def _text(value: Value, tolerance: float) -> str:
    values: Sequence[float] = value if isinstance(value, list) else [value]
    return f"{', '.join(f'{part:.5g}' for part in values)} +- {tolerance:.2g}"


def _rounded(value: Value) -> Value:
    if isinstance(value, list):
        return [float(f"{part:.{_DIGITS}g}") for part in value]
    return float(f"{value:.{_DIGITS}g}")
