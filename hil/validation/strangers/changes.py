"""Numbers of a car or of its logger, changed: what is hidden, and what nobody knows exactly."""

from collections.abc import Callable
from typing import Any

Pair = tuple[Any, Any]
"""A car's numbers and its logger, both named tuples."""
Change = Callable[[Pair, float], Pair]


def plus(name: str, at: tuple[int, ...] = ()) -> Change:
    """Add to a number; of an array at these places, or at all."""
    return _change(name, at, lambda old, by: old + by)


def times(name: str, at: tuple[int, ...] = ()) -> Change:
    """Make a number larger by a share; of an array at these places, or at all."""
    return _change(name, at, lambda old, share: old * (1.0 + share))


def _change(name: str, at: tuple[int, ...], rule: Callable[[Any, float], Any]) -> Change:
    def change(pair: Pair, size: float) -> Pair:
        owner = 0 if name in pair[0]._fields else 1
        old = getattr(pair[owner], name)
        new = rule(old, size)
        if at:
            every, new = new, old.copy()
            new[list(at)] = every[list(at)]
        changed = pair[owner]._replace(**{name: new})
        return (changed, pair[1]) if owner == 0 else (pair[0], changed)

    return change
