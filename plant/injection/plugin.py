"""Effects from outside: compiled alone, called through a pointer, so that nothing else is compiled again."""

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]  # it ships no types
from numba import types
from numba.extending import intrinsic

from plant.compiled import equation
from plant.effects.effect import Effect
from plant.layout import Vector
from plant.vectors import X

MOST_PLUGINS = 8
COLUMNS = 4  # pointer of the dynamic equation, of the rates (0 none), first number and onset in theta
nb: Any = numba  # whose types are not declared
_UNCOMPILED = bool(getattr(nb.config, "DISABLE_JIT", False))
_FUNCTIONS: list[Any] = []  # keeps compiled functions alive; uncompiled, the "pointer" counts them from 1


@intrinsic
def _at_pointer(_typing: Any, _address: Any, x: Any, u: Any, q: Any, _first: Any, y: Any) -> Any:
    """Call ``void f(double *x, double *u, double *q, int64 first, double *y)`` at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType().as_pointer()
        integer = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [double, double, double, integer, double])
        pointers = []
        for value, kind_of in zip(arguments[1:], signature.args[1:], strict=True):
            if isinstance(kind_of, types.Array):
                pointers.append(context.make_array(kind_of)(context, builder, value).data)
            else:
                pointers.append(value)
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), pointers)
        return context.get_dummy_value()

    return types.void(types.int64, x, u, q, types.int64, y), generate


def _by_number(address: int, x: Vector, u: Vector, q: Vector, first: int, y: Vector) -> None:
    _FUNCTIONS[address - 1](x, u, q, first, y)


_call_pointer: Any = _by_number if _UNCOMPILED else _at_pointer


@equation
def load(plugins: Vector, q: Vector, count: int, rows: int) -> None:
    """Copy the table into ``q``."""
    q[count] = min(plugins.shape[0], MOST_PLUGINS)
    for k in range(min(plugins.shape[0], MOST_PLUGINS)):
        for column in range(COLUMNS):
            q[rows + k * COLUMNS + column] = plugins[k, column]


@equation
def call(x: Vector, u: Vector, q: Vector, y: Vector, count: int, rows: int, theta: int, stage: int) -> None:
    """Call every effect from outside; ``stage`` 0 its equation at the injection points, 1 the rates of its states."""
    for k in range(int(q[count])):
        row = rows + k * COLUMNS
        address = int(q[row + stage])
        times = theta + int(q[row + 3])
        if (address != 0) & (x[X.time_s] >= q[times]) & (x[X.time_s] < q[times + 1]):
            _call_pointer(address, x, u, q, theta + int(q[row + 2]), y)


def _pointer(function: Any, sizes: tuple[int, int, int, int]) -> float:
    """Compile one equation; its address, exact in a float because addresses have 47 bits."""
    if _UNCOMPILED:
        _FUNCTIONS.append(function)
        return float(len(_FUNCTIONS))
    inner = equation(function)
    n_x, n_u, n_q, n_y = sizes
    vector = nb.types.CPointer(nb.types.float64)

    def outer(x: Any, u: Any, q: Any, first: int, y: Any) -> None:
        inner(nb.carray(x, (n_x,)), nb.carray(u, (n_u,)), nb.carray(q, (n_q,)), first, nb.carray(y, (n_y,)))

    compiled = nb.cfunc(nb.types.void(vector, vector, vector, nb.types.int64, vector))(outer)
    _FUNCTIONS.append(compiled)
    return float(compiled.address)


def table(effects: Sequence[Effect], places: Sequence[tuple[int, int]], sizes: tuple[int, int, int, int]) -> Vector:
    """Rows for effects from outside; places of their first number and their onset in theta; sizes of x, u, q and y."""
    if len(effects) > MOST_PLUGINS:
        raise ValueError(f"{len(effects)} effects from outside; room is for {MOST_PLUGINS}")
    rows = np.zeros((len(effects), COLUMNS))
    for k, (effect, place) in enumerate(zip(effects, places, strict=True)):
        rows[k, 0] = 0.0 if effect.dynamic is None else _pointer(effect.dynamic, sizes)
        rows[k, 1] = 0.0 if effect.rates is None else _pointer(effect.rates, sizes)
        rows[k, 2:] = place
    return rows


NO_PLUGINS = np.empty((0, COLUMNS))
