"""The built-in sensing effects, in the order of the catalogue."""

from plant.effects.effect import Effect

SENSING: tuple[Effect, ...] = ()
