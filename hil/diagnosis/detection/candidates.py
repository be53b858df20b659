"""The field of a race: what every candidate shows at a model, how much it explains there, and who is worth a look."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.axle_torques import undriven
from hil.diagnosis.detection.onset import Moment, begins, price
from hil.diagnosis.detection.onset_scan import with_beginnings
from hil.diagnosis.detection.profile_fit import Contest
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import Score, leaders, score, scores
from hil.diagnosis.detection.zero_gradient import replayed, silent
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Tracks
from hil.diagnosis.estimation.information import Sums, project, project_later, track_columns
from hil.diagnosis.estimation.terms import Candidate, candidates, columns
from hil.diagnosis.noise.model import Frame, Noise
from hil.diagnosis.simulation.hot_spots import price_of_angles
from hil.diagnosis.simulation.simulator import Rig

_PLAUSIBLE = 12


class Field:
    """All candidates of a case; ``tracks`` are their sensitivities where they were last taken.

    Nodes that are ``quiet`` tell nothing but noise (`quiet_nodes`).
    """

    def __init__(self, rig: Rig, frame: Frame, untold: Sequence[str], quiet: Sequence[str] = ()) -> None:
        self._rig, self._frame = rig, frame
        self._columns = columns(untold)
        without = undriven(drive.log for drive in rig.case.drives)
        listed = candidates(self._columns, without, rig.vehicle.sprung, quiet)
        self.candidates = [self._priced(one) for one in listed]
        self.tracks: Tracks = {}

    def _priced(self, candidate: Candidate) -> Candidate:
        """Of hot spots the data chose the angles."""
        turned = candidate.effect.name == "hot_spot"
        return replace(candidate, price=price_of_angles(self._rig.shown, candidate.members())) if turned else candidate

    def taken_at(self, fitter: Fitter, model: Model) -> None:
        """Take the sensitivities at a model."""
        world = fitter.world(model.z, model.terms)
        self._rig.keep(world)
        worlds = [column.stepped(world) for column in self._columns]
        steps = [column.step for column in self._columns]
        self.tracks = track_columns(self._rig, self._frame, model.stack, worlds, steps)

    def at(self, fitter: Fitter, model: Model) -> "Field":
        """The same candidates, their sensitivities taken at another model."""
        other = copy(self)
        other.taken_at(fitter, model)
        return other

    def scores(self, fitter: Fitter, sums: Sums, model: Model, noise: Noise) -> list[Score]:
        """What each explains beside a model by one step; what does nothing at first, by a replay at full size."""
        accepted = len(model.terms)
        projected = project(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_their_end(model.z))
        in_use = {id(term.candidate): term.value for term in model.terms}
        now = [in_use.get(id(candidate), 0.0) for candidate in self.candidates]
        found = scores(self.candidates, projected, accepted, now)
        self._rig.keep(fitter.world(model.z, model.terms))
        hidden = [item for item in found if silent(item)]
        shown = Contest.at_once(lambda item: replayed(fitter, model, noise, item), hidden)
        met = dict(zip(map(id, hidden), shown, strict=True))
        return [met.get(id(item), item) for item in found]

    def seen(self, fitter: Fitter, found: Diagnosis, model: Model, noise: Noise) -> tuple[list[Score], Sums]:
        """What each explains beside a model by one step, and the products that tell it."""
        if model.terms:
            sums = fitter.screen(model, self.tracks, noise)
            return self.scores(fitter, sums, model, noise), sums
        assert found.sums is not None  # screened before any cause is looked for
        return found.screened, found.sums

    def plausible(self, fitter: Fitter, listed: list[Score], sums: Sums, model: Model, bent: bool) -> list[Score]:
        """Those that explain most by one step and are not in the model yet; of all places, where numbers are bent."""
        held, starts = fitter.at_their_end(model.z), begins(self._rig.case)
        listed = with_beginnings(listed, sums, len(model.terms), model.z, held, starts, price(self._frame))
        used = {number_of(term.candidate) for term in model.terms}
        listed = [item for item in listed if number_of(item.candidate) not in used]
        best = leaders(listed, _PLAUSIBLE)
        if bent:  # and which place is first is bent too
            best = list(dict.fromkeys([*sorted(listed, key=lambda s: -s.evidence)[:_PLAUSIBLE], *best]))
        return best

    def beside(self, fitter: Fitter, model: Model, noise: Noise) -> list[Score]:
        """What all other effects explain beside those of a model, by one step."""
        sums, accepted = fitter.screen(model, self.tracks, noise), len(model.terms)
        projected = project(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_their_end(model.z))
        used = {number_of(term.candidate)[:2] for term in model.terms}
        listed = scores(self.candidates, projected, accepted, [0.0] * len(self.candidates))
        return [item for item in listed if number_of(item.candidate)[:2] not in used]

    def begun_at(self, fitter: Fitter, model: Model, noise: Noise, moment: Moment) -> list[Score]:
        """What each explains that begins in the manoeuvre of that moment, or in the next one."""
        sums, accepted = fitter.screen(model, self.tracks, noise), len(model.terms)
        columns = [[accepted + k for k in candidate.columns] for candidate in self.candidates]
        b, q = project_later(sums, columns, range(accepted), model.z, fitter.at_their_end(model.z))
        starts = begins(self._rig.case)
        first = max(k for k, start in enumerate(starts) if start <= moment)
        found = []
        for k, candidate in enumerate(self.candidates):
            blocks = range(first, min(first + 2, len(starts)))
            looks = [score(candidate, float(b[block, k]), float(q[block, k])) for block in blocks]
            found.append(max(looks, key=lambda look: look.evidence))
        return found


def quiet_nodes(shown: Tracks, noise: Noise) -> list[str]:
    """Nodes of what drives the car whose channels ``shown``, simulated, are less than the noise of one sample.

    Their noise drives the simulated car, a little; a scale that takes it away says nothing of the sensor (regression
    dilution, Fuller 1987, Measurement Error Models, section 1.1: half of what is told is noise).
    """

    def tells(node: str) -> bool:
        tracks = [name for name in shown if name.startswith(f"{node}.")]
        return any(np.mean(np.square(shown[name])) > noise.tracks[name].a ** 2 for name in tracks)

    return [node for node in ("pressure", "motor") if not tells(node)]


def number_of(candidate: Candidate) -> tuple[str, str, str]:
    """What tells a candidate from others."""
    return candidate.effect.name, candidate.parameter.name, candidate.place
