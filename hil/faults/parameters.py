"""Numbers of an armed fault on the bench bus: FAULT_PARAMETER."""

from decimal import Decimal

from dbc.bench_messages import FaultParameter
from hil.faults.fault import COMMON, Injection

_DIGITS = 8


def parameters(injection: Injection) -> list[FaultParameter]:
    """Its parameters that are not at their defaults."""
    kind = injection.kind
    return [
        FaultParameter(kind.number, index, *_decimal(injection.values[parameter.name]))
        for index, parameter in enumerate(kind.all_parameters)
        if parameter.name in injection.values
    ]


def own_parameters(injection: Injection) -> list[FaultParameter]:
    """The same without those that every fault has."""
    return [one for one in parameters(injection) if one.parameter is not None and one.parameter >= len(COMMON)]


def _decimal(value: float) -> tuple[int, int]:
    """Mantissa and exponent of a number of eight significant digits."""
    digits = Decimal(f"{value:.{_DIGITS - 1}e}").normalize()
    sign, numbers, exponent = digits.as_tuple()
    assert isinstance(exponent, int)
    mantissa = int("".join(map(str, numbers)))
    return (-mantissa if sign else mantissa), exponent
