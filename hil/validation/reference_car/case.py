"""Cases: what is hidden where, how large, under how much noise; the logs they give, and the sealed answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import log

import numpy as np
from numpy.typing import NDArray

from hil.errors import BrakebenchError
from hil.validation.reference_car.car import NOMINAL, TOLERANCE, Car, true_car
from hil.validation.reference_car.catalogue import find
from hil.validation.reference_car.drive import drive
from hil.validation.reference_car.manoeuvres import SETS, TICK_S, Manoeuvre, manoeuvre_set
from hil.validation.reference_car.noise import LEVELS, USUALLY_LATE_S, Noise, draw_noise, gusts
from hil.validation.reference_car.sensors import NODES, SensorFault, observe
from hil.validation.reference_car.snr import difference, signal_to_noise, whitened
from hil.validation.reference_car.strengths import ROWS, E

Vector = NDArray[np.float64]
Table = Mapping[str, Vector]
NUMBERS = {
    "mass_offset": ("mass_kg", False), "rotating_inertia": ("wheel_inertia_kg_m2", False),
    "cog_height": ("cog_height_m", False), "threshold": ("threshold_pressure_pa", False),
    "ehb_dead_time": ("ehb_dead_time_s", False), "motor_tau": ("motor_time_constant_s", False),
    "rolling_resistance": ("rolling_resistance", True),
    "slip_stiffness": ("slip_stiffness", True), "tyre_relaxation": ("relaxation_length_m", True),
    "mu_road": ("tyre_friction", True), "ehb_bandwidth": ("ehb_frequency_hz", True),
    "battery_soc": ("battery_charge_power_w", True),
}  # fmt: skip
"""Effects that a number of the car is, where they act on all of it: added to it, or a share of the nominal one."""
SWINGING = ("wheel_inertia_kg_m2", "slip_stiffness", "relaxation_length_m", "ehb_dead_time_s", "motor_time_constant_s")
"""Numbers whose signature is of wheels that swing on their tyres: another car's is soon out of phase with it."""
CALIBRATION_ROUNDS, CALIBRATED, REACHED = 8, 0.03, 0.15


@dataclass(frozen=True)
class Hidden:
    """One hidden thing: where, how large, since when (s in the session, logs in order; None: always)."""

    effect: str
    wheel: str
    magnitude: float
    onset_s: float | None = None


@dataclass(frozen=True)
class Case:
    """Everything a set of logs follows from.

    Attributes
    ----------
    family, index, seed : how it was drawn.  manoeuvres, variant : what is driven.
    snr : expected, beside what tolerances can imitate; ``snr_alone`` without that. None: not computed.
    target_snr : what the magnitude was scaled for; ``reached`` False where a physical bound came first.
    """

    family: str
    index: int
    seed: int
    manoeuvres: str
    variant: int
    noise_level: str
    hidden: tuple[Hidden, ...] = ()
    snr: float | None = None
    snr_alone: float | None = None
    target_snr: float | None = None
    reached: bool = True

    @property
    def car(self) -> Car:
        """The true car."""
        return true_car(np.random.default_rng([self.seed, 1]))

    @property
    def noise(self) -> Noise:
        """The true noise."""
        return draw_noise(self.noise_level, np.random.default_rng([self.seed, 2]))

    @property
    def drives(self) -> tuple[Manoeuvre, ...]:
        """What is driven."""
        return manoeuvre_set(self.manoeuvres, self.variant)

    def starts_s(self) -> list[float]:
        """Start of each log in the session, s."""
        lengths = [drive.ticks * TICK_S for drive in self.drives]
        return [float(sum(lengths[:k])) for k in range(len(lengths))]


def make_case(
    hidden: Sequence[Hidden], seed: int, noise_level: str = "medium", manoeuvres: str = "full", variant: int = 0,
    family: str = "own", index: int = 0,
) -> Case:  # fmt: skip
    """A case after all checks.

    Raises
    ------
    BrakebenchError
        An effect, wheel, noise level or manoeuvre set that does not exist, a magnitude beyond its bounds, two laws.
    """
    if noise_level not in LEVELS:
        raise BrakebenchError(f"--noise {noise_level}: expected one of {', '.join(LEVELS)}")
    if manoeuvres not in SETS:
        raise BrakebenchError(f"--manoeuvres {manoeuvres}: expected one of {', '.join(SETS)}")
    for one in hidden:
        kind = find(one.effect)
        if one.wheel not in kind.where:
            raise BrakebenchError(f"--wheel {one.wheel}: {one.effect} acts on {', '.join(kind.where)}")
        if not kind.low <= one.magnitude <= kind.high:
            raise BrakebenchError(
                f"--magnitude {one.magnitude:g}: {one.effect}.{kind.parameter} lies between {kind.low:g} and "
                f"{kind.high:g} {kind.unit}"
            )
    if sum(find(one.effect).law > 0 for one in hidden) > 1:
        raise BrakebenchError("two laws in no list cannot be hidden at once; hide one, beside listed effects")
    return Case(family, index, seed, manoeuvres, variant, noise_level, tuple(hidden))


def logs(case: Case, clean: bool = False) -> list[dict[str, Vector]]:
    """Tables of all logs, in order of `Case.drives`; ``clean`` leaves out sensor noise and quantisation."""
    return _observed(case.drives, case.car, case.noise, case.hidden, case.seed, clean)


def _observed(
    drives: Sequence[Manoeuvre], car: Car, noise: Noise, hidden: Sequence[Hidden], seed: int, clean: bool
) -> list[dict[str, Vector]]:
    begin, tables = 0.0, []
    for k, manoeuvre in enumerate(drives):
        strength, onset, law, faults = np.zeros((ROWS, 4)), np.zeros(ROWS), 0, {}
        for one in hidden:
            kind = find(one.effect)
            row = kind.strength(one.magnitude, one.wheel)
            since = 0.0 if one.onset_s is None else max(one.onset_s - begin, 0.0)
            if kind.senses:
                faults[one.effect] = SensorFault(row, since)
                continue
            at = E.unlisted if kind.law else getattr(E, one.effect)
            strength[at] += row
            onset[at] = since
            law = kind.law or law
        gust = gusts(manoeuvre.ticks, noise, np.random.default_rng([seed, 3, k]))
        driven = drive(manoeuvre, car, strength, onset, law, gust)
        tables.append(observe(driven, noise, faults, (seed, 4, k), clean))
        begin += manoeuvre.ticks * TICK_S
    return tables


def expected_snr(case: Case) -> tuple[float, float]:
    """SNR of what is hidden: beside imitations by tolerances, and alone. Both runs of the pair have the same gusts."""
    base = logs(replace(case, hidden=()), clean=True)
    return _snr(case, base, unknowns(case))


def _snr(case: Case, base: Sequence[Table], imitations: Vector) -> tuple[float, float]:
    apart = difference(logs(case, clean=True), base)
    beside, alone = signal_to_noise(whitened(apart, base, case.noise), imitations)
    return min(beside, as_number(case)), alone


def as_number(case: Case) -> float:
    """How many standard deviations a number of the car would have to be off to be what is hidden; inf: none can.

    No signal stands out more, however it looks: off by so much, the number imitates it exactly, at that cost in its
    tolerance. Signatures of one standard deviation do not tell: wheels that swing on their tyres are soon out of phase.
    """
    if len(case.hidden) != 1 or case.hidden[0].onset_s is not None:
        return float("inf")
    (one,) = case.hidden
    if one.effect == "timestamp_offset":
        return float(abs(one.magnitude) / USUALLY_LATE_S)
    name, of_nominal = NUMBERS.get(one.effect, ("", False))
    if not name or one.wheel != "car":
        return float("inf")
    off = one.magnitude * (getattr(NOMINAL, name) if of_nominal else 1.0)
    return float(abs(off) / (0.5 * TOLERANCE[name]))


def unknowns(case: Case) -> Vector:
    """Whitened signatures of all that nobody knows better, one standard deviation each, (samples, unknowns).

    Parameters with a tolerance, and how late the nodes send.
    """
    own = logs(replace(case, hidden=()), clean=True)
    columns = []
    for name, signature in _signatures(case.manoeuvres, case.variant).items():
        if name in SWINGING:
            fitted = difference(_observed(case.drives, _off(case.car, name), case.noise, (), case.seed, True), own)
        else:
            fitted = [_fitted(one, len(mine["t_s"])) for one, mine in zip(signature, own, strict=True)]
        columns.append(whitened(fitted, own, case.noise))
    return np.stack(columns, axis=1)


def _off(car: Car, name: str) -> Car:
    """A car with one number off by half its tolerance."""
    return car._replace(**{name: getattr(car, name) + 0.5 * TOLERANCE[name]})


def _fitted(table: Table, rows: int) -> dict[str, Vector]:
    """A signature over as many rows as another log has; nothing beyond its own end."""
    return {name: np.concatenate([v[:rows], np.full(max(rows - len(v), 0), np.nan)]) for name, v in table.items()}


@lru_cache(maxsize=4)
def _signatures(manoeuvres: str, variant: int) -> dict[str, list[dict[str, Vector]]]:
    """What half a tolerance of each parameter, and a node's usual latency, change in the nominal car's clean logs."""
    noise = replace(
        draw_noise("medium", np.random.default_rng(0)), gust_mps2=0.0, latency_s=(0.0, 0.0, 0.0, 0.0), queue_s=0.0
    )
    drives = manoeuvre_set(manoeuvres, variant)
    base = _observed(drives, NOMINAL, noise, (), 0, True)
    found = {}
    for name in TOLERANCE:
        found[name] = difference(_observed(drives, _off(NOMINAL, name), noise, (), 0, True), base)
    for node, late_s in zip(NODES[1:], USUALLY_LATE_S * np.eye(len(NODES))[1:], strict=True):
        late = replace(noise, latency_s=tuple(late_s.tolist()))
        found[f"late_{node}"] = difference(_observed(drives, NOMINAL, late, (), 0, True), base)
    return found


def measured_case(case: Case) -> Case:
    """The case with its expected SNR filled in."""
    beside, alone = expected_snr(case)
    return replace(case, snr=beside, snr_alone=alone)


def scaled_case(case: Case, target: float) -> Case:
    """The case with the magnitudes of all it hides scaled by one factor, so that the expected SNR is ``target``.

    What has no signature in time keeps its magnitude. A bound that comes first ends the search: ``reached`` is False.
    """
    if not case.hidden or not all(find(one.effect).scales for one in case.hidden):
        return replace(case, target_snr=target, reached=not case.hidden)
    base = logs(replace(case, hidden=()), clean=True)
    imitations = unknowns(case)
    low, high, factor = 0.0, _largest_factor(case), min(1.0, _largest_factor(case))
    best = case
    for _ in range(CALIBRATION_ROUNDS):
        trial = _times(case, factor)
        beside, alone = _snr(trial, base, imitations)
        trial = replace(trial, snr=beside, snr_alone=alone, target_snr=target)
        error = _from_target(beside, target)
        if best.snr is None or error < _from_target(best.snr, target):
            best = trial
        if error < CALIBRATED or (factor >= high and beside < target):
            break
        low, high = (factor, high) if beside < target else (low, factor)
        wanted = factor * target / max(beside, 1e-9)
        factor = wanted if low < wanted < high else (high if wanted >= high and low == factor else 0.5 * (low + high))
    return replace(best, reached=best.snr is not None and _from_target(best.snr, target) < REACHED)


def _from_target(snr: float, target: float) -> float:
    return abs(log(max(snr, 1e-9) / target))


def _largest_factor(case: Case) -> float:
    factors = []
    for one in case.hidden:
        kind = find(one.effect)
        bound = kind.high if one.magnitude > 0.0 else kind.low
        factors.append(bound / one.magnitude)
    return min(factors)


def _times(case: Case, factor: float) -> Case:
    return replace(case, hidden=tuple(replace(one, magnitude=one.magnitude * factor) for one in case.hidden))
