"""Fit of the nuisance parameters and the noise in turn, with the Jacobian taken again where the fit has moved.

Takes a simulator of the nominal vehicle; gives fitters with the Jacobian at a point, and the fitted model and noise.
"""

from collections import deque
from collections.abc import Sequence
from copy import copy

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO, Fitter
from hil.diagnosis.estimation.information import acting_among, finite_difference_jacobian
from hil.diagnosis.estimation.model import Model, Term, Tracks, same_terms, with_term
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.priors import Nuisance, recording_nuisances
from hil.diagnosis.vehicle.spec import Vehicle

_KINKED = ("ehb_dead_time_s",)
"""Nuisances with a kink at each simulation step: a dead time is a whole number of these."""
_FINE, _LEAST, _MOST = 3.0, 0.06, 0.5
"""Steps of finite differences where the data's information is known: in posterior standard deviations; the least as a
share of the first step, the largest in prior standard deviations. Data may know a common part
(`hil.diagnosis.detection.reference_fit`) a thousand times better than its prior."""
_TURNS, _MOST_LINEARISATIONS, _SETTLED = 20, 4, 3.0
"""Turns of noise and nuisances at most, Jacobians at most, and the decrease of the cost at which a fit has settled."""
_STALE, _FAR = 0.3, 1.0
"""Distance, in prior standard deviations, at which the Jacobian is stale: of a settled fit, and of any."""
_REMEMBERED, _STILL = 3, 0.5
"""Jacobians that are remembered, and the distance, in prior standard deviations, within which one serves again when the
best of several causes is accepted."""


class NuisanceFit:
    """Nuisances of the nominal vehicle (``base``), linearised at its ``origin`` (`Fitter`) first.

    ``fitter`` has the Jacobian taken last and the simulator of the fits to come; ``relinearise`` False keeps the
    first Jacobian. ``nuisances`` are those of the vehicle and its logs by default.
    """

    def __init__(
        self, simulator: Simulator, masks: SampleMasks, vehicle: Vehicle, base: ParameterSet, relinearise: bool,
        nuisances: Sequence[Nuisance] | None = None, origin: Floats | None = None,
    ) -> None:  # fmt: skip
        self._masks, self._base, self._relinearise = masks, base, relinearise
        recordings = simulator.dataset.recordings
        measured = all(recording.log.disc_temperature_k is not None for recording in recordings)
        usual = (*vehicle.nuisances, *recording_nuisances(measured, vehicle.latencies))
        self.nuisances = usual if nuisances is None else tuple(nuisances)
        self._first_steps: Floats = np.array([one.difference for one in self.nuisances])
        self._steps = self._first_steps
        self.fitter = Fitter(simulator, masks, base, self.nuisances, {}, origin)
        self._taken: deque[tuple[Floats, tuple[Term, ...], Fitter]] = deque(maxlen=_REMEMBERED)
        self.relinearise(self.fitter.origin)

    def relinearise(self, z: Floats, terms: Sequence[Term] = (), noise: Noise | None = None) -> None:
        """Take the Jacobian at ``z`` prior standard deviations, given these terms.

        Steps of the finite differences are as fine as what the last Jacobian tells in this ``noise``. Inputs are
        denoised there, too (`Simulator.denoised`), and it is the baseline of the fits to come.
        """
        if noise is not None:
            information = np.diag(self.fitter.nuisance_information(noise))
            fine = _FINE / np.sqrt(np.maximum(information, 1e-9))
            self._steps = np.clip(fine, _LEAST * self._first_steps, _MOST)
        at = self._parameter_set(z, terms)
        simulator = self.fitter.simulator.denoised(at).with_baseline(at)
        upper = np.array([nuisance.upper for nuisance in self.nuisances])
        steps = np.where(z + self._steps > upper, -self._steps, self._steps)
        channels, moves = simulator.run(at), np.diag(steps)
        count, silent = len(steps), self.fitter.silent

        def stepped(places: Sequence[int]) -> ParameterSet:
            return self._parameter_set(z + moves[list(places)].sum(axis=0), terms)

        def jacobian(places: Sequence[int], sign: float, among: tuple[Sequence[int], int] | None = None) -> Tracks:
            moved = [self._parameter_set(z + sign * moves[k], terms) for k in places]
            by = [sign * float(steps[k]) for k in places]
            return finite_difference_jacobian(simulator, self._masks, channels, moved, by, among)

        acting = acting_among(simulator, channels, stepped, silent)
        rest = [k for k in range(count) if k not in silent or k in acting]
        columns = jacobian(rest, 1.0, (rest, count))
        kinked = [k for k in rest if self.nuisances[k].name in _KINKED]
        if kinked:  # the mean of both sides
            for name, values in jacobian(kinked, -1.0).items():
                columns[name][:, kinked] = 0.5 * (columns[name][:, kinked] + values)
        self.fitter.forget()
        self.fitter = Fitter(simulator, self._masks, self._base, self.nuisances, columns, self.fitter.origin)
        self._taken.append((z, tuple(terms), self.fitter))

    def _parameter_set(self, z: Floats, terms: Sequence[Term]) -> ParameterSet:
        parameters = self._base.with_nuisances(self.nuisances, z)
        for term in terms:
            parameters = with_term(parameters, term)
        return parameters

    def beginning_with(self, fitter: Fitter) -> "NuisanceFit":
        """A fit that begins with another fitter and leaves this one as it is; Jacobians are remembered for both."""
        other = copy(self)
        other.fitter = fitter
        return other

    def relinearise_cached(self, z: Floats, terms: Sequence[Term]) -> None:
        """As `relinearise`, or a remembered Jacobian of a model that was alike."""
        for around, others, fitter in self._taken:
            if float(np.abs(z - around).max()) <= _STILL and same_terms(others, terms):
                self.fitter = fitter.with_simulator(self.fitter.simulator)
                return
        self.relinearise(z, terms)

    def fit(self, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """Nuisances and noise in turn until neither moves, with a new Jacobian where the nuisances moved.

        What is not explained yet counts as noise, so steps are forgiving. The first turn keeps the noise given: an
        estimate there would take for noise what the nuisances explain. Steps update a copy of the Jacobian: who has the
        fitter of before, and who remembers it, keeps the one that was taken.
        """
        self.fitter = self.fitter.copy()
        cost, around, times = np.inf, model.z, 0
        for turn in range(_TURNS):
            if turn:
                noise = self.fitter.estimate_noise(model, noise)
            model = self.fitter.fit(model, noise, 4, follow=True)
            settled, cost = cost - model.cost < _SETTLED, model.cost
            stale = float(np.abs(model.z - around).max()) > (_STALE * (1 + 2 * times) if settled else _FAR)
            stale |= model.unrealised >= _SETTLED and self.fitter.updated
            most = (
                _MOST_LINEARISATIONS
                if self.fitter.birge_ratio(model.z) < BIASED_BIRGE_RATIO
                else 2 * _MOST_LINEARISATIONS
            )
            if self._relinearise and stale and times < most:
                if times:
                    self._taken.pop()  # on the way of this fit: no other will ask for it
                self.relinearise(model.z, model.terms, noise)
                model = self.fitter.at(model.z, model.terms, noise)
                around, times, cost = model.z, times + 1, np.inf
            elif settled:
                break
        return model, noise

    def linearisation_stale(self, model: Model, around: Floats) -> bool:
        """The Jacobian taken at ``around`` holds no longer for the model."""
        return self._relinearise and float(np.abs(model.z - around).max()) >= _FAR
