"""Non-linear fits: bounded Gauss-Newton steps on nuisances and effects, each step a free replay."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.information import (
    InformationBlocks,
    finite_difference_jacobian,
    information_blocks,
    solve_bounded,
)
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.estimate import estimate, first_guess
from hil.diagnosis.noise.innovations import HUBER
from hil.diagnosis.noise.model import Noise, SampleMasks, tracks_of, whiten, whitened
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind

Tracks = dict[str, Floats]
_LARGEST_STEP = 8.0
_ATTEMPTS = ((False, 0.0, 1.0), (True, 0.0, 0.5), (True, 0.1, 1.0), (True, 1.0, 1.0), (True, 10.0, 1.0))
"""Ways to make a step, in turn until one improves: whether limits stay where they are, the damping, and the share
of the step that is made. Damping stops what two numbers do together that each undoes alone; half a step does not."""
_LIMITS = (
    "battery_charge_power_w", "motor_peak_torque_nm", "motor_rate_limit_nm_s", "motor_fade_start_mps",
    "motor_fade_end_mps", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s",
)  # fmt: skip
"""Numbers that matter on one side alone: a limit that is not met, moved a little too far, spoils any step."""
_DIVERGED = 1e15
_WORTH = 1.0
"""A step that takes less off the cost is the last."""
_FOLLOWED = 0.5
"""A step of less, in standard deviations, says too little of how sensitivities change."""
BIASED_BIRGE_RATIO = 1.5
"""Strain (`Fitter.strain`) beyond which the vehicle's numbers may be bent by what is no number."""
_ALIKE = 0.2
"""Share by which an effect may change and its sensitivity be what it was."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect in the model: candidate and its value; where it begins, as drive and s in it, None: always there."""

    candidate: Candidate
    value: float
    onset: tuple[int, float] | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """The car so far: nuisances ``z`` in standard deviations and effects; ``residual`` tracks are at exactly this, and
    ``stack`` the simulated channels."""

    z: Floats
    terms: tuple[Term, ...]
    residual: Tracks
    cost: float
    covariance: Floats
    channels: Stack = field(default_factory=dict)

    def values(self) -> list[float]:
        """Values of the effects."""
        return [term.value for term in self.terms]


def same_terms(some: Sequence[Term], others: Sequence[Term]) -> bool:
    """Whether two lists are the same effects from the same times on, at values at which they act alike."""
    if [(one.candidate, one.onset) for one in some] != [(other.candidate, other.onset) for other in others]:
        return False
    before, after = (np.array([term.value for term in terms]) for terms in (some, others))
    return bool((np.abs(after - before) <= _ALIKE * np.maximum(np.abs(before), np.abs(after))).all())


def _far(taken: Model, now: Model) -> bool:
    """Whether effects act otherwise now than where their sensitivities were taken."""
    return not same_terms(taken.terms, now.terms) or bool(np.abs(now.z - taken.z).max(initial=0.0) > _FOLLOWED)


def with_term(world: ParameterSet, term: Term) -> ParameterSet:
    """The world with an effect at its value, from where it begins."""
    found = term.candidate.applied(world, term.value)
    return found if term.onset is None else found.with_onset(term.candidate.effect.name, *term.onset, before=world)


def birge_ratio(z: Floats, farthest: Floats | float = np.inf, told: float | None = None) -> float:
    """How much farther the vehicle's numbers went than their tolerance lets them, as a variance, at least 1.

    A model that needs that for these logs errs in what it says of causes too (Birge 1932, Phys. Rev. 40, 207). Where
    much is strained, a number that went as far as it may (``farthest``) counts as if it wanted to go as far again.
    ``told`` is how many numbers the data tell (`Fitter.told`), all of them without: one of which they say nothing
    stays where it is, and is no sign that the others are right.
    """
    squares = np.square(z)
    if squares.sum() >= BIASED_BIRGE_RATIO * len(z):
        squares = squares * np.where(np.abs(z) >= farthest, 4.0, 1.0)
    return max(1.0, float(squares.sum()) / max(len(z) if told is None else told, 1.0))


@dataclass(eq=False)
class _Whitened:
    """Sensitivities to the nuisances whitened for one noise, (samples, nuisances), and their products."""

    noise: Noise | None = None
    columns: Floats = field(default_factory=lambda: np.empty((0, 0), np.float32))
    products: Floats = field(default_factory=lambda: np.empty((0, 0)))


class Fitter:
    """Fits models of one case; ``nuisance_columns`` are sensitivities to the nuisances in standard deviations."""

    def __init__(
        self,
        rig: Simulator,
        frame: SampleMasks,
        base: ParameterSet,
        nuisances: Sequence[Nuisance],
        nuisance_columns: Tracks,
    ) -> None:
        self.simulator, self.masks, self.base = rig, frame, base
        self.nuisances, self.nuisance_jacobian = tuple(nuisances), nuisance_columns
        self.bound = np.array([nuisance.bound for nuisance in self.nuisances])
        self.upper = np.array([nuisance.upper for nuisance in self.nuisances])
        self.lower = np.array([nuisance.lower for nuisance in self.nuisances])
        self._of_form = np.array([nuisance.kind is not NuisanceKind.SIDE_TO_SIDE for nuisance in self.nuisances])
        self._limits = [k for k, nuisance in enumerate(self.nuisances) if nuisance.name in _LIMITS]
        self.radius = float(rig.vehicle.parameters.wheel.rolling_radius_m)
        self._measured = rig.measured()
        self._whitened = _Whitened()

    def copy(self) -> "Fitter":
        """One whose sensitivities may follow the steps of another fit."""
        columns = {name: values.copy() for name, values in self.nuisance_jacobian.items()}
        return Fitter(self.simulator, self.masks, self.base, self.nuisances, columns)

    def with_simulator(self, simulator: Simulator) -> "Fitter":
        """This fitter on another simulator of the same dataset; both share the sensitivities to the nuisances."""
        other = copy(self)
        other.simulator = simulator
        return other

    def at_baseline(self, model: Model) -> "Fitter":
        """This fitter with the model simulated as the baseline of all others."""
        return self.with_simulator(self.simulator.with_baseline(self.parameter_set(model.z, model.terms)))

    def denoised(self, model: Model) -> "Fitter":
        """This fitter with inputs denoised at the model, without a baseline."""
        return self.with_simulator(self.simulator.denoised(self.parameter_set(model.z, model.terms)))

    def parameter_set(self, z: Floats, terms: Sequence[Term]) -> ParameterSet:
        """The world of a model."""
        world = self.base.with_nuisances(self.nuisances, z)
        for term in terms:
            world = with_term(world, term)
        return world

    def at(self, z: Floats, terms: Sequence[Term], noise: Noise) -> Model:
        """The model with these numbers, simulated."""
        stack = self.simulator.run(self.parameter_set(z, terms))
        residual = self.tracks({group: self._measured[group] - values for group, values in stack.items()})
        return Model(z, tuple(terms), residual, self.cost(residual, z, noise), np.zeros((0, 0)), stack)

    def residual(self, z: Floats, terms: Sequence[Term]) -> Tracks:
        """Residual tracks of a model."""
        return tracks_of(self.simulator.residual(self.parameter_set(z, terms)), self.masks, self.radius)

    def tracks(self, stack: Stack) -> Tracks:
        """Tracks, (samples, 1), of channels."""
        return tracks_of(stack, self.masks, self.radius)

    def cost(self, residual: Tracks, z: Floats, noise: Noise) -> float:
        """Twice the negative log-likelihood, tolerances included."""
        if not all(np.isfinite(values).all() for values in residual.values()):
            return _DIVERGED
        return -2.0 * whiten(residual, self.masks, noise)[1] + float(z @ z)

    def start(self, enabled: bool = True) -> tuple[Model, Noise]:
        """The car as handed in, and a first guess of the noise."""
        z = np.zeros(len(self.nuisances))
        noise = first_guess(self.residual(z, ()), self.masks, enabled)
        return self.at(z, (), noise), noise

    def term_jacobian(self, model: Model) -> Tracks:
        """Sensitivities to the values of the effects, at the model."""
        world = self.parameter_set(model.z, model.terms)
        known = np.diag(model.covariance) if model.covariance.size else np.zeros(len(model.terms))
        steps = [_difference(term, float(sd)) for term, sd in zip(model.terms, np.sqrt(known), strict=True)]
        worlds = [term.candidate.applied(world, step) for term, step in zip(model.terms, steps, strict=True)]
        return finite_difference_jacobian(
            self.simulator, self.masks, model.channels or self.simulator.run(world), worlds, steps
        )

    def nuisance_jacobian_at(self, model: Model) -> Tracks:
        """Sensitivities to the nuisances, anew for those on which nothing depended before there was a cause.

        A fade by temperature makes the discs' heat matter, of which constant friction says nothing.
        """
        loud = [np.abs(values).max(axis=0) > 0.0 for values in self.nuisance_jacobian.values()]
        silent = np.flatnonzero(~np.any(loud, axis=0))
        if not len(silent) or not model.terms:
            return self.nuisance_jacobian
        worlds = [self.parameter_set(model.z + one, model.terms) for one in np.eye(len(model.z))[silent]]
        base = model.channels or self.simulator.run(self.parameter_set(model.z, model.terms))
        anew = finite_difference_jacobian(self.simulator, self.masks, base, worlds, [1.0] * len(silent))
        columns = {name: values.copy() for name, values in self.nuisance_jacobian.items()}
        for name, values in columns.items():
            values[:, silent] = anew[name]
        return columns

    def fit(
        self, model: Model, noise: Noise, steps: int = 2, relinearise: bool = True, own: Tracks | None = None,
        follow: bool = False,
    ) -> Model:  # fmt: skip
        """Improve nuisances and values; keeps the model where no step does.

        ``own`` are the sensitivities to the values at this model, if they are known; those to the nuisances ``follow``
        the steps made.
        """
        best = replace(model, cost=self.cost(model.residual, model.z, noise))
        taken = best
        for _ in range(steps):
            if best.terms and (own is None or (relinearise and _far(taken, best))):
                own, taken = self.term_jacobian(best), best
            moved = self._step(best, own or {}, noise)
            if moved is None:
                break
            gained = best.cost - moved.cost
            if follow:
                self._broyden_update(best, moved, own or {}, noise)
            best = moved
            if gained < _WORTH:
                break
        return best

    def refit_amplitudes(self, model: Model, noise: Noise, steps: int = 2) -> Model:
        """The model with the value of its last effect where that explains most, all else as it is."""
        for _ in range(steps):
            own = self.term_jacobian(model)
            joined = {name: np.hstack([values, own[name][:, -1:]]) for name, values in model.residual.items()}
            left, shown = whitened(joined, self.masks, noise).T
            *others, term = model.terms
            step = float(np.clip(left, -HUBER, HUBER) @ shown) / max(float(shown @ shown), 1e-30)
            parameter = term.candidate.parameter
            value = float(np.clip(term.value + step, parameter.low, parameter.high))
            moved = self.at(model.z, (*others, replace(term, value=value)), noise)
            if moved.cost >= model.cost - _WORTH:
                break
            model = moved
        return model

    def _step(self, model: Model, own: Tracks, noise: Noise) -> Model | None:
        total = self._total(model, own, noise)
        for hold, damping, share in _ATTEMPTS:
            z, terms, covariance, foretold = self.moved(model, total, hold, damping, share)
            if foretold < _WORTH:
                break
            moved = self.at(z, terms, noise)
            if moved.cost < model.cost:
                return replace(moved, covariance=covariance)
        return replace(model, covariance=covariance) if model.terms and not model.covariance.size else None

    def moved(
        self, model: Model, total: Floats, hold: bool = False, damping: float = 0.0, share: float = 1.0
    ) -> tuple[Floats, tuple[Term, ...], Floats, float]:
        """Nuisances and effects after a step, no farther than each may go, covariance of the effects, and what the step
        takes off the cost if the model is linear; limits stay where they are if told to ``hold``. ``share`` of the step
        is made.

        ``total`` are products of [residual, nuisances, columns of the effects].
        """
        count, values = len(self.nuisances), np.array(model.values())
        ends = [(term.candidate.parameter.low, term.candidate.parameter.high) for term in model.terms]
        least, most = np.array(ends).reshape(-1, 2).T
        low = np.concatenate((np.maximum(self.lower - model.z, -_LARGEST_STEP), least - values))
        high = np.concatenate((np.minimum(self.upper - model.z, _LARGEST_STEP), most - values))
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        if hold:
            low[self._limits] = high[self._limits] = 0.0
        free = range(len(values))
        change, covariance, foretold = solve_bounded(total, count, free, model.z, low, high, damping)
        change, foretold = share * change, share * (2.0 - share) * foretold  # along an undamped step
        terms = tuple(
            replace(term, value=float(value)) for term, value in zip(model.terms, values + change[count:], strict=True)
        )
        return model.z + change[:count], terms, covariance, foretold

    def _broyden_update(self, before: Model, after: Model, own: Tracks, noise: Noise) -> None:
        """Sensitivities that foretell the step just made (Broyden 1965, Math. Comp. 19, eq. 4.5).

        Numbers are scaled by what the data say of them: one that does not act is given no signature.
        """
        change = after.z - before.z
        scaled = np.diag(self.nuisance_information(noise)) * change
        squared = float(scaled @ change)
        if float(change @ change) < _FOLLOWED**2 or squared <= 0.0:
            return
        share = (scaled / squared).astype(np.float32)
        stepped = [new - old for new, old in zip(after.values(), before.values(), strict=True)]
        unforetold = {}
        for name, columns in self.nuisance_jacobian.items():
            moved = (before.residual[name][:, 0] - after.residual[name][:, 0]).astype(np.float32)
            if own:
                moved -= own[name].astype(np.float32) @ np.array(stepped, np.float32)
            unforetold[name] = (moved - columns @ change.astype(np.float32))[:, None]
            columns += unforetold[name] * share
        white = self._whitened
        white.columns += whitened(unforetold, self.masks, noise) * share
        white.products = np.asarray(white.columns.T @ white.columns, np.float64)

    def at_bounds(self, z: Floats) -> list[int]:
        """Nuisances as far off as they may be: they explain nothing more."""
        return np.flatnonzero((np.abs(z) >= self.bound) | (z >= self.upper)).tolist()

    def nuisance_information(self, noise: Noise) -> Floats:
        """Information of the nuisances, (nuisances, nuisances); remembered for this noise."""
        if self._whitened.noise is not noise:
            self._whitened.columns, self._whitened.products = self._of_nuisances(noise)
            self._whitened.noise = noise
        return self._whitened.products

    def effective_parameters(self, noise: Noise) -> float:
        """How many numbers the data tell: what squares of right ones, fitted, add up to (MacKay 1992, eq. 4.9).

        MacKay, D. J. C.: Bayesian interpolation. Neural Computation 4, 415. Of those that `birge_ratio` counts.
        """
        information = self.nuisance_information(noise)
        shares = np.diag(np.linalg.solve(information + np.eye(len(information)), information))
        return float(shares[self._of_form].sum())

    def birge_ratio(self, z: Floats, told: float | None = None) -> float:
        """How strained these numbers are (`birge_ratio`), at their ends twice if it is known how many data ``told``.

        What single wheels are off is no form of a car: a dozen such numbers, told well and right, would make light of
        all that the others are.
        """
        form = self._of_form
        return birge_ratio(z[form], np.inf if told is None else self.bound[form], told)

    def _of_nuisances(self, noise: Noise) -> tuple[Floats, Floats]:
        """Whitened sensitivities of the nuisances, and their products."""
        if self._whitened.noise is noise:
            return self._whitened.columns, self._whitened.products
        white = whitened(self.nuisance_jacobian, self.masks, noise)
        return white, np.asarray(white.T @ white, np.float64)

    def _total(self, model: Model, own: Tracks, noise: Noise) -> Floats:
        """Products of [residual, nuisances, own columns]."""
        white, products = self._of_nuisances(noise)
        joined = {
            name: np.hstack([values, own[name].astype(np.float64)]) if own else values
            for name, values in model.residual.items()
        }
        outer = whitened(joined, self.masks, noise)
        outer[:, 0] = np.clip(outer[:, 0], -HUBER, HUBER)
        count, width = len(self.nuisances), outer.shape[1]
        total = np.empty((count + width, count + width))
        at = [0, *range(1 + count, count + width)]
        total[1 : 1 + count, 1 : 1 + count] = products
        cross = np.asarray(white.T @ outer.astype(np.float32), np.float64)
        total[np.ix_(range(1, 1 + count), at)] = cross
        total[np.ix_(at, range(1, 1 + count))] = cross.T
        total[np.ix_(at, at)] = outer.T @ outer
        return total

    def linear_prediction(self, model: Model, own: Tracks, noise: Noise, known: Floats | None = None) -> Model:
        """The model after one linear step, with the residual that sensitivities foretell; ``own`` to its values.

        ``known`` (values,) is their information before any data, for those that data may say nothing of.
        """
        count, total = len(self.nuisances), self._total(model, own, noise)
        if known is not None:
            at = 1 + count + np.arange(len(known))
            total[at, at] += known
        z, terms, covariance, _ = self.moved(model, total)
        moved = np.array([new.value - old.value for new, old in zip(terms, model.terms, strict=True)], np.float32)
        change = np.asarray(z - model.z, np.float32)  # as precise as the sensitivities
        residual = {
            name: values - (self.nuisance_jacobian[name] @ change + own[name].astype(np.float32) @ moved)[:, None]
            for name, values in model.residual.items()
        }
        return Model(z, terms, residual, self.cost(residual, z, noise), covariance)

    def alternate_noise_and_fit(self, model: Model, noise: Noise, rounds: int) -> tuple[Model, Noise]:
        """Noise and fit in turn."""
        for _ in range(rounds):
            noise = self.estimate_noise(model, noise)
            model = self.fit(model, noise, 2)
        return model, noise

    def estimate_noise(self, model: Model, noise: Noise) -> Noise:
        """Noise of largest likelihood at the model's residual."""
        return estimate(model.residual, self.masks, noise) if noise.enabled else noise

    def information_blocks(self, model: Model, columns: Tracks, noise: Noise) -> InformationBlocks:
        """Sums with nuisances, the model's effects and all columns."""
        parts = [self.nuisance_jacobian]
        if model.terms:
            parts.append(self.term_jacobian(model))
        parts.append(columns)
        joined = {name: np.hstack([part[name] for part in parts]) for name in columns}
        return information_blocks(model.residual, joined, self.masks, noise, len(self.nuisances))


def _difference(term: Term, sd: float) -> float:
    """Step of a finite difference: twice the standard deviation ``sd`` that data leave open (0: nobody knows yet), at
    most a fifth of what is usual, for a threshold is met at one step of a replay or the next; inside the bounds."""
    parameter = term.candidate.parameter
    usual = abs(parameter.typical)
    size = max(0.02 * usual, 0.05 * abs(term.value), min(2.0 * sd, 0.2 * usual))
    return -size if term.value + size > parameter.high else size
