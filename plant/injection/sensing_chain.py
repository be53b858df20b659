"""All sensing effects of a theta, in the order in which a signal meets them."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from plant.effects.effect import Effect
from plant.effects.sensing.catalogue import SENSING
from plant.effects.sensing.kind import Memory, Numbers
from plant.injection.theta import THETA, Theta
from plant.layout import Vector


@cache
def _strengths(layout: Theta) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where the numbers lie that switch effects on, and where those of each effect begin among them."""
    places = np.arange(layout.size)
    of_each = [
        np.concatenate([places[layout.slice(effect.name, p.name)] for p in effect.strengths]) for effect in SENSING
    ]
    return np.concatenate(of_each), np.cumsum([0, *map(len, of_each)])[:-1]


class Chain:
    """What the nodes make of their signals; keeps its memory from call to call.

    Parameters
    ----------
    theta : numbers of all effects.
    layout : where they lie.
    in_time : nothing is delayed; `late_s` says by how long it would be.
    """

    def __init__(self, theta: Vector, layout: Theta = THETA, in_time: bool = False) -> None:
        self._theta = theta
        self._layout = layout
        self._memory: dict[tuple[str, str], Memory] = {}
        strengths, begins = _strengths(layout)
        on = np.logical_or.reduceat(theta[strengths] != 0.0, begins)
        every = [effect for effect, is_on in zip(SENSING, on, strict=True) if is_on]
        self._late = [effect for effect in every if effect.late_s is not None]
        self._active = [effect for effect in every if not (in_time and effect.late_s)]
        self._nodes = {node for effect in self._active for node in effect.nodes}

    def _numbers(self, effect: Effect, time_s: Vector) -> Numbers:
        onset, until = (self._theta[self._layout.slice(effect.name, name)][0] for name in ("onset_s", "until_s"))
        always = bool(onset <= time_s[0] and time_s[-1] < until)  # times increase
        within = None if always else ((time_s >= onset) & (time_s < until))[:, None]
        numbers = {}
        for parameter in effect.parameters:
            values = self._theta[self._layout.slice(effect.name, parameter.name)]
            if within is None or parameter.shape:
                numbers[parameter.name] = np.broadcast_to(values, (len(time_s), len(values)))
            else:
                numbers[parameter.name] = np.where(within, values, 0.0)
        return numbers

    def touches(self, node: str) -> bool:
        """Whether any effect changes a node's signals."""
        return node in self._nodes

    def late_s(self, node: str, time_s: Vector) -> Vector:
        """How late a node's samples are, (samples,), s."""
        late = np.zeros(len(time_s))
        for effect in self._late:
            if node in effect.nodes and effect.late_s is not None:
                late += effect.late_s(node, time_s, self._numbers(effect, time_s))
        return late

    def sense(self, node: str, time_s: Vector, values: Vector) -> Vector:
        """What a node reports of true ``values``, shape (samples, signals), at ``time_s`` of the model."""
        for effect in self._active:
            if node in effect.nodes and effect.sense is not None:
                memory = self._memory.setdefault((effect.name, node), {})
                values = effect.sense(node, time_s, values, self._numbers(effect, time_s), memory)
        return values

    def undo(self, node: str, time_s: Vector, values: Vector) -> Vector:
        """Values of what a node reported with the effects taken back, on whole arrays.

        Effects that lose information (filters, steps, drop-outs) have no inverse and leave the values as they are.
        """
        for effect in reversed(self._active):
            if node in effect.nodes and effect.undo is not None:
                values = effect.undo(node, time_s, values, self._numbers(effect, time_s), {})
        return values
