"""The model's right-hand side as scipy wants it, for references and comparisons of speed."""

import numpy as np
from numpy.typing import NDArray

from plant.layout import Vector
from plant.model import Scene, advance, pack
from plant.parameters import PlantParameters
from plant.vectors import OUTPUT, STATE, Y


class RightHandSide:
    """``f(t, x)`` over the continuous state, under constant inputs, without the dead time of the brake."""

    def __init__(self, parameters: PlantParameters, inputs: Vector) -> None:
        self._inputs, self._p, self._scene = inputs, pack(parameters), Scene()
        self._y = OUTPUT.zeros()
        self._x = STATE.zeros()

    def __call__(self, time_s: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rates of change, of the shape of ``x``."""
        self._x[: x.size] = x
        advance(self._x, self._inputs, self._p, self._y, 0, self._scene)
        return self._y[Y.rate : Y.rate + x.size].copy()
