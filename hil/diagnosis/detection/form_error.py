"""What causes leave by the form of their equations, before it is one more cause."""

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Tracks
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise, SampleMasks, whiten
from plant.effects.effect import Effect

FORM_ERROR, FORM_ERROR_SAME_POINT = 0.2, 0.35
"""Share of the amplitude of a cause that its equation may get wrong, elsewhere and at its own joints."""


class FormErrorAllowance:
    """What the causes of a model may leave for one more: a share of what they have ``explained`` of chi-squared.

    At their own joints all of it. Elsewhere as far as both act together: if their equations err by a share f in every
    track of every manoeuvre, a signature with energies e there takes at most f^2 (sum sqrt(e P))^2 / sum e off
    chi-squared, P being the energies of the causes (Cauchy and Schwarz).
    """

    def __init__(self, explained: float, fitter: Fitter, model: Model, noise: Noise, columns: Tracks) -> None:
        self._explained, self._columns, self._frame, self._noise = explained, columns, fitter.masks, noise
        self._joints = {joint for term in model.terms for joint in term.candidate.effect.injection_points}
        self._known: dict[str, float] = {}
        if model.terms:
            values = np.array(model.values())
            own = {name: (of @ values)[:, None] for name, of in fitter.term_jacobian(model).items()}
            self._energies = signature_energies(own, self._frame, noise)

    def of(self, candidate: Candidate) -> float:
        """Of chi-squared, for a candidate; remembered."""
        if candidate.name not in self._known:
            at = list(candidate.columns)
            own = {name: values[:, at].sum(axis=1, keepdims=True) for name, values in self._columns.items()}
            self._known[candidate.name] = self.of_signature(candidate.effect, own)
        return self._known[candidate.name]

    def of_signature(self, effect: Effect, columns: Tracks) -> float:
        """Of chi-squared, for an effect with this signature, (samples, 1)."""
        if not self._joints:
            return 0.0
        if self._joints.intersection(effect.injection_points):
            return FORM_ERROR_SAME_POINT**2 * self._explained
        together = signature_overlap(self._energies, signature_energies(columns, self._frame, self._noise))
        return FORM_ERROR**2 * self._explained * together


def signature_energies(columns: Tracks, frame: SampleMasks, noise: Noise) -> Floats:
    """Squares of one whitened column, (samples, 1), summed by track and manoeuvre."""
    whitened, _ = whiten({name: values.astype(np.float64) for name, values in columns.items()}, frame, noise)
    blocks = np.asarray(frame.segment_id, np.int64)
    count = int(blocks.max()) + 1
    return np.concatenate([np.bincount(blocks, whitened[name][:, 0] ** 2, count) for name in frame.names])


def signature_overlap(one: Floats, other: Floats) -> float:
    """How far two signatures lie in the same tracks and manoeuvres, by their energies there: 0 to 1."""
    together = float(np.sqrt(one * other).sum()) ** 2
    return together / max(float(one.sum() * other.sum()), 1e-300)
