"""Non-linear fits: bounded Gauss-Newton steps on nuisance parameters and terms.

Takes a simulator, a starting model and a noise; gives the model of least cost, twice the negative log-likelihood with
the priors of the nuisances. Each step solves the linearised problem and is simulated, open loop, before it is kept.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats, UnusableError
from hil.diagnosis.estimation.information import (
    InformationBlocks,
    acting_among,
    finite_difference_jacobian,
    information_blocks,
    silent_columns,
    solve_bounded,
)
from hil.diagnosis.estimation.model import Model, TakenJacobian, Term, Tracks, same_terms, with_term
from hil.diagnosis.noise.estimate import estimate, first_guess
from hil.diagnosis.noise.innovations import HUBER
from hil.diagnosis.noise.model import Noise, SampleMasks, tracks_of, whiten, whitened
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind

_LARGEST_STEP = 8.0
"""Largest step of a nuisance, in prior standard deviations: what the linearisation may be trusted for."""
_ATTEMPTS = ((False, 0.0, 1.0), (True, 0.0, 0.5), (True, 0.1, 1.0), (True, 1.0, 1.0), (True, 10.0, 1.0))
"""Attempts at a step until one lowers the cost: (limits held, damping, share of the step). Damping stops two parameters
that move together and cancel; half a step does not."""
_LIMITS = (
    "battery_charge_power_w", "motor_peak_torque_nm", "motor_rate_limit_nm_s", "motor_fade_start_mps",
    "motor_fade_end_mps", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s",
)  # fmt: skip
"""Nuisances with an effect on one side alone: a limit that is not met, moved a little too far, spoils any step."""
_DIVERGED = 1e15
"""Cost of a simulation that is not finite."""
_DIVERGES = (
    "with the numbers of the vehicle set the simulated car diverges: its speeds are not finite. Each number is within"
    " its bounds; expected numbers that belong to one car. Check masses, inertias, stiffnesses and time constants"
)
_WORTH = 1.0
"""Decrease of the cost (chi-squared) below which a step is the last: far below any threshold of detection."""
_FOLLOWED = 0.5
"""Step, in prior standard deviations, below which the Jacobian is not updated: rounding and noise would count."""
BIASED_BIRGE_RATIO = 1.5
"""Birge ratio (`Fitter.birge_ratio`) from which an unmodelled cause may bias the nuisances."""
_REMEMBERED = 16
"""Term Jacobians that are remembered: fits, their scores and intervals ask for the same one."""


def _finite(values: Mapping[str, Floats]) -> bool:
    return all(np.isfinite(one).all() for one in values.values())


def _far(linearised: Model, now: Model) -> bool:
    """The model is far from where the term Jacobian was taken."""
    moved = np.abs(now.z - linearised.z).max(initial=0.0)
    return not same_terms(linearised.terms, now.terms) or bool(moved > _FOLLOWED)


@dataclass(eq=False)
class _Whitened:
    """Jacobian of the nuisances whitened for one noise: ``columns`` (samples, acting) of those that are ``acting``, and
    the ``products`` (nuisances, nuisances) of all."""

    noise: Noise | None = None
    acting: list[int] = field(default_factory=list)
    columns: Floats = field(default_factory=lambda: np.empty((0, 0), np.float32))
    products: Floats = field(default_factory=lambda: np.empty((0, 0)))


class Fitter:
    """Fits models of one dataset.

    ``nuisance_columns`` is the Jacobian, (samples, nuisances) by track, in prior sd; its ``silent`` columns are zero
    and stay so. ``origin`` (nuisances,) is the car that deviations count from: the nominal one, or the one that
    reference logs show.
    """

    def __init__(
        self,
        simulator: Simulator,
        masks: SampleMasks,
        base: ParameterSet,
        nuisances: Sequence[Nuisance],
        nuisance_columns: Tracks,
        origin: Floats | None = None,
    ) -> None:
        self.simulator, self.masks, self.base = simulator, masks, base
        self.nuisances, self.nuisance_jacobian = tuple(nuisances), nuisance_columns
        self.silent = silent_columns(nuisance_columns)
        self.updated = False  # the Jacobian, by steps made since it was taken
        self.origin = np.zeros(len(self.nuisances)) if origin is None else origin
        self.bound = np.array([nuisance.bound for nuisance in self.nuisances])
        self.upper = np.array([nuisance.upper for nuisance in self.nuisances])
        self.lower = np.array([nuisance.lower for nuisance in self.nuisances])
        self._counted = np.array([nuisance.kind is not NuisanceKind.SIDE_TO_SIDE for nuisance in self.nuisances])
        counted = (one for one, taken in zip(self.nuisances, self._counted, strict=True) if taken)
        self._of_the_day = np.array([one.kind is NuisanceKind.OF_THE_DAY for one in counted], bool)
        self._limits = [k for k, nuisance in enumerate(self.nuisances) if nuisance.name in _LIMITS]
        self.radius = float(simulator.vehicle.parameters.wheel.rolling_radius_m)
        self._measured = simulator.measured()
        self._whitened = _Whitened()
        self._taken: deque[TakenJacobian] = deque(maxlen=_REMEMBERED)
        self._awake: set[int] = set()  # nuisances without a column of their own that acted in some model

    def copy(self) -> "Fitter":
        """A fitter whose Jacobian may be updated independently of this one."""
        columns = {name: values.copy() for name, values in self.nuisance_jacobian.items()}
        other = Fitter(self.simulator, self.masks, self.base, self.nuisances, columns, self.origin)
        other.updated = self.updated
        return other

    def holding(self, held: NDArray[np.bool_]) -> "Fitter":
        """A copy in which the nuisances that are ``held`` stay at the origin."""
        other = self.copy()
        other.lower, other.upper = (np.where(held, self.origin, limits) for limits in (self.lower, self.upper))
        return other

    def forget(self) -> None:
        """Free the whitened Jacobian, as large as the Jacobian itself; it is made again where it is needed."""
        shared, empty = self._whitened, _Whitened()
        shared.noise, shared.columns, shared.products = None, empty.columns, empty.products

    def with_simulator(self, simulator: Simulator) -> "Fitter":
        """This fitter on another simulator of the same dataset; both share the Jacobian of the nuisances."""
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
        """Parameter set of nuisances and terms."""
        parameters = self.base.with_nuisances(self.nuisances, z)
        for term in terms:
            parameters = with_term(parameters, term)
        return parameters

    def at(self, z: Floats, terms: Sequence[Term], noise: Noise) -> Model:
        """The model at these nuisances and terms, simulated."""
        stack = self.simulator.run(self.parameter_set(z, terms))
        residual = self._residual_of(stack)
        cost, unknown = self.cost(residual, z, noise), np.zeros((0, 0))
        return Model(z, tuple(terms), residual, cost, unknown, stack, self.simulator.driven_by)

    def channels(self, model: Model) -> Stack:
        """Channels of a model by the inputs of this fitter's simulator, which may be denoised anew since its fit."""
        known = model.channels and model.driven_by is self.simulator.driven_by
        return model.channels if known else self.simulator.run(self.parameter_set(model.z, model.terms))

    def residual(self, z: Floats, terms: Sequence[Term]) -> Tracks:
        """Residual tracks of a model."""
        return self._residual_of(self.simulator.run(self.parameter_set(z, terms)))

    def _residual_of(self, stack: Stack) -> Tracks:
        """Residual tracks of simulated channels; infinite where a simulation is not finite.

        In tracks nothing measured is a residual of 0: a car that diverges would fit perfectly.
        """
        tracks = self.tracks({group: self._measured[group] - values for group, values in stack.items()})
        if _finite(stack):
            return tracks
        return {name: np.full_like(values, np.inf) for name, values in tracks.items()}

    def tracks(self, stack: Stack) -> Tracks:
        """Tracks, (samples, 1), of channels."""
        return tracks_of(stack, self.masks, self.radius)

    def cost(self, residual: Tracks, z: Floats, noise: Noise) -> float:
        """Twice the negative log-likelihood with the priors of the nuisances."""
        if not _finite(residual):
            return _DIVERGED
        return -2.0 * whiten(residual, self.masks, noise)[1] + float(z @ z)

    def start(self, enabled: bool = True) -> tuple[Model, Noise]:
        """The vehicle at the origin, and a first guess of the noise."""
        z = self.origin
        residual = self.residual(z, ())
        if not _finite(residual):
            raise UnusableError(_DIVERGES)
        noise = first_guess(residual, self.masks, enabled)
        return self.at(z, (), noise), noise

    def term_jacobian(self, model: Model) -> Tracks:
        """Jacobian of the terms' values at the model, by track (samples, terms)."""
        parameters = self.parameter_set(model.z, model.terms)
        known = np.maximum(np.diag(model.covariance), 0.0) if model.covariance.size else np.zeros(len(model.terms))
        steps = [_difference(term, float(sd)) for term, sd in zip(model.terms, np.sqrt(known), strict=True)]
        driven_by = self.simulator.driven_by
        known_tracks = next((one.tracks for one in tuple(self._taken) if one.at(driven_by, model, steps)), None)
        if known_tracks is not None:
            return known_tracks
        moved = [term.candidate.applied(parameters, step) for term, step in zip(model.terms, steps, strict=True)]
        tracks = finite_difference_jacobian(self.simulator, self.masks, self.channels(model), moved, steps)
        at = Model(model.z, model.terms, {}, 0.0, np.zeros((0, 0)))
        self._taken.append(TakenJacobian(driven_by, at, steps, tracks))
        return tracks

    def nuisance_jacobian_at(self, model: Model) -> Tracks:
        """Jacobian of the nuisances, with new columns for those that had none before the model's terms.

        With constant friction nothing depends on the heat capacity of the discs; with a fade by temperature it does.
        """
        silent = self.silent
        if not silent or not model.terms:
            return self.nuisance_jacobian
        base = self.channels(model)

        def stepped(places: Sequence[int]) -> ParameterSet:
            z = model.z.copy()
            z[list(places)] += 1.0
            return self.parameter_set(z, model.terms)

        mute = [k for k in silent if k not in self._awake]
        self._awake.update(acting_among(self.simulator, base, stepped, mute))
        acting = [k for k in silent if k in self._awake]
        if not acting:
            return self.nuisance_jacobian
        moved = [stepped([k]) for k in acting]
        added = finite_difference_jacobian(self.simulator, self.masks, base, moved, [1.0] * len(acting))
        columns = {name: values.copy() for name, values in self.nuisance_jacobian.items()}
        for name, values in columns.items():
            values[:, acting] = added[name]
        return columns

    def fit(
        self, model: Model, noise: Noise, steps: int = 2, relinearise: bool = True, own: Tracks | None = None,
        follow: bool = False,
    ) -> Model:  # fmt: skip
        """The model of least cost after some steps, the same model where none lowers it, or where its car diverges.

        ``own`` is the term Jacobian at this model, if it is known; with ``follow`` the Jacobian of the nuisances is
        updated by each step (Broyden).
        """
        best = replace(model, cost=self.cost(model.residual, model.z, noise))
        linearised = best
        if not _finite(best.residual):
            return best
        for _ in range(steps):
            if best.terms and (own is None or (relinearise and _far(linearised, best))):
                own, linearised = self.term_jacobian(best), best
            moved = self._step(best, own or {}, noise)
            gained = best.cost - moved.cost
            if follow:
                self._broyden_update(best, moved, own or {}, noise)
            best = moved
            if gained < _WORTH:
                break
        return best

    def refit_amplitudes(self, model: Model, noise: Noise, steps: int = 2) -> Model:
        """The model with the value of its last term at least cost, all else fixed; the same where its car diverges."""
        for _ in range(steps if _finite(model.residual) else 0):
            own = self.term_jacobian(model)
            joined = {name: np.hstack([values, own[name][:, -1:]]) for name, values in model.residual.items()}
            residual, signature = whitened(joined, self.masks, noise).T
            *others, term = model.terms
            step = float(np.clip(residual, -HUBER, HUBER) @ signature) / max(float(signature @ signature), 1e-30)
            parameter = term.candidate.parameter
            value = float(np.clip(term.value + step, parameter.low, parameter.high))
            moved = self.at(model.z, (*others, replace(term, value=value)), noise)
            if moved.cost >= model.cost - _WORTH:
                break
            model = moved
        return model

    def _step(self, model: Model, own: Tracks, noise: Noise) -> Model:
        total, foreseen = self._total(model, own, noise), 0.0
        for hold, damping, share in _ATTEMPTS:
            z, terms, covariance, decrease = self.moved(model, total, hold, damping, share)
            if decrease < _WORTH:
                break
            moved, foreseen = self.at(z, terms, noise), max(foreseen, decrease)
            if moved.cost < model.cost:
                return replace(moved, covariance=covariance)
        return replace(model, covariance=model.covariance if model.covariance.size else covariance, unrealised=foreseen)

    def moved(
        self, model: Model, total: Floats, hold: bool = False, damping: float = 0.0, share: float = 1.0
    ) -> tuple[Floats, tuple[Term, ...], Floats, float]:
        """Nuisances and terms after a bounded step, covariance of the terms, and the decrease if the model is linear.

        ``total`` are products of [residual, nuisances, term Jacobian]; ``hold`` keeps the limits where they are;
        ``share`` of the step is made.
        """
        count, values = len(self.nuisances), np.array(model.values())
        bounds = [(term.candidate.parameter.low, term.candidate.parameter.high) for term in model.terms]
        least, most = np.array(bounds).reshape(-1, 2).T
        low = np.concatenate((np.maximum(self.lower - model.z, -_LARGEST_STEP), least - values))
        high = np.concatenate((np.minimum(self.upper - model.z, _LARGEST_STEP), most - values))
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        if hold:
            low[self._limits] = high[self._limits] = 0.0
        free = range(len(values))
        change, covariance, decrease = solve_bounded(total, count, free, model.z, low, high, damping)
        change, decrease = share * change, share * (2.0 - share) * decrease  # along an undamped step
        terms = tuple(
            replace(term, value=float(value)) for term, value in zip(model.terms, values + change[count:], strict=True)
        )
        return model.z + change[:count], terms, covariance, decrease

    def _broyden_update(self, before: Model, after: Model, own: Tracks, noise: Noise) -> None:
        """Update the Jacobian so that it predicts the step just made (Broyden 1965, Math. Comp. 19, eq. 4.5).

        Nuisances are scaled by their information: one without effect gets no signature.
        """
        change = after.z - before.z
        scaled = np.diag(self.nuisance_information(noise)) * change
        squared = float(scaled @ change)
        if float(change @ change) < _FOLLOWED**2 or squared <= 0.0:
            return
        self.updated, share = True, (scaled / squared).astype(np.float32)
        stepped = [new - old for new, old in zip(after.values(), before.values(), strict=True)]
        unpredicted = {}
        for name, columns in self.nuisance_jacobian.items():
            moved = (before.residual[name][:, 0] - after.residual[name][:, 0]).astype(np.float32)
            if own:
                moved -= np.einsum("tk,k->t", own[name], np.array(stepped)).astype(np.float32)
            unpredicted[name] = (moved - columns @ change.astype(np.float32))[:, None]
            _add_outer(columns, unpredicted[name][:, 0], share)
        white, added = self._whitened, whitened(unpredicted, self.masks, noise)[:, 0]
        _add_outer(white.columns, added, share[white.acting])
        white.products = _products(white.columns, white.acting, len(share))

    def at_bounds(self, z: Floats) -> list[int]:
        """Nuisances at their bounds, which explain nothing more."""
        return np.flatnonzero((np.abs(z) >= self.bound) | (z >= self.upper)).tolist()

    def nuisance_information(self, noise: Noise) -> Floats:
        """Information matrix, (nuisances, nuisances), priors left out; remembered for this noise."""
        if self._whitened.noise is not noise:
            new, shared = self._of_nuisances(noise), self._whitened  # by all fitters with this Jacobian
            shared.acting, shared.columns, shared.products, shared.noise = new.acting, new.columns, new.products, noise
        return self._whitened.products

    def effective_parameters(self, noise: Noise) -> float:
        """Nuisances that the data determine, of those `birge_ratio` counts: the trace of I (I + 1)^-1.

        It is the expected sum of squares of the fitted ones (MacKay 1992, Neural Computation 4, 415, eq. 4.9).
        """
        information = self.nuisance_information(noise)
        shares = np.diag(np.linalg.solve(information + np.eye(len(information)), information))
        return float(shares[self._counted].sum())

    def birge_ratio(self, z: Floats, effective_parameters: float | None = None) -> float:
        """How far the nuisances ``z`` lie outside their prior, as a variance, at least 1.

        A model that needs more than 1 errs in its causes too (Birge 1932, Phys. Rev. 40, 207). Scatter between wheels
        does not count: a dozen such nuisances, well known and right, would hide that all others are off. With
        ``effective_parameters``, how many the data determine, the sum of squares is divided by these, not by all: what
        no data determine stays at 0. There, if the ratio of all is large, a nuisance at its bound counts as if it were
        twice as far.
        """
        z, bound = (z - self.origin)[self._counted], self.bound[self._counted]
        squares = np.square(z)
        if effective_parameters is None:
            of_the_day = squares[self._of_the_day]  # these alone absorb a change since reference logs
            day = float(of_the_day.mean()) if len(of_the_day) else 1.0
            return max(1.0, float(squares.sum()) / max(len(z), 1.0), day)
        if squares.sum() >= BIASED_BIRGE_RATIO * len(z):
            squares = squares * np.where(np.abs(z) >= bound, 4.0, 1.0)
        return max(1.0, float(squares.sum()) / max(effective_parameters, 1.0))

    def _of_nuisances(self, noise: Noise) -> _Whitened:
        """Whitened Jacobian of the nuisances."""
        if self._whitened.noise is noise:
            return replace(self._whitened)  # others may renew it
        count = len(self.nuisances)
        acting = [k for k in range(count) if k not in self.silent]
        chosen = acting if self.silent else None
        white = whitened(self.nuisance_jacobian, self.masks, noise, chosen)
        return _Whitened(noise, acting, white, _products(white, acting, count))

    def _total(self, model: Model, own: Tracks, noise: Noise) -> Floats:
        """Products of the whitened [residual, nuisances, term Jacobian]."""
        white = self._of_nuisances(noise)
        joined = {
            name: np.hstack([values, own[name].astype(np.float64)]) if own else values
            for name, values in model.residual.items()
        }
        outer = whitened(joined, self.masks, noise)
        outer[:, 0] = np.clip(outer[:, 0], -HUBER, HUBER)
        count, width = len(self.nuisances), outer.shape[1]
        total = np.empty((count + width, count + width))
        at = [0, *range(1 + count, count + width)]
        total[1 : 1 + count, 1 : 1 + count] = white.products
        cross = np.zeros((count, width))
        cross[white.acting] = white.columns.T @ outer.astype(np.float32)
        total[np.ix_(range(1, 1 + count), at)] = cross
        total[np.ix_(at, range(1, 1 + count))] = cross.T
        total[np.ix_(at, at)] = outer.T @ outer
        return total

    def linear_prediction(self, model: Model, own: Tracks, noise: Noise, known: Floats | None = None) -> Model:
        """The model after one linear step, its residual predicted by the Jacobians; ``own`` is that of the terms.

        ``known`` (terms,) is prior information of the values, for those the data may not determine.
        """
        count, total = len(self.nuisances), self._total(model, own, noise)
        if known is not None:
            at = 1 + count + np.arange(len(known))
            total[at, at] += known
        z, terms, covariance, _ = self.moved(model, total)
        moved = np.array([new.value - old.value for new, old in zip(terms, model.terms, strict=True)])
        change = np.asarray(z - model.z, np.float32)  # as precise as the sensitivities
        residual = {
            name: values - (self.nuisance_jacobian[name] @ change + np.einsum("tk,k->t", own[name], moved))[:, None]
            for name, values in model.residual.items()
        }
        return Model(z, terms, residual, self.cost(residual, z, noise), covariance)

    def alternate_noise_and_fit(self, model: Model, noise: Noise, rounds: int) -> tuple[Model, Noise]:
        """Noise estimate and fit in turn."""
        for _ in range(rounds):
            noise = self.estimate_noise(model, noise)
            model = self.fit(model, noise, 2)
        return model, noise

    def estimate_noise(self, model: Model, noise: Noise) -> Noise:
        """Noise of largest likelihood at the model's residual."""
        return estimate(model.residual, self.masks, noise) if noise.enabled else noise

    def information_blocks(self, model: Model, columns: Tracks, noise: Noise) -> InformationBlocks:
        """Information by segment of nuisances, the model's terms and all columns."""
        parts = [self.nuisance_jacobian]
        if model.terms:
            parts.append(self.term_jacobian(model))
        parts.append(columns)
        return information_blocks(model.residual, parts, self.masks, noise, len(self.nuisances))


def _products(white: Floats, acting: Sequence[int], count: int) -> Floats:
    """Products, (count, count), of the columns that are acting, (samples, acting)."""
    products = np.zeros((count, count))
    products[np.ix_(acting, acting)] = white.T @ white
    return products


@compiled
def _add_outer(columns: Floats, by: Floats, share: Floats) -> None:
    """Add ``by`` (samples,) times ``share`` (columns,) to ``columns`` (samples, columns), in place."""
    for t in range(columns.shape[0]):
        for k in range(columns.shape[1]):
            columns[t, k] += by[t] * share[k]


def _difference(term: Term, sd: float) -> float:
    """Step of a finite difference, inside the bounds: twice the standard deviation ``sd`` of the value (0: unknown).

    At most a fifth of the typical value, as thresholds are crossed from one simulation step to the next.
    """
    parameter = term.candidate.parameter
    typical = abs(parameter.typical)
    size = max(0.02 * typical, 0.05 * abs(term.value), min(2.0 * sd, 0.2 * typical))
    return -size if term.value + size > parameter.high else size
