"""One simulated car: parameters of the vehicle, effects, latencies, onsets; how nuisance parameters move it.

Takes the nominal vehicle and standard deviations of its nuisances; gives what the simulator runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation import excitation
from hil.diagnosis.simulation.sensors import SENSORS
from hil.diagnosis.vehicle.extension_file import Extension
from hil.diagnosis.vehicle.latency import LATENCY_NODES
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind, factor_of
from hil.diagnosis.vehicle.spec import Vehicle
from plant.excitation import Excitation
from plant.injection.bank import NO_TERMS
from plant.injection.theta import THETA
from plant.vectors import PARAMETER


@dataclass(frozen=True)
class Onset:
    """Time from which an effect acts: ``recording`` by its number, and s in it.

    ``before`` are its strengths until then, and ``change`` what is otherwise of these since the reference, nothing
    where it is empty: what single wheels are off was there before a cause of the same kind.
    """

    effect: str
    recording: int
    since_s: float
    before: tuple[float, ...]
    change: tuple[float, ...] = ()

    def changed(self) -> "Onset":
        """As it is since the change."""
        if not self.change:
            return self
        theta, change = np.zeros((2, THETA.size))
        own = _strengths(self.effect)
        theta[own], change[own] = self.before, self.change
        return replace(self, before=tuple(THETA.changed(theta, change)[own].tolist()), change=())

    def moved(self, by: Floats, change_by: Floats | None) -> "Onset":
        """With nuisance parameters that move theta and, where there is one, its change, (THETA.size,)."""
        own = _strengths(self.effect)
        before = tuple(np.add(self.before, by[own]).tolist())
        if change_by is None:
            return replace(self, before=before)
        change = np.add(self.change or 0.0, change_by[own])
        return replace(self, before=before, change=tuple(change.tolist()))


@dataclass(frozen=True, eq=False)
class Change:
    """What is otherwise in all recordings from number ``since`` on: theta (THETA.size,) as `Theta.changed` takes it,
    rows of nonparametric terms and the temperature of the discs at the start, both added."""

    since: int
    theta: Floats = field(default_factory=lambda: np.zeros(THETA.size))
    nonparametric_rows: Floats = field(default_factory=NO_TERMS.copy)
    disc_offset_k: float = 0.0


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """One simulated car.

    Attributes
    ----------
    p : (PARAMETER.size,) parameters of the vehicle.  theta : (THETA.size,) parameters of the effects.
    nonparametric_rows : (rows, columns) of nonparametric terms, as in `plant.injection.bank`.
    disc_offset_k : of the discs at the start of a log.  latency_s : of each of `LATENCY_NODES`.
    tooth_share : multiplies the lag of a toothed wheel, half the time between two teeth: it measures when a tooth has
        passed.  window_rows2 : square of the time over which that speed is a mean, in rows.
    onsets : of effects that act from a time on.
    change : since reference logs; None where there are none.
    """

    p: Floats
    theta: Floats
    nonparametric_rows: Floats = field(default_factory=NO_TERMS.copy)
    disc_offset_k: float = 0.0
    latency_s: tuple[float, ...] = (0.0,) * len(LATENCY_NODES)
    tooth_share: float = 1.0
    window_rows2: float = 0.0
    onsets: tuple[Onset, ...] = ()
    change: Change | None = None

    def adding(self, at: Sequence[int], value: float) -> "ParameterSet":
        """With ``value`` added to these entries of theta: since the reference, where there is one."""
        theta: Floats = (self.theta if self.change is None else self.change.theta).copy()
        for index in at:
            theta[index] += value
        if self.change is None:
            return replace(self, theta=theta)
        return replace(self, change=replace(self.change, theta=theta))

    def with_rows(self, rows: Floats) -> "ParameterSet":
        """With further nonparametric terms, (rows, columns): since the reference, where there is one."""
        if self.change is None:
            return replace(self, nonparametric_rows=np.vstack([self.nonparametric_rows, rows]))
        added = np.vstack([self.change.nonparametric_rows, rows])
        return replace(self, change=replace(self.change, nonparametric_rows=added))

    def in_recording(self, number: int) -> "ParameterSet":
        """As it is in one recording, before or since the change."""
        if self.change is None:
            return self
        if number >= self.change.since:
            return self.changed()
        theta = self.theta
        for one in (one for one in self.onsets if one.recording >= self.change.since):
            theta = theta.copy()
            theta[_strengths(one.effect)] = one.before
        kept = tuple(replace(one, change=()) for one in self.onsets if one.recording < self.change.since)
        return replace(self, theta=theta, change=None, onsets=kept)

    def changed(self) -> "ParameterSet":
        """As it is since the change."""
        if self.change is None:
            return self
        rows = self.nonparametric_rows
        if len(self.change.nonparametric_rows):
            rows = np.vstack([rows, self.change.nonparametric_rows])
        theta = THETA.changed(self.theta, self.change.theta)
        disc_offset_k = self.disc_offset_k + self.change.disc_offset_k
        onsets = tuple(one.changed() for one in self.onsets)
        return replace(
            self, theta=theta, nonparametric_rows=rows, disc_offset_k=disc_offset_k, onsets=onsets, change=None
        )

    def theta_in(self, recording: Recording) -> Floats:
        """Theta of one recording at its end: direction along the road, onsets in it or later."""
        return self.thetas_in(recording)[-1][1]

    def thetas_in(self, recording: Recording) -> list[tuple[int, Floats]]:
        """Thetas of one recording with their first rows, the first from 0: an onset within it cuts it in two."""
        theta = self.theta.copy() if self.onsets else self.theta
        within = sorted((one for one in self.onsets if one.recording == recording.number), key=lambda one: one.since_s)
        for onset in self.onsets:
            if recording.number < onset.recording:
                theta[_strengths(onset.effect)] = onset.before
        for onset in within:
            theta[THETA.slice(onset.effect, "onset_s")] = onset.since_s
        thetas = [(0, theta)]
        for onset in reversed(within):
            earlier, own = thetas[0][1].copy(), THETA.slice(onset.effect, "onset_s")
            earlier[_strengths(onset.effect)], earlier[own] = onset.before, THETA.neutral()[own]
            thetas = [(0, earlier), (int(onset.since_s / ROW_S), thetas[0][1]), *thetas[1:]]
        return [(row, one if recording.log.direction > 0 else THETA.driven_back(one)) for row, one in thetas]

    def with_onset(self, effect: str, number: int, since_s: float, before: "ParameterSet") -> "ParameterSet":
        """With an effect that acts from a time on in recording ``number``; until then, with strengths of ``before``."""
        own = _strengths(effect)
        change = () if before.change is None else tuple(before.change.theta[own].tolist())
        return replace(
            self, onsets=(*self.onsets, Onset(effect, number, since_s, tuple(before.theta[own].tolist()), change))
        )

    def with_nuisances(self, nuisances: Sequence[Nuisance], z: Floats) -> "ParameterSet":
        """With nuisances ``z`` prior standard deviations off, (nuisances,)."""
        p, disc, late, tooth = self.p.copy(), self.disc_offset_k, list(self.latency_s), self.tooth_share
        theta, window = self.theta.copy(), self.window_rows2
        rows = self.nonparametric_rows
        if any(nuisance.kind is NuisanceKind.LEARNED_CURVE for nuisance in nuisances):
            rows = rows.copy()
        change = np.zeros(THETA.size) if self.change is None else self.change.theta.copy()
        disc_change = 0.0 if self.change is None else self.change.disc_offset_k
        for nuisance, amount in zip(nuisances, z, strict=True):
            for at, step in zip(nuisance.at, nuisance.step, strict=True):
                match nuisance.kind:
                    case NuisanceKind.VEHICLE:
                        p[at] = _positive(p[at], amount, step)
                    case NuisanceKind.SIGNED:
                        p[at] += amount * step
                    case NuisanceKind.SENSOR | NuisanceKind.SIDE_TO_SIDE | NuisanceKind.LINE_LAG | NuisanceKind.LEARNED:
                        theta[at] += amount * step
                    case NuisanceKind.LEARNED_CURVE:
                        rows.flat[at] += amount * step
                    case NuisanceKind.OF_THE_DAY:
                        change[at] += amount * step
                    case NuisanceKind.DISC_TEMPERATURE_OF_THE_DAY:
                        disc_change += amount * step
                    case NuisanceKind.LATENCY:
                        late[at] += amount * step
                    case NuisanceKind.DISC_TEMPERATURE:
                        disc += amount * step
                    case NuisanceKind.TOOTH_LAG:
                        tooth += amount * step
                    case NuisanceKind.TOOTH_WINDOW:
                        window += amount * step
        change_by = None if self.change is None else change - self.change.theta
        onsets = tuple(one.moved(theta - self.theta, change_by) for one in self.onsets)  # single wheels, also before it
        since = None
        if self.change is not None:
            since = replace(self.change, theta=change, disc_offset_k=disc_change)
        return replace(
            self, p=p, theta=theta, disc_offset_k=disc, latency_s=tuple(late), tooth_share=tooth, window_rows2=window,
            onsets=onsets, change=since, nonparametric_rows=rows,
        )  # fmt: skip

    def with_extension(self, extension: Extension, logs: Sequence[str] = ()) -> "ParameterSet":
        """With the effects, parameters and nonparametric terms of an extension file.

        An effect that begins in one of the ``logs``, names by number, begins there; one that begins in another log acts
        throughout.
        """
        p, theta = self.p.copy(), self.theta.copy()
        for name, values in extension.parameters.items():
            p[PARAMETER.slice(name)] = values
        changed = extension.theta != THETA.neutral()
        theta[changed] = extension.theta[changed]
        rows = np.vstack([self.nonparametric_rows, extension.nonparametric_rows])
        extended = replace(self, p=p, theta=theta, nonparametric_rows=rows)
        for effect, (log, since_s) in extension.onsets.items():
            if log in logs:
                extended = extended.with_onset(effect, logs.index(log), since_s, before=self)
        return extended

    def extension_of(self, vehicle: "ParameterSet") -> Extension:
        """Effects and nonparametric terms, and the parameters that differ from those of a nominal vehicle."""
        slices = {name: PARAMETER.slice(name) for name in PARAMETER.sizes}
        changed = {n: self.p[own].tolist() for n, own in slices.items() if (self.p[own] != vehicle.p[own]).any()}
        return Extension(self.theta, changed, self.nonparametric_rows)


def _positive(now: float, z: float, step: float) -> float:
    """A positive parameter ``z`` standard deviations off: it never goes through zero."""
    factor = factor_of(now, step)
    return float(now * factor ** (z * np.sign(step))) if factor > 1.0 else now + z * step


def nominal(vehicle: Vehicle) -> ParameterSet:
    """Parameter set of the nominal vehicle."""
    return ParameterSet(vehicle.p, THETA.neutral(), latency_s=tuple(one.value_s for one in vehicle.latencies))


def _strengths(effect: str) -> list[int]:
    """Indices in theta of the strengths of an effect."""
    slices = (THETA.slice(effect, parameter.name) for parameter in THETA.effect(effect).strengths)
    return [at for own in slices for at in range(own.start, own.stop)]


def excitation_that_separates(one: ParameterSet, other: ParameterSet, recording: Recording) -> Excitation:
    """Excitation a segment of the recording needs for two parameter sets to move differently in it."""
    thetas = one.theta, other.theta
    if one.onsets or other.onsets:
        thetas = one.theta_in(recording), other.theta_in(recording)
    needed = excitation.of_effects(*thetas) | excitation.of_terms(one.nonparametric_rows, other.nonparametric_rows)
    if one.p is not other.p:
        needed |= excitation.of_parameters(one.p, other.p)
    if one.disc_offset_k != other.disc_offset_k:
        needed |= Excitation.BRAKES
    for late, also, of in zip(one.latency_s, other.latency_s, excitation.OF_LATENCY, strict=True):
        if late != also:
            needed |= of
    return needed


def same_sensors(one: ParameterSet, other: ParameterSet) -> bool:
    """True where sensors, clocks and frames are alike: the same motion gives the same channels."""
    same = one.latency_s == other.latency_s and one.onsets == other.onsets
    same = same and (one.tooth_share, one.window_rows2) == (other.tooth_share, other.window_rows2)
    return same and bool((one.theta[SENSORS] == other.theta[SENSORS]).all())
