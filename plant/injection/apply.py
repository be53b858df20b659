"""From parameters and theta to what the equations read; the effects' equations in their order.

The vector ``q``: parameters as the equations read them, parameters and injection points without what the state decides,
theta at the time, which effects are on, the basis terms, the effects from outside. The injection points lie in ``y``,
behind the outputs.
"""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from plant.compiled import EFFECTS, block, equation, section
from plant.effects.catalogue import BUILT_IN
from plant.inject import COUNT, FIRST, neutral_injection
from plant.injection import bank, plugin
from plant.injection.theta import ALWAYS_S, THETA
from plant.layout import Layout, Vector
from plant.vectors import BASE_RATES, PARAMETER, RATES, C, U, X, Y

_BRANCHES = 8
ON_OFF = tuple(effect.name for effect in BUILT_IN if not effect.sensing)
Q = Layout(
    "Q",
    {
        "live": PARAMETER.size,
        "static": PARAMETER.size,
        "injection_points": COUNT,
        "theta": THETA.size,
        "on": len(ON_OFF),
        "anything": 1,  # whether any effect is on at any time
        "settled": 1,  # whether the rest of a call is as this row is
        "dynamic": 1,  # whether the state decides anything
        "rates": 1,  # whether extra states move
        "terms": 1,
        "term_rows": bank.MOST_TERMS * bank.COLUMNS,
        "plugins": 1,
        "plugin_rows": plugin.MOST_PLUGINS * plugin.COLUMNS,
    },
)
_NEUTRAL = neutral_injection()
_AT = Q.at
_PARAMETERS, _THETA = PARAMETER.size, THETA.size
_NUMBERS = THETA.strengths
_FIRST_EXTRA, _LAST_EXTRA = BASE_RATES.size, RATES.size


def _owners() -> tuple[Any, Any]:
    """Of each number of theta: which effect it switches on (-1 none), and where that effect's times lie."""
    owner, times = np.full(_NUMBERS, -1), np.zeros(_NUMBERS, dtype=np.int64)
    for effect in BUILT_IN:
        if effect.sensing:
            continue
        for parameter in effect.strengths:
            owner[THETA.slice(effect.name, parameter.name)] = ON_OFF.index(effect.name)
            times[THETA.slice(effect.name, parameter.name)] = THETA.slice(effect.name, "onset_s").start
    return owner, times


_OWNER, _TIMES = _owners()
_STATEFUL = np.array([e.dynamic is not None or e.rates is not None for e in BUILT_IN if not e.sensing])
_MOVING = np.array([e.rates is not None for e in BUILT_IN if not e.sensing])


def _sequence(functions: Sequence[tuple[Callable[..., None], int, int]]) -> Callable[..., None]:
    """One function that calls those whose effect is on.

    Each comes with the places in ``q`` where it says whether its effect is on, and where its numbers begin.
    """
    if len(functions) > _BRANCHES:
        few = -(-len(functions) // _BRANCHES)
        parts = [_sequence(functions[k : k + few]) for k in range(0, len(functions), few)]
        return _all_of((*parts, *[_nothing] * (_BRANCHES - len(parts))))
    padded: list[tuple[Any, int, int]] = [*functions, *[(_no_equation, 0, 0)] * (_BRANCHES - len(functions))]
    (f0, s0, k0), (f1, s1, k1), (f2, s2, k2), (f3, s3, k3) = padded[:4]
    (f4, s4, k4), (f5, s5, k5), (f6, s6, k6), (f7, s7, k7) = padded[4:]

    @equation
    def run(x: Vector, u: Vector, q: Vector, y: Vector) -> None:
        if q[s0] > 0.5:
            f0(x, u, q, k0, y)
        if q[s1] > 0.5:
            f1(x, u, q, k1, y)
        if q[s2] > 0.5:
            f2(x, u, q, k2, y)
        if q[s3] > 0.5:
            f3(x, u, q, k3, y)
        if q[s4] > 0.5:
            f4(x, u, q, k4, y)
        if q[s5] > 0.5:
            f5(x, u, q, k5, y)
        if q[s6] > 0.5:
            f6(x, u, q, k6, y)
        if q[s7] > 0.5:
            f7(x, u, q, k7, y)

    return run


@equation
def _nothing(_x: Vector, _u: Vector, _q: Vector, _y: Vector) -> None:
    return


@equation
def _no_equation(_x: Vector, _u: Vector, _q: Vector, _k: int, _y: Vector) -> None:
    return


def _all_of(parts: Sequence[Callable[..., None]]) -> Callable[..., None]:
    p0, p1, p2, p3, p4, p5, p6, p7 = parts

    @equation
    def run(x: Vector, u: Vector, q: Vector, y: Vector) -> None:
        p0(x, u, q, y)
        p1(x, u, q, y)
        p2(x, u, q, y)
        p3(x, u, q, y)
        p4(x, u, q, y)
        p5(x, u, q, y)
        p6(x, u, q, y)
        p7(x, u, q, y)

    return run


def _of_theta_alone(static: Callable[..., None]) -> Callable[..., None]:
    @section
    def equation_of_state(_x: Vector, _u: Vector, q: Vector, k: int, y: Vector) -> None:
        static(q, k, y)

    return equation_of_state


def _stage(name: str) -> Callable[..., None]:
    found = []
    for effect in BUILT_IN:
        function = getattr(effect, name)
        if function is not None:
            first = THETA.slice(effect.name, effect.parameters[0].name).start
            of_state = _of_theta_alone(function) if name == "static" else function
            found.append((of_state, _AT.on + ON_OFF.index(effect.name), _AT.theta + first))
    return _sequence(found)


_static, _dynamic, _rates = _stage("static"), _stage("dynamic"), _stage("rates")


@section
def _load(p: Vector, theta: Vector, terms: Vector, plugins: Vector, q: Vector, y: Vector, stage: Vector) -> None:
    """Fill ``q`` for a call: parameters, neutral injection points, which effects are on at any time.

    ``y`` and ``stage`` are the vectors of outputs that the call will use.
    """
    for k in range(_PARAMETERS):
        q[k] = p[k]
        q[_AT.static + k] = p[k]
    for k in range(COUNT):
        q[_AT.injection_points + k] = _NEUTRAL[k]
        y[FIRST + k] = _NEUTRAL[k]
        stage[FIRST + k] = _NEUTRAL[k]
    for i in range(4):  # what a term may ask for before the first evaluation
        stage[Y.wheel_load_n + i] = y[Y.wheel_load_n + i]
    anything = False
    for k in range(_NUMBERS):
        if (theta[k] != 0.0) & (_OWNER[k] >= 0):
            anything = True
            break
    bank.load(terms, q, _AT.terms, _AT.term_rows)
    plugin.load(plugins, q, _AT.plugins, _AT.plugin_rows)
    q[_AT.anything] = 1.0 if anything else 0.0
    q[_AT.settled] = 0.0
    q[_AT.dynamic] = 1.0 if terms.shape[0] + plugins.shape[0] > 0 else 0.0
    q[_AT.rates] = 1.0 if bank.moves(terms) or plugins.shape[0] > 0 else 0.0
    for k in range(len(ON_OFF)):
        q[_AT.on + k] = 0.0
    if anything or q[_AT.dynamic] > 0.5:
        for k in range(_THETA):
            q[_AT.theta + k] = theta[k]
    for k in range(_NUMBERS):
        if anything and theta[k] != 0.0 and _OWNER[k] >= 0:
            effect = _OWNER[k]
            q[_AT.on + effect] = 1.0
            if _STATEFUL[effect]:
                q[_AT.dynamic] = 1.0
            if _MOVING[effect]:
                q[_AT.rates] = 1.0


@block
def update_row(
    x: Vector, u: Vector, p: Vector, theta: Vector, begin_s: float, end_s: float, q: Vector, y: Vector, stage: Vector
) -> None:
    """Bring ``q`` to a row of inputs: theta within its times, then what theta alone decides.

    A strength counts with the share of the row that lies between onset and end. Where none begins or ends later, one
    row is as all that follow.
    """
    later = False
    for k in range(_NUMBERS):
        if theta[k] != 0.0 and _OWNER[k] >= 0:
            onset, until = theta[_TIMES[k]], theta[_TIMES[k] + 1]
            later |= (begin_s < onset) | (until < ALWAYS_S)
            within = min(end_s, until) - max(begin_s, onset)
            length = end_s - begin_s
            share = 1.0 if within >= length else max(within, 0.0) / length
            q[_AT.theta + k] = theta[k] if share == 1.0 else share * theta[k]
    for k in range(_PARAMETERS):
        q[k] = p[k]
    for k in range(COUNT):
        y[FIRST + k] = _NEUTRAL[k]
    q[_AT.settled] = 0.0 if later else 1.0
    _static(x, u, q, y)
    for k in range(_PARAMETERS):
        q[_AT.static + k] = q[k]
    for k in range(COUNT):
        q[_AT.injection_points + k] = y[FIRST + k]
        stage[FIRST + k] = y[FIRST + k]


@block
def _decide(x: Vector, u: Vector, cut: Vector, q: Vector, y: Vector) -> None:
    for k in range(_PARAMETERS):
        q[k] = q[_AT.static + k]
    for k in range(COUNT):
        y[FIRST + k] = q[_AT.injection_points + k]
    for i in range(4):
        y[Y.pressure_pa + i] = u[U.pressure_pa + i] if cut[C.pressure + i] > 0.5 else x[X.pressure_pa + i]
    _dynamic(x, u, q, y)
    bank.apply(x, u, q, y, _AT.terms, _AT.term_rows)
    plugin.call(x, u, q, y, _AT.plugins, _AT.plugin_rows, _AT.theta, 0)


@block
def _move(x: Vector, u: Vector, q: Vector, y: Vector) -> None:
    for k in range(_FIRST_EXTRA, _LAST_EXTRA):
        y[Y.rate + k] = 0.0
        y[Y.decay_1_s + k] = 0.0
    for i in range(4):
        y[Y.hub_swing_1_s + i] = 0.0
        y[Y.hub_push_1_kg + i] = 0.0
    bank.rates(x, q, y, _AT.terms)
    _rates(x, u, q, y)
    plugin.call(x, u, q, y, _AT.plugins, _AT.plugin_rows, _AT.theta, 1)


@section
def _before(x: Vector, u: Vector, cut: Vector, q: Vector, y: Vector) -> None:
    """What the state decides at the injection points."""
    if q[_AT.dynamic] > 0.5:
        _decide(x, u, cut, q, y)


@section
def _after(x: Vector, u: Vector, q: Vector, y: Vector) -> None:
    """Rates of the extra states."""
    if q[_AT.rates] > 0.5:
        _move(x, u, q, y)


@section
def _moving(q: Vector) -> bool:
    """Whether extra states move."""
    return q[_AT.rates] > 0.5


@section
def _row(
    x: Vector, u: Vector, p: Vector, theta: Vector, begin_s: float, end_s: float, q: Vector, y: Vector, stage: Vector
) -> None:
    """Bring ``q`` to a row of inputs, where an effect may change it."""
    if q[_AT.anything] > 0.5 and q[_AT.settled] < 0.5:
        update_row(x, u, p, theta, begin_s, end_s, q, y, stage)


@section
def _no_before(_x: Vector, _u: Vector, _cut: Vector, _q: Vector, _y: Vector) -> None:
    return


@section
def _no_after(_x: Vector, _u: Vector, _q: Vector, _y: Vector) -> None:
    return


@section
def _never(_q: Vector) -> bool:
    return False


@section
def _copy(p: Vector, _theta: Vector, _terms: Vector, _plugins: Vector, q: Vector, _y: Vector, _stage: Vector) -> None:
    for k in range(_PARAMETERS):
        q[k] = p[k]


@section
def _no_row(
    _x: Vector,
    _u: Vector,
    _p: Vector,
    _theta: Vector,
    _begin_s: float,
    _end_s: float,
    _q: Vector,
    _y: Vector,
    _stage: Vector,
) -> None:
    return


SIZE = Q.size if EFFECTS else PARAMETER.size
begin: Callable[..., None] = _load if EFFECTS else _copy
row: Callable[..., None] = _row if EFFECTS else _no_row
before: Callable[..., None] = _before if EFFECTS else _no_before
after: Callable[..., None] = _after if EFFECTS else _no_after
extra_states_move: Callable[..., bool] = _moving if EFFECTS else _never
