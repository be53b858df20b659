"""Every constant that decides whether a cause is tested, accepted, named or shown as a rival; and the threshold itself.

Each states what it is, its unit, where it comes from (in brackets: page of ``docs/decisions``, section) and what moves
when it is changed. "No unit" is left out. A change here changes answers: the records in ``tests/pinned`` are made anew
and the blind trials (``brakebench trials``) measured again.

Constants of lower rooms that decide, too: `BIASED_BIRGE_RATIO` (1.5, `hil.diagnosis.estimation.gauss_newton`: from that
Birge ratio on the nuisance parameters may be biased, hypotheses are refitted from the nominal vehicle and ten are
shortlisted), ``UNMEASURED_RATIO``, ``UNSURE`` and ``FEW`` beside ``model_discrepancy.toml``
(`hil.diagnosis.estimation.model_discrepancy`: what divides a gain), ``PRIOR_SD_IN_TYPICAL_SIZES``
(`hil.diagnosis.estimation.terms`: prior sd of a candidate), ``FORM_SD_SHARE`` (`hil.diagnosis.estimation.uncertainty`:
sd of a value by the form of its equation, in the Occam factor of a shape), ``HUBER``
(`hil.diagnosis.noise.innovations`) and the prior sds and bounds of the nuisance parameters
(`hil.diagnosis.vehicle.priors`). ``BASIS_SIZE`` (`hil.diagnosis.detection.nonparametric`) is the degrees of freedom of
a nonparametric term's threshold. The comparison of sensors has its own page,
`hil.diagnosis.sensor_consistency.threshold`.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

# --- score test: how many tests, and what absent candidates seem to explain

FALSE_ALARM_PROBABILITY = 1e-3
"""Probability that noise alone makes one set of logs name a cause, were the tails of the gains normal
[detection-threshold, Gain]. Measured: about 1 in 300. Smaller: fewer false alarms, causes below SNR 8 stay unnamed."""
TESTS_PER_PARAMETER = 1.5
"""Independent tests that one effect parameter counts for, over all its locations [detection-threshold, Gain]. Larger:
threshold up by about 2 ln of the ratio."""
MIN_SNR_OF_A_TEST = 1.0
"""Standard deviations that the largest allowed value must make for a candidate to count as a test [detection-threshold,
Gain]. Larger: fewer tests, a lower threshold."""
MIN_SNR = 3.0
"""Standard deviations that the largest allowed value must make for a candidate to be testable and to take part in the
inflation factor [detection-threshold, Gain]. Larger: more effects are listed as undetectable."""
MAX_TYPICAL_SIZES = 3.0
"""Typical sizes up to which an effect's bound counts in `MIN_SNR`: one that only a monstrous value would show is
undetectable. Larger: fewer undetectable effects."""
MEDIAN_CHI2 = 0.455
"""Median of chi-squared with one degree of freedom: what half of all absent candidates gain by noise
(genomic control, Devlin and Roeder 1999) [detection-threshold, Error of the model for these logs]. A mathematical
constant."""
MAX_INFLATION = 6.0
"""Largest inflation factor [as above]. Larger: in logs that the model fits badly nothing is named any more."""
REFINED_INFLATION = 1.5
"""Inflation factor beyond which it is measured again given the best candidate as fitted [as above]. Larger: a true
cause that biased the nuisance parameters raises its own threshold."""
ZERO_GRADIENT_SNR = 0.1
"""Standard deviations of the largest value, by the gradient, below which a candidate acts behind a limit and is
simulated at full size [search-for-causes, Order of the search]. Larger: more replays, no other answers."""

# --- shortlist: which candidates are fitted

SCORED_WITH_OWN_NOISE = 12
"""Best candidates by score that are scored again with the noise that remains given each [search-for-causes, Order of
the search]. Fewer: slow causes, which the noise model takes for noise, are missed."""
SHORTLIST_SIZE = 5
"""Best candidates, one for each effect parameter, that are fitted at least [as above]. Fewer: rivals are missed."""
BIASED_SHORTLIST_SIZE = 10
"""Best candidates of all locations that are fitted where the nuisance parameters may be biased [search-for-causes,
Nuisance parameters that absorb a cause]. Fewer: causes that nuisances absorbed are missed."""
SHORTLIST_MIN_GAIN = 4.0
"""Gain in chi-squared by one linear step (two sd) below which no candidate is shortlisted. Larger: fewer fits."""
SHORTLIST_LOG_BAYES_RANGE = 6.0
"""Log Bayes factor behind the best within which its other locations are shortlisted, too. Larger: more locations."""
HOPELESS_SHARE, POOR_SHARE = 0.1, 0.4
"""Shares of the detection threshold by one linear step: below the first no candidate is scored with its own noise,
below the second one is fitted only as a rival of a significant cause [search-for-causes, Order of the search]. Of 62
fits five gain 1.4 to 1.8 times the step. Larger: faster, causes with a curved cost are missed."""

# --- fits from the nominal vehicle, restart, location

NEAR_SHARE = 0.2
"""Share of what the best explains, by one step or fitted, from which a hypothesis is also fitted from the nominal
vehicle, and other locations of the best are fitted [search-for-causes, Nuisance parameters that absorb a cause].
Larger: faster, causes that nuisance parameters absorbed are missed."""
RESTART_SHARE = 1.0 / 3.0
"""Share of the best cause's gain by which the fit without a cause must improve for the selection to restart from it
[as above]. Smaller: more restarts (each costs a screening), at most one in all."""
RELINEARISED_RIVALS = 3
"""Best hypotheses, fitted from the nominal vehicle, that get Jacobians of their own [as above]. More: slower."""
CHANGES_WITH_ALL_FREE = 3
"""Best changes since reference logs, fitted with the car held as these show it, that are then fitted with all free
[reference-logs, A change first, then the rest]. More: slower."""
RIVAL_SHARE, AS_GOOD_SHARE = 1.0 / 3.0, 0.9
"""Shares of the best one's improvement of the criterion: below the first a fit from the nominal vehicle is not
continued, below the second an unbiased hypothesis gets no new Jacobian [as above]. Smaller: slower, more rivals."""
OVERTAKING_CRITERION = 25.0
"""Criterion behind the best beyond which new Jacobians are not tried; they gave 0.4 to 20 [as above]. Larger:
slower."""
FIRST_REFITTED = 2
"""Best hypotheses that are refitted before the others, which stop early by what those reached. No answer moves but by
`RIVAL_SHARE`."""

# --- significance: when a cause is accepted and stays

MAX_CAUSES = 3
"""Causes that one set of logs may name at most [search-for-causes, Order of the search]. More: what two models of one
car do not share is named after the third."""
STRUCTURE_MISMATCH = 4.0
"""Variance inflation by the nuisance parameters beyond which the measured car has another structure than the model:
the local discrepancy counts instead, and a value at its bound is not significant [detection-threshold, Error of the
model for these logs]. Reference car: 0.6 to 1.3; six-number cars: 5 to 36. At 1.5, three of 15 foreign nulls fail."""
AMPLITUDE_ALPHA = 0.05
"""Probability that noise takes any of all values as many of its own standard deviations from zero as a cause needs
(3.5 to 3.6) [detection-threshold, Other conditions]. Smaller: fewer false alarms that few manoeuvres make; at 0.05 it
costs one right name of 52 at SNR 15."""
FORM_ERROR, FORM_ERROR_SAME_POINT = 0.2, 0.35
"""Share of an accepted cause's amplitude that its equation may get wrong, elsewhere and at its own injection points: a
further cause must exceed it [detection-threshold, Other conditions]. Larger: second causes are missed; smaller: the
form of the first is named as a second."""

# --- onset

ONSET_ALPHA = 3e-4
"""Probability that noise makes an ever-present cause begin late, over all segments and times [onset-and-nonparametric-
terms, Onset]. Larger: false onsets."""
MIN_SNR_BEFORE_ONSET = 3.0
"""Standard deviations that a cause would have made before its onset, had it been there, and makes after it without the
best recording [as above]. Smaller: onsets that few data show."""
ONSET_STEP_S = 0.25
"""Step of the onset times offered, s; the penalty of an onset is twice the log of their number, about 13 [as above].
Larger: a smaller penalty, the narrow valley of an abrupt onset is missed."""
ONSETS_OF_BEST = 2
"""Best hypotheses whose onset is estimated before they are compared [as above]. More: slower."""
SAME_ONSET_ALTERNATIVES = 8
"""Other candidates that are fitted from the best one's onset on [as above]. Fewer: rivals are missed."""
INDISTINGUISHABLE = 9.2
"""Difference of the criterion (-2 log Bayes factor; 100 to 1) within which hypotheses are rivals, and by which a better
one that is not significant must lead to be let in as an error [isolability-and-intervals, Isolability group; detection-
threshold, Other conditions]. Larger: more rivals are shown."""
SAME_ONSET_CRITERION = 4.0 * INDISTINGUISHABLE
"""Criterion behind the best within which such an alternative gets an onset of its own [as above]. Larger: slower."""

# --- nonparametric terms and shapes

NONPARAMETRIC_MARGIN = 5.0
"""Log Bayes factor (150 to 1) by which a nonparametric term must lead the best listed cause [onset-and-nonparametric-
terms, Nonparametric terms]. Smaller: five coefficients take the name of a listed effect."""
NONPARAMETRIC_WITH_OWN_NOISE, NONPARAMETRIC_REFITTED = 4, 2
"""Best nonparametric terms that are scored with their own noise; and fitted from the nominal vehicle, where nuisance
parameters may be biased [as above]. Fewer: faster, a term that noise hid is missed."""
SHAPE_MIN_SHARE = 0.5
"""Share of a nonparametric term's gain that a listed effect of another shape must explain by one shape to be fitted
[onset-and-nonparametric-terms, Shape parameters]. Larger: faster, curves stay without an effect's name."""

# --- verdict

ISOLABILITY_SIGMA = 2.0
"""Standard deviations of a signature that must remain after its best imitation for a cause to be isolable [isolability-
and-intervals, Isolability group]. Larger: more answers are ``cannot_tell_apart``."""
DISTINCT = 4.6
"""Difference of the criterion (10 to 1) below which a rival of another name makes the answer ``cannot_tell_apart`` [as
above]. Larger: fewer single names."""
UNDETECTABLE_SHARE = 0.5
"""Share of the effects that these manoeuvres would not show, beyond which finding no cause is ``not_testable``.
Smaller: fewer answers ``none``."""


def chi2_quantile(number_of_tests: int, alpha: float, degrees_of_freedom: int = 1) -> float:
    """Gain in chi-squared that noise exceeds with probability ``alpha`` in any of so many tests (Holm's first step)."""
    return float(chi2.isf(alpha / max(number_of_tests, 1), degrees_of_freedom))


@dataclass(frozen=True)
class DetectionThreshold:
    """What a cause must gain in one set of logs.

    Attributes
    ----------
    number_of_tests : independent tests.
    alpha : false-alarm probability of the set.
    inflation : how much more than noise absent candidates explain, 1 to `MAX_INFLATION`; infinite until it is measured.
    """

    number_of_tests: int = 0
    alpha: float = FALSE_ALARM_PROBABILITY
    inflation: float = np.inf

    @property
    def gain(self) -> float:
        """Gain in chi-squared."""
        return chi2_quantile(self.number_of_tests, self.alpha) * self.inflation

    @property
    def uninflated_gain(self) -> float:
        """The least that `gain` can become, given the best candidate as fitted."""
        return self.gain / self.inflation

    @property
    def amplitude(self) -> float:
        """Standard deviations from zero that a value needs."""
        return float(np.sqrt(chi2_quantile(self.number_of_tests, AMPLITUDE_ALPHA)))

    def lowered(self, inflation: float) -> "DetectionThreshold":
        """With an inflation measured given more causes: a cause to come shows through others, so the least counts."""
        return replace(self, inflation=min(self.inflation, inflation))
