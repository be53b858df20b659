"""The field of a race: what every candidate shows at a model, how much it explains there, and who is worth a look."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.axle_torques import undriven
from hil.diagnosis.detection.onset import OnsetTime, onset_penalty, segment_starts
from hil.diagnosis.detection.onset_scan import scan_onset_by_segment
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import ScoreTest, score, scores, shortlist
from hil.diagnosis.detection.zero_gradient import has_zero_gradient, line_search
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Tracks
from hil.diagnosis.estimation.information import (
    InformationBlocks,
    finite_difference_jacobian,
    marginalise,
    marginalise_from_onset,
)
from hil.diagnosis.estimation.terms import Candidate, candidates, columns
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.simulation.hot_spots import phase_penalty
from hil.diagnosis.simulation.simulator import Simulator

_PLAUSIBLE = 12


class CandidateSet:
    """All candidates of a case; ``tracks`` are their sensitivities where they were last taken.

    Nodes that are ``quiet`` tell nothing but noise (`unexcited_sensors`).
    """

    def __init__(self, rig: Simulator, frame: SampleMasks, untold: Sequence[str], quiet: Sequence[str] = ()) -> None:
        self._frame, self._starts, self._visibility = frame, segment_starts(rig.dataset), rig.hot_spot_visibility
        self._columns = columns(untold)
        without = undriven(drive.log for drive in rig.dataset.recordings)
        listed = candidates(self._columns, without, rig.vehicle.suspension_stated, quiet)
        self.candidates = [self._priced(one) for one in listed]
        self.jacobian: Tracks = {}

    def _priced(self, candidate: Candidate) -> Candidate:
        """Of hot spots the data chose the angles."""
        turned = candidate.effect.name == "hot_spot"
        return (
            replace(candidate, selection_penalty=phase_penalty(self._visibility, candidate.members()))
            if turned
            else candidate
        )

    def linearise_at(self, fitter: Fitter, model: Model) -> None:
        """Take the sensitivities at a model, simulated from the fitter's baseline."""
        world = fitter.parameter_set(model.z, model.terms)
        worlds = [column.stepped(world) for column in self._columns]
        steps = [column.step for column in self._columns]
        self.jacobian = finite_difference_jacobian(fitter.simulator, self._frame, model.channels, worlds, steps)

    def at(self, fitter: Fitter, model: Model) -> "CandidateSet":
        """The same candidates, their sensitivities taken at another model."""
        other = copy(self)
        other.linearise_at(fitter, model)
        return other

    def scores(self, fitter: Fitter, sums: InformationBlocks, model: Model, noise: Noise) -> list[ScoreTest]:
        """What each explains beside a model by one step; what does nothing at first, by a replay at full size."""
        accepted = len(model.terms)
        projected = marginalise(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        in_use = {id(term.candidate): term.value for term in model.terms}
        now = [in_use.get(id(candidate), 0.0) for candidate in self.candidates]
        found = scores(self.candidates, projected, accepted, now)
        hidden = [item for item in found if has_zero_gradient(item)]
        shown = thread_map(lambda item: line_search(fitter, model, noise, item), hidden)
        met = dict(zip(map(id, hidden), shown, strict=True))
        return [met.get(id(item), item) for item in found]

    def scores_and_information(
        self, fitter: Fitter, found: Diagnosis, model: Model, noise: Noise
    ) -> tuple[list[ScoreTest], InformationBlocks, Fitter]:
        """What each explains beside a model by one step, and the products that tell it; the fitter with the baseline
        they are simulated from."""
        if model.terms:
            sums = fitter.information_blocks(model, self.jacobian, noise)
            fitter = fitter.at_baseline(model)
            return self.scores(fitter, sums, model, noise), sums, fitter
        assert found.information is not None  # screened before any cause is looked for
        return found.scores, found.information, fitter

    def shortlist(
        self, fitter: Fitter, listed: list[ScoreTest], sums: InformationBlocks, model: Model, bent: bool
    ) -> list[ScoreTest]:
        """Those that explain most by one step and are not in the model yet; of all places, where numbers are bent."""
        held, starts = fitter.at_bounds(model.z), self._starts
        listed = scan_onset_by_segment(
            listed, sums, len(model.terms), model.z, held, starts, onset_penalty(self._frame)
        )
        used = {candidate_key(term.candidate) for term in model.terms}
        listed = [item for item in listed if candidate_key(item.candidate) not in used]
        best = shortlist(listed, _PLAUSIBLE)
        if bent:  # and which place is first is bent too
            best = list(dict.fromkeys([*sorted(listed, key=lambda s: -s.log_bayes_factor)[:_PLAUSIBLE], *best]))
        return best

    def scores_given(self, fitter: Fitter, model: Model, noise: Noise) -> list[ScoreTest]:
        """What all other effects explain beside those of a model, by one step."""
        sums, accepted = fitter.information_blocks(model, self.jacobian, noise), len(model.terms)
        projected = marginalise(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        used = {candidate_key(term.candidate)[:2] for term in model.terms}
        listed = scores(self.candidates, projected, accepted, [0.0] * len(self.candidates))
        return [item for item in listed if candidate_key(item.candidate)[:2] not in used]

    def scores_from_onset(self, fitter: Fitter, model: Model, noise: Noise, moment: OnsetTime) -> list[ScoreTest]:
        """What each explains that begins in the manoeuvre of that moment, or in the next one."""
        sums, accepted = fitter.information_blocks(model, self.jacobian, noise), len(model.terms)
        columns = [[accepted + k for k in candidate.columns] for candidate in self.candidates]
        b, q = marginalise_from_onset(sums, columns, range(accepted), model.z, fitter.at_bounds(model.z))
        starts = self._starts
        first = max(k for k, start in enumerate(starts) if start <= moment)
        found = []
        for k, candidate in enumerate(self.candidates):
            blocks = range(first, min(first + 2, len(starts)))
            looks = [score(candidate, float(b[block, k]), float(q[block, k])) for block in blocks]
            found.append(max(looks, key=lambda look: look.log_bayes_factor))
        return found


def unexcited_sensors(shown: Tracks, noise: Noise) -> list[str]:
    """Nodes of what drives the car whose channels ``shown``, simulated, are less than the noise of one sample.

    Their noise drives the simulated car, a little; a scale that takes it away says nothing of the sensor (regression
    dilution, Fuller 1987, Measurement Error Models, section 1.1: half of what is told is noise).
    """

    def tells(node: str) -> bool:
        tracks = [name for name in shown if name.startswith(f"{node}.")]
        return any(np.mean(np.square(shown[name])) > noise.tracks[name].a ** 2 for name in tracks)

    return [node for node in ("pressure", "motor") if not tells(node)]


def candidate_key(candidate: Candidate) -> tuple[str, str, str]:
    """What tells a candidate from others."""
    return candidate.effect.name, candidate.parameter.name, candidate.location
