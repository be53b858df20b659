"""Road under the car: friction scale left and right, and grade, over the position."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant.compiled import equation


@dataclass(frozen=True, slots=True)
class RoadSegment:
    """Road from ``start_m`` (position along x) up to the start of the next segment.

    ``friction_left`` acts on wheels at y > 0, ``friction_right`` on the others; 1 is the tyre's own dry friction.
    ``grade`` is rise over run, positive uphill.
    """

    start_m: float
    friction_left: float = 1.0
    friction_right: float = 1.0
    grade: float = 0.0


DRY = (RoadSegment(-1e9),)


def road_table(segments: tuple[RoadSegment, ...]) -> NDArray[np.float64]:
    """Segments in order as rows (start, friction left, friction right, grade); the first reaches back without end."""
    rows = [(s.start_m, s.friction_left, s.friction_right, s.grade) for s in sorted(segments, key=lambda s: s.start_m)]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


@equation
def segment_at(road: NDArray[np.float64], x_m: float) -> int:
    """Row of the segment at a position along the road."""
    row = 0
    for i in range(1, road.shape[0]):
        if x_m >= road[i, 0]:
            row = i
    return row
