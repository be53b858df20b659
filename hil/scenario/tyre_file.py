"""Tyre property files (``.tir``) of the PAC2002 family, as one more way to a parameter set of the tyre."""

import dataclasses
import re
from pathlib import Path
from typing import NamedTuple

from hil.scenario.parameters import ParameterError, override
from plant.parameters.tyre import TyreParameters

FIT_TYPES = {"PAC2002": "6", "MF-TYRE 5.2": "5"}  # PROPERTY FITTYP whose equations are those of plant/tyre.py
_SI_UNITS = {"LENGTH": {"meter", "m"}, "FORCE": {"newton", "n"}, "ANGLE": {"radian", "radians", "rad"}}
_OURS = {"relaxation_least_m", "low_speed_mps", "low_speed_damping_ns_m"}  # of our model, not of the Magic Formula
_LINE = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*('[^']*'|\"[^\"]*\"|[^\s$!]+)")


class TyreFile(NamedTuple):
    """A tyre read from a file.

    Attributes
    ----------
    tyre : the coefficients; values the file does not have keep those of the base set (scaling factors: 1).
    kept : coefficients that the file lacks.
    unused : keys of the file that the model has no use for (camber, aligning moment, ...).
    """

    tyre: TyreParameters
    kept: tuple[str, ...]
    unused: tuple[str, ...]


def load_tir(path: Path, base: TyreParameters) -> TyreFile:
    """Read a ``.tir`` file.

    Parameters
    ----------
    path : the file; SI units, FITTYP 5 or 6 (or PROPERTY_FILE_FORMAT PAC2002).
    base : set that gives what the file lacks.

    Raises
    ------
    ParameterError
        Unreadable; another tyre model; other units; a value that is no number; a pure-slip coefficient missing; or
        RCX1 and REX1 exchanged, as in some published copies: a curvature factor E above 1 has no meaning in the
        Magic Formula (Pacejka, Tyre and Vehicle Dynamics, section 4.3.2).
    """
    values = _entries(path)
    _check_model(path, values)
    names = [field.name for field in dataclasses.fields(TyreParameters) if field.name not in _OURS]
    changes = {name: _number(path, name, values[name]) for name in names if name in values}
    needed = [name for name in names if name[0] == "p" and name[2] in "xy" and name not in changes]
    if needed:
        raise ParameterError(f"{path}: lacks {', '.join(n.upper() for n in needed)}; the pure-slip curves need them")
    for side in "xy":
        curvature, shape = changes.get(f"re{side}1", 0.0), changes.get(f"rc{side}1", 1.0)
        if curvature > 1.0 >= shape:
            raise ParameterError(
                f"{path}: RE{side.upper()}1 = {curvature:g} is above 1, RC{side.upper()}1 = {shape:g}: these two are "
                "exchanged, as in some published copies; exchange them back"
            )
    neutral = {name: 1.0 for name in names if name[0] == "l" and name not in changes}
    kept = tuple(sorted(set(names) - set(changes) - set(neutral)))
    unused = tuple(sorted(set(values) - set(changes) - {"fittyp", "property_file_format", "length", "force", "angle"}))
    return TyreFile(override(base, changes | neutral, str(path)), kept, unused)


def _entries(path: Path) -> dict[str, str]:
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read ({error.strerror}); give the path of a .tir file") from error
    matches = [_LINE.match(line) for line in lines if not line.lstrip().startswith(("$", "!", "["))]
    return {match[1].lower(): match[2].strip("'\"") for match in matches if match}


def _check_model(path: Path, values: dict[str, str]) -> None:
    fit, form = values.get("fittyp", ""), values.get("property_file_format", "").upper()
    if fit not in FIT_TYPES.values() and form != "PAC2002":
        known = ", ".join(f"{code} ({name})" for name, code in FIT_TYPES.items())
        raise ParameterError(f"{path}: expected FITTYP {known}, got {fit or form or 'none'}; its equations differ")
    for key, allowed in _SI_UNITS.items():
        unit = values.get(key.lower(), "").lower()
        if unit not in allowed:
            raise ParameterError(f"{path}: expected {key} in {sorted(allowed)[0]}, got {unit or 'nothing'}; convert it")


def _number(path: Path, name: str, text: str) -> float:
    try:
        return float(text.lower().replace("d", "e"))
    except ValueError:
        raise ParameterError(f"{path}: {name.upper()}: expected a number, got {text!r}") from None
