"""The vehicle's numbers: sensitivities to them, and their fit with the noise in turn."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO, Fitter, Model, Term, same_terms, with_term
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.priors import recording_nuisances
from hil.diagnosis.vehicle.spec import Vehicle

_KINKED = ("ehb_dead_time_s",)
"""What acts from step to step, with a kink at each."""
_COARSE, _FINE = 0.5, 3.0
"""Finite differences: in standard deviations of what is known before, and of what data say."""
_TURNS, _MOST_ANEW, _SETTLED, _STALE, _FAR = 20, 4, 3.0, 0.3, 1.0
_REMEMBERED, _STILL = 3, 0.5
"""Times that sensitivities were taken last, and how far numbers may be from there, in standard deviations, for those of
the best of several causes to serve again when it is accepted. A fit of the numbers themselves asks for `_STALE`."""


class NuisanceFit:
    """What may be off in the car as handed in (``base``), within its tolerance.

    ``fitter`` has the sensitivities last taken and the simulator of the fits to come; ``relinearise`` False keeps the
    first sensitivities.
    """

    def __init__(
        self, rig: Simulator, frame: SampleMasks, vehicle: Vehicle, base: ParameterSet, relinearise: bool
    ) -> None:
        self._frame, self._base, self._relinearise = frame, base, relinearise
        told = all(drive.log.disc_temperature_k is not None for drive in rig.dataset.recordings)
        self.nuisances = (*vehicle.nuisances, *recording_nuisances(told, vehicle.node_latency_s))
        self._steps: Floats = np.full(len(self.nuisances), _COARSE)
        self.fitter = Fitter(rig, frame, base, self.nuisances, {})
        self._taken: deque[tuple[Floats, tuple[Term, ...], Fitter]] = deque(maxlen=_REMEMBERED)

    def relinearise(self, z: Floats, terms: Sequence[Term] = ()) -> None:
        """Take the sensitivities where the numbers are ``z`` standard deviations off, beside these effects.

        Inputs are denoised at that car, too (`Simulator.denoised`), and it is the baseline of the fits to come.
        """

        def world(of: Floats) -> ParameterSet:
            found = self._base.with_nuisances(self.nuisances, of)
            for term in terms:
                found = with_term(found, term)
            return found

        simulator = self.fitter.simulator.denoised(world(z)).with_baseline(world(z))
        highest = np.array([nuisance.upper for nuisance in self.nuisances])
        steps = np.where(z + self._steps > highest, -self._steps, self._steps)
        base, own = simulator.run(world(z)), np.diag(steps)
        tracks = finite_difference_jacobian(
            simulator, self._frame, base, [world(z + step) for step in own], steps.tolist()
        )
        for k, nuisance in enumerate(self.nuisances):
            if nuisance.name in _KINKED:  # the mean of both sides
                other = finite_difference_jacobian(
                    simulator, self._frame, base, [world(z - own[k])], [-float(steps[k])]
                )
                for name, columns in tracks.items():
                    columns[:, k] = 0.5 * (columns[:, k] + other[name][:, 0])
        self.fitter = Fitter(simulator, self._frame, self._base, self.nuisances, tracks)
        self._taken.append((z, tuple(terms), self.fitter))

    def relinearise_cached(self, z: Floats, terms: Sequence[Term]) -> None:
        """As `anew`, or those taken lately where a car with these effects was alike."""
        for around, taken, fitter in self._taken:
            if float(np.abs(z - around).max()) <= _STILL and same_terms(taken, terms):
                self.fitter = fitter.with_simulator(self.fitter.simulator)
                return
        self.relinearise(z, terms)

    def fit(self, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """Numbers and noise in turn, with sensitivities taken anew until neither moves.

        What the numbers have not explained yet counts as noise, so the steps are forgiving; the first are made with the
        noise at hand, for noise found there would take edges for its own that numbers explain.
        """
        cost, around, times = np.inf, model.z, 0
        for turn in range(_TURNS):
            if turn:
                noise = self.fitter.estimate_noise(model, noise)
            model = self.fitter.fit(model, noise, 4, follow=True)
            settled, cost = cost - model.cost < _SETTLED, model.cost
            stale = float(np.abs(model.z - around).max()) > (_STALE * (1 + 2 * times) if settled else _FAR)
            most = _MOST_ANEW if self.fitter.birge_ratio(model.z) < BIASED_BIRGE_RATIO else 2 * _MOST_ANEW
            if self._relinearise and stale and times < most:
                information = np.diag(self.fitter.nuisance_information(noise))
                self._steps = np.clip(_FINE / np.sqrt(np.maximum(information, 1e-9)), 0.03, _COARSE)
                self.relinearise(model.z, model.terms)
                model = self.fitter.at(model.z, model.terms, noise)
                around, times, cost = model.z, times + 1, np.inf
            elif settled:
                break
        return model, noise

    def linearisation_stale(self, model: Model, around: Floats) -> bool:
        """Whether the sensitivities taken at ``around`` hold no longer."""
        return self._relinearise and float(np.abs(model.z - around).max()) >= _FAR
