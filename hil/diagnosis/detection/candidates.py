"""The candidates of a dataset: their Jacobian at a model, and what each of them gains there.

Takes the simulator and what the vehicle set states; gives score tests (`hil.diagnosis.detection.score_test`) and the
shortlist of those that are scored again with their own noise.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.axle_torques import undriven
from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.detection.score_test import (
    OnsetTime,
    ScoreTest,
    candidate_key,
    has_zero_gradient,
    line_search,
    onset_penalty,
    scan_onset_by_segment,
    score,
    scores,
    segment_starts,
    shortlist,
)
from hil.diagnosis.detection.threshold import SCORED_WITH_OWN_NOISE
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import (
    InformationBlocks,
    acting_among,
    finite_difference_jacobian,
    marginalise,
    marginalise_from_onset,
    silent_columns,
)
from hil.diagnosis.estimation.model import Model, Tracks
from hil.diagnosis.estimation.model_discrepancy import FORM_SHARE
from hil.diagnosis.estimation.terms import Candidate, candidates, columns
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.progress import Progress
from hil.diagnosis.simulation.hot_spots import phase_penalty
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator

_BACKWARD, _BACKWARD_SAMPLES = {"speed_mps": -0.5, "wheel_speed": -1.5}, 10
"""Speed over ground (m/s) and of a wheel (rad/s) below which a car moves backward, beyond noise at rest; how many
samples of one channel show it."""


def inseparable_forward(dataset: Dataset) -> dict[str, str]:
    """Effects that are the same as another one where no log moves backward, by that other one; empty where one does."""
    backward = any(
        (values < limit).sum() >= _BACKWARD_SAMPLES
        for recording in dataset.recordings
        for stem, limit in _BACKWARD.items()
        for name, values in recording.log.channels.items()
        if name.startswith(stem)
    )
    return {} if backward else {"caliper_asymmetry": "pad_mu_gain"}


class CandidateSet:
    """All candidates of a dataset; ``jacobian`` are the signatures where `linearise_at` was called last.

    Effects that are another one in these logs (`inseparable_forward`) are no candidates, but rivals of that one.

    Parameters
    ----------
    undiagnosable : effects that the vehicle set says too little for.
    unexcited : nodes whose channels carry only noise (`unexcited_sensors`).
    since_reference : candidates are changes since reference logs, which share what the form of the model errs.
    """

    def __init__(
        self, simulator: Simulator, masks: SampleMasks, undiagnosable: Sequence[str], unexcited: Sequence[str] = (),
        *, since_reference: bool = False,
    ) -> None:  # fmt: skip
        self._masks, self._starts = masks, segment_starts(simulator.dataset)
        self._columns = columns((*undiagnosable, *inseparable_forward(simulator.dataset)))
        without = undriven(recording.log for recording in simulator.dataset.recordings)
        vehicle = simulator.vehicle
        form_share = FORM_SHARE if vehicle.unlimited and not since_reference else 0.0
        listed = candidates(self._columns, without, vehicle.suspension_stated, unexcited, form_share)
        self.candidates = [_with_penalty(one, simulator) for one in listed]
        self.jacobian: Tracks = {}

    def linearise_at(self, fitter: Fitter, model: Model, progress: Progress | None = None) -> None:
        """Renew the Jacobian at a model, from the fitter's baseline."""
        base, count = fitter.parameter_set(model.z, model.terms), len(self._columns)

        def stepped(places: Sequence[int]) -> ParameterSet:
            moved = base
            for k in places:
                moved = self._columns[k].stepped(moved)
            return moved

        silent = silent_columns(self.jacobian)
        channels = fitter.channels(model)
        acting = acting_among(fitter.simulator, channels, stepped, silent)
        rest = [k for k in range(count) if k not in silent or k in acting]
        moved, steps = [stepped([k]) for k in rest], [self._columns[k].step for k in rest]
        self.jacobian = finite_difference_jacobian(
            fitter.simulator, self._masks, channels, moved, steps, (rest, count), progress
        )

    def at(self, fitter: Fitter, model: Model, progress: Progress | None = None) -> "CandidateSet":
        """The same candidates with the Jacobian at another model."""
        other = copy(self)
        other.linearise_at(fitter, model, progress)
        return other

    def scores(
        self, fitter: Fitter, blocks: InformationBlocks, model: Model, noise: Noise, search: bool = True
    ) -> list[ScoreTest]:
        """Score test of each candidate given a model, by ``blocks`` of its nuisances, terms and all candidates; without
        ``search`` those behind limits gain nothing."""
        accepted = len(model.terms)
        marginal = marginalise(blocks.total(), blocks.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        values = {id(term.candidate): term.value for term in model.terms}
        tests = scores(
            self.candidates, marginal, accepted, [values.get(id(candidate), 0.0) for candidate in self.candidates]
        )
        behind_limits = [item for item in tests if has_zero_gradient(item)] if search else []
        searched = thread_map(lambda item: line_search(fitter, model, noise, item), behind_limits)
        by_search = dict(zip(map(id, behind_limits), searched, strict=True))
        return [by_search.get(id(item), item) for item in tests]

    def shortlist(
        self, fitter: Fitter, tests: list[ScoreTest], blocks: InformationBlocks, model: Model, biased: bool
    ) -> list[ScoreTest]:
        """The best that are not in the model yet, with an onset where that gains more.

        Where the nuisance parameters may be ``biased``, so is the order of locations, and all locations take part.
        """
        fixed, starts = fitter.at_bounds(model.z), self._starts
        tests = scan_onset_by_segment(
            tests, blocks, len(model.terms), model.z, fixed, starts, onset_penalty(self._masks)
        )
        accepted = {candidate_key(term.candidate) for term in model.terms}
        tests = [item for item in tests if candidate_key(item.candidate) not in accepted]
        best = shortlist(tests, SCORED_WITH_OWN_NOISE)
        if biased:
            by_bayes_factor = sorted(tests, key=lambda s: -s.log_bayes_factor)
            best = list(dict.fromkeys([*by_bayes_factor[:SCORED_WITH_OWN_NOISE], *best]))
        return best

    def scores_given(self, fitter: Fitter, model: Model, noise: Noise) -> list[ScoreTest]:
        """Score test of each effect parameter that is not in a model, given its terms (marginalised)."""
        blocks, accepted = fitter.information_blocks(model, self.jacobian, noise), len(model.terms)
        marginal = marginalise(blocks.total(), blocks.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        used = {candidate_key(term.candidate)[:2] for term in model.terms}
        tests = scores(self.candidates, marginal, accepted, [0.0] * len(self.candidates))
        return [item for item in tests if candidate_key(item.candidate)[:2] not in used]

    def scores_from_onset(self, fitter: Fitter, model: Model, noise: Noise, onset: OnsetTime) -> list[ScoreTest]:
        """Score test of each candidate from the segment of an onset on, or from the next one, whichever is better."""
        blocks, accepted = fitter.information_blocks(model, self.jacobian, noise), len(model.terms)
        columns = [[accepted + k for k in candidate.columns] for candidate in self.candidates]
        b, q = marginalise_from_onset(blocks, columns, range(accepted), model.z, fitter.at_bounds(model.z))
        starts = self._starts
        first = max(k for k, start in enumerate(starts) if start <= onset)
        tests = []
        for k, candidate in enumerate(self.candidates):
            segments = range(first, min(first + 2, len(starts)))
            both = [score(candidate, float(b[segment, k]), float(q[segment, k])) for segment in segments]
            tests.append(max(both, key=lambda item: item.log_bayes_factor))
        return tests


def _with_penalty(candidate: Candidate, simulator: Simulator) -> Candidate:
    """The data chose the phase angles of hot spots."""
    if not candidate.effect.free_phase:
        return candidate
    return replace(candidate, selection_penalty=phase_penalty(simulator.hot_spot_visibility, candidate.members()))


def unexcited_sensors(channels: Tracks, noise: Noise) -> list[str]:
    """Input nodes whose simulated channels stay below the noise of one sample.

    Their noise drives the simulated car a little; a scale that removes it says nothing of the sensor (regression
    dilution, Fuller 1987, Measurement Error Models, section 1.1).
    """

    def excited(node: str) -> bool:
        names = [name for name in channels if name.startswith(f"{node}.")]
        return any(np.mean(np.square(channels[name])) > noise.tracks[name].a ** 2 for name in names)

    return [node for node in ("pressure", "motor") if not excited(node)]
