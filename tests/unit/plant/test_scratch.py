"""What a call works in holds garbage at first: no result may depend on it.

A basis function of time read the time of a trial state that no step had written; a car that braked then was another one
from call to call.
"""

import numpy as np
import pytest

from plant import model
from plant.injection.bank import NO_TERMS, Shape, Variable, term
from plant.injection.plugin import NO_PLUGINS
from plant.injection.theta import BUILT_IN, THETA
from plant.integrate import EXPONENTIAL, RUNGE_KUTTA_4, SEMI_IMPLICIT
from plant.model import healthy, initial_state, pack
from plant.road import DRY, road_table
from plant.vectors import CUT, INPUT, OUTPUT, STATE

ROWS, STEPS = 120, 4
METHODS = pytest.mark.parametrize("method", [SEMI_IMPLICIT, RUNGE_KUTTA_4, EXPONENTIAL])


def _stop(car, theta, terms, method, garbage: float) -> np.ndarray:
    """States at the start of each row of a stop with brakes and motors, then a standstill, (rows, STATE.size)."""
    inputs = np.zeros((ROWS, INPUT.size))
    inputs[5:, INPUT.slice("pressure_demand_pa")] = 45e5
    inputs[5:, INPUT.slice("motor_demand_nm")] = -90.0
    inputs[20:40, INPUT.slice("steering_wheel_rad")] = 0.3
    table = np.empty((ROWS, STATE.size))
    model._simulate(
        initial_state(car, 6.0, 423.15, 0.7), inputs, CUT.zeros(), healthy(), pack(car), road_table(DRY), 2.5e-3, STEPS,
        np.full(ROWS, STEPS if method == EXPONENTIAL else 1), method, np.arange(STATE.size), table, OUTPUT.zeros(),
        theta, terms, NO_PLUGINS, np.full(model._SCRATCH_SHAPE, garbage),
    )  # fmt: skip
    assert np.isfinite(table).all()
    return table


@METHODS
@pytest.mark.parametrize("effect", [one.name for one in BUILT_IN if not one.sensing])
def test_an_effect_does_not_read_what_no_step_wrote(paper_car, effect, method):
    theta = THETA.neutral()
    for parameter in next(one for one in BUILT_IN if one.name == effect).parameters:
        theta[THETA.slice(effect, parameter.name)] = parameter.typical
    first, second = (_stop(paper_car, theta, NO_TERMS, method, garbage) for garbage in (np.nan, 0.0))
    np.testing.assert_array_equal(first, second)


@METHODS
@pytest.mark.parametrize("variable", list(Variable), ids=lambda one: one.name.lower())
def test_a_basis_function_does_not_read_what_no_step_wrote(paper_car, variable, method):
    terms = term("friction.mu", 0.3, (variable, Shape.HAT, 0.5, 1.0))[None, :]
    first, second = (_stop(paper_car, THETA.neutral(), terms, method, garbage) for garbage in (np.nan, 0.0))
    np.testing.assert_array_equal(first, second)


@METHODS
def test_a_function_of_time_knows_the_time_within_a_step(paper_car, method):
    """Pads that grow by 30 % a second: long steps come to the same stop as short ones."""
    terms = term("friction.mu", 0.3, (Variable.TIME, Shape.LINEAR, 0.0, 1.0))[None, :]
    ends = []
    for steps in (1, 4):
        inputs = np.zeros((ROWS, INPUT.size))
        inputs[:, INPUT.slice("pressure_demand_pa")] = 30e5
        x = initial_state(paper_car, 30.0, 423.15, 0.7)
        model.simulate(
            x, inputs, CUT.zeros(), healthy(), pack(paper_car), road_table(DRY), 1e-2 / STEPS / steps, STEPS * steps,
            np.full(ROWS, STEPS if method == EXPONENTIAL else 1), method, np.arange(0), np.empty((1, 0)),
            OUTPUT.zeros(), THETA.neutral(), terms, NO_PLUGINS,
        )  # fmt: skip
        ends.append(x[STATE.slice("speed_mps")][0])
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)
