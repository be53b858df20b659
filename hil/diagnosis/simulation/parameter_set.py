"""One simulated car: parameters of the vehicle, effects, latencies, onsets; how nuisance parameters move it.

Takes the nominal vehicle and standard deviations of its nuisances; gives what the simulator runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation import excitation
from hil.diagnosis.simulation.excitation import Excitation
from hil.diagnosis.simulation.sensors import SENSORS
from hil.diagnosis.vehicle.keys import LATENCY_S
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, Nuisance, factor_of
from hil.diagnosis.vehicle.spec import Vehicle
from plant.effects.bank import NO_TERMS
from plant.effects.effect import NODES
from plant.effects.theta import THETA

_SIGN_ALONG_ROAD = (("road_grade", "grade"), ("headwind", "wind_mps"))
LATENCY_NODES = ("imu", "pressure", "motor", "demand", "steering", "yaw_rate")
"""Nodes whose frames may come later than the wheel speeds'; demands, and the steering wheel, may act later than they
are logged; a yaw rate, which is filtered by itself, comes that much later than the accelerations."""
GYRO_S = 6e-3
"""Half-width of how much later a yaw rate comes, in s: as a filter of 25 Hz delays."""
ZEROS = {"ay_mps2": 0.01, "yaw_rate_rad_s": 5e-4}
"""Standard deviations of what an inertial unit tells at rest, across: a tenth of a degree of roll, and 0.03 deg/s."""
DISC_MEASURED_SD_K, DISC_ASSUMED_SD_K = 5.0, 15.0
"""Standard deviations of the discs' temperature at the start: as a thermocouple tells it, and as we guess."""


@dataclass(frozen=True)
class Onset:
    """Time from which an effect acts: ``recording`` by its number, and s in it.

    ``before`` are its strengths until then: what single wheels are off was there before a cause of the same kind.
    """

    effect: str
    recording: int
    since_s: float
    before: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """One simulated car.

    Attributes
    ----------
    p : (PARAMETER.size,) parameters of the vehicle.  theta : (THETA.size,) parameters of the effects.
    nonparametric_rows : (rows, columns) of nonparametric terms, as in `plant.effects.bank`.
    disc_offset_k : of the discs at the start of a log.  latency_s : of each of `LATENCY_NODES`.
    tooth_share : multiplies the lag of a toothed wheel, half the time between two teeth: it measures when a tooth has
        passed.  window_rows2 : square of the time over which that speed is a mean, in rows.
    onsets : of effects that act from a time on.
    """

    p: Floats
    theta: Floats
    nonparametric_rows: Floats = field(default_factory=NO_TERMS.copy)
    disc_offset_k: float = 0.0
    latency_s: tuple[float, ...] = (0.0,) * len(LATENCY_NODES)
    tooth_share: float = 1.0
    window_rows2: float = 0.0
    onsets: tuple[Onset, ...] = ()

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
        return [(row, _along(one, recording.log.direction)) for row, one in thetas]

    def with_onset(self, effect: str, number: int, since_s: float, before: "ParameterSet") -> "ParameterSet":
        """With an effect that acts from a time on in recording ``number``; until then, with strengths of ``before``."""
        strengths = tuple(before.theta[_strengths(effect)].tolist())
        return replace(self, onsets=(*self.onsets, Onset(effect, number, since_s, strengths)))

    def with_nuisances(self, nuisances: Sequence[Nuisance], z: Floats) -> "ParameterSet":
        """With nuisances ``z`` prior standard deviations off, (nuisances,)."""
        p, disc, late, tooth = self.p.copy(), self.disc_offset_k, list(self.latency_s), self.tooth_share
        theta, window = self.theta.copy(), self.window_rows2
        for nuisance, amount in zip(nuisances, z, strict=True):
            for at, step in zip(nuisance.at, nuisance.step, strict=True):
                if nuisance.kind == "disc":
                    disc += amount * step
                elif nuisance.kind in ("late", "held"):
                    late[at] += amount * step
                elif nuisance.kind == "tooth":
                    tooth += amount * step
                elif nuisance.kind == "window":
                    window += amount * step
                elif nuisance.kind in ("sensor", "scatter", "line"):
                    theta[at] += amount * step
                elif nuisance.kind == "signed":
                    p[at] += amount * step
                else:
                    p[at] = _positive(p[at], amount, step)
        return replace(
            self, p=p, theta=theta, disc_offset_k=disc, latency_s=tuple(late), tooth_share=tooth, window_rows2=window
        )


def recording_nuisances(disc_told: bool, latency_s: float) -> list[Nuisance]:
    """What the logs, not the vehicle, leave open: temperature of the discs, latency of the nodes, zeros.

    ``disc_told``: all logs tell the discs' temperature at the start. ``latency_s``: half-width of the latency of a node
    that measures.
    """
    found = []
    for k, node in enumerate(LATENCY_NODES):
        half = latency_s if node in NODES else GYRO_S if node == "yaw_rate" else LATENCY_S
        found.append(
            Nuisance(f"late_{node}", (k,), (HALF_WIDTH_TO_SIGMA * half,), "held" if node == "demand" else "late")
        )
    found += [
        Nuisance(f"zero_{name}", (THETA.slice("imu_bias", name).start,), (step,), "sensor")
        for name, step in ZEROS.items()
    ]
    return [
        Nuisance("disc_temperature_k", (0,), (DISC_MEASURED_SD_K if disc_told else DISC_ASSUMED_SD_K,), "disc"),
        Nuisance("tooth_lag", (0,), (0.5,), "tooth"),
        Nuisance("tooth_window", (0,), (1.0,), "window"), *found,
    ]  # fmt: skip


def _positive(now: float, z: float, step: float) -> float:
    """A positive parameter ``z`` standard deviations off: it never goes through zero."""
    factor = factor_of(now, step)
    return float(now * factor ** (z * np.sign(step))) if factor > 1.0 else now + z * step


def nominal(vehicle: Vehicle) -> ParameterSet:
    """Parameter set of the nominal vehicle."""
    return ParameterSet(vehicle.p, THETA.neutral())


def _strengths(effect: str) -> list[int]:
    """Indices in theta of the strengths of an effect."""
    slices = (THETA.slice(effect, parameter.name) for parameter in THETA.effect(effect).strengths)
    return [at for own in slices for at in range(own.start, own.stop)]


def _along(theta: Floats, direction: int) -> Floats:
    """Theta when driving along the road (+1) or back (-1)."""
    if direction > 0:
        return theta
    turned = theta.copy()
    for effect, parameter in _SIGN_ALONG_ROAD:
        turned[THETA.slice(effect, parameter)] *= -1.0
    return turned


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
