"""What a stranger's car offers the trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Table = Mapping[str, Vector]
Vehicle = Mapping[str, float | list[float]]
"""A vehicle set as its owner writes it: keys of docs/vehicle-set.md."""
DAY_SHARE = 0.5
"""Share of what wheels and sensors differ by from one to the other that one differs by from day to day: a choice, near
the 0.05 % of a tyre's radius that 1 to 2 kPa make."""


@dataclass(frozen=True)
class Hidden:
    """What a drive hides; ``size`` is in the unit of the cause."""

    cause: str
    size: float


@dataclass(frozen=True)
class Cause:
    """Something that can be hidden.

    Attributes
    ----------
    smallest, largest : range of the size, same sign, smallest nearest to zero; the size for a wanted signal-to-noise
        ratio is sought in it. The ratio grows with the size.
    accepted : right answers, effects of docs/effects.md: ``effect@location`` (fl, fr, rl, rr, front, rear, left, right,
        wheel, imu, pressure, motor, driver, car), or ``effect`` wherever it is.
    """

    name: str
    unit: str
    smallest: float
    largest: float
    accepted: frozenset[str]

    def accepts(self, effect: str, location: str) -> bool:
        """Whether a named effect is a right answer."""
        return effect in self.accepted or f"{effect}@{location}" in self.accepted


@dataclass(frozen=True)
class Noise:
    """The noise of a drive as the car makes it: what whitens a difference of two noise-free drives.

    Attributes
    ----------
    white : standard deviation of each channel's white noise, quantisation step / sqrt(12) included; by column.
    coloured : standard deviation and time constant (s) of a channel's own first-order noise, by column.
    gust_mps2, slope_mps2 : standard deviation (m/s2) and time constant (s) of the slow disturbance along the road: what
        the accelerometer feels (wind) and what it does not (grade times g). 0 where there is none.
    """

    white: Mapping[str, float]
    coloured: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    gust_mps2: tuple[float, float] = (0.0, 1.0)
    slope_mps2: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class Tolerated:
    """A number of the car that nobody knows exactly: the drive with it off by ``deviation`` from its true value.

    One standard deviation: half the tolerance that the owner states; what is not stated, as usually known.
    """

    name: str
    deviation: float


class StrangerCar(Protocol):
    """A car with its drives; every result follows from the seeds alone."""

    @property
    def name(self) -> str:
        """Short name, of letters and underscores."""

    @property
    def causes(self) -> Mapping[str, Cause]:
        """What can be hidden, by name."""

    def stated(self, rng: np.random.Generator) -> dict[str, float | list[float]]:
        """The set that the owner writes: off from the truth within the tolerances it states."""

    def drive(
        self, seed: int, hidden: Hidden | None = None, noisy: bool = True, off: Tolerated | None = None,
        day: int | None = None,
    ) -> Sequence[dict[str, Vector]]:  # fmt: skip
        """Logs of a drive, columns of docs/explain-inputs.md, each with ``t_s``; NaN is no sample.

        ``day`` is the seed of another day with the car of ``seed``: manoeuvres, road, noise and ages of frames are that
        day's; zeros and scales of sensors, and single wheels, are off by half of what cars differ by in them.
        ``noisy`` False leaves out noise and quantisation of the sensors, not the gusts and the road, which are drawn
        from the seed: two such drives differ by what is hidden or ``off`` alone, row by row until either stands.
        """

    def noise(self, seed: int) -> Noise:
        """Noise of that drive."""

    def tolerated(self, stated: Vehicle) -> Sequence[Tolerated]:
        """Numbers whose signature counts as explained away beside that set, one standard deviation each."""
