"""Units that a foreign table or channel map may use, as factor and offset to SI."""

from hil.diagnosis.data.log import UnusableError

_TO_SI: dict[str, tuple[float, float]] = {
    "": (1.0, 0.0), "1": (1.0, 0.0), "s": (1.0, 0.0), "ms": (1e-3, 0.0), "us": (1e-6, 0.0), "ns": (1e-9, 0.0),
    "rad/s": (1.0, 0.0), "deg/s": (0.017453292519943295, 0.0), "rpm": (0.10471975511965977, 0.0),
    "1/min": (0.10471975511965977, 0.0), "m/s2": (1.0, 0.0), "m/s^2": (1.0, 0.0), "m/s²": (1.0, 0.0),
    "g": (9.80665, 0.0), "pa": (1.0, 0.0), "kpa": (1e3, 0.0), "mpa": (1e6, 0.0), "bar": (1e5, 0.0),
    "psi": (6894.757293168, 0.0), "nm": (1.0, 0.0), "n m": (1.0, 0.0), "rad": (1.0, 0.0),
    "deg": (0.017453292519943295, 0.0), "%": (0.01, 0.0), "m/s": (1.0, 0.0), "km/h": (1.0 / 3.6, 0.0),
    "kmph": (1.0 / 3.6, 0.0), "kph": (1.0 / 3.6, 0.0), "mph": (0.44704, 0.0), "k": (1.0, 0.0), "degc": (1.0, 273.15),
}  # fmt: skip


def to_si(unit: str, where: str) -> tuple[float, float]:
    """Factor and offset: SI = value * factor + offset.

    Raises
    ------
    UnusableError
        A unit that is not known.
    """
    found = _TO_SI.get(unit.strip().lower())
    if found is None:
        raise UnusableError(f"{where}: unit {unit!r} is not known; expected one of {', '.join(u for u in _TO_SI if u)}")
    return found
