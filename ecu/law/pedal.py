"""Pedal travel out of two redundant channels, one of which may say anything."""

import math
from typing import NamedTuple

from ecu.law.base_brake import PedalReading
from ecu.law.debounce import up_down
from ecu.law.types import Inputs
from ecu.parameters.control import SupervisionParameters
from ecu.parameters.plausibility import PlausibilityParameters


class PedalMemory(NamedTuple):
    """State of the pedal's supervision.

    ``travel``: acted on (NaN before the first); ``last``: of each channel; ``suspect``: channel that has jumped away
    from the other and not come back (0: none); ``levels``: of the up-down counters of the channels and of their
    disagreement, s.
    """

    travel: float
    last: tuple[float, float]
    suspect: int
    levels: tuple[float, float, float]


_new = tuple.__new__  # without the Python-made one of a NamedTuple
_NO_LEVELS = (0.0, 0.0, 0.0)
INITIAL = PedalMemory(math.nan, (math.nan, math.nan), 0, _NO_LEVELS)


def read_pedal(
    memory: PedalMemory,
    inputs: Inputs,
    lost: bool,
    s: SupervisionParameters,
    p: PlausibilityParameters,
    dt_s: float,
) -> tuple[PedalMemory, PedalReading]:
    """Travel from two channels: their mean, or what can be believed where they disagree.

    A channel that jumps as no foot moves it while the other goes on is wrong: the other is followed. Where it cannot
    be told, the larger counts, because braking too much is noticed and corrected by the driver and braking too little
    may not be; but what only one channel asks for rises no faster than a quick foot. So a channel that reads less,
    stuck or dead, never releases the brake, and one that reads more never jerks it. The remaining channel is followed
    where the other is lost.

    Parameters
    ----------
    lost : the message that carries both channels has timed out.
    """
    one, two = inputs.pedal_1, inputs.pedal_2
    lost_1 = lost or not math.isfinite(one)
    lost_2 = lost or not math.isfinite(two)
    levels = memory.levels
    if lost_1 or lost_2:
        travel = math.nan if lost_1 and lost_2 else two if lost_1 else one
        held = memory.travel if math.isnan(travel) else travel
        memory = PedalMemory(held, (one, two) if not lost else memory.last, 0, _rest(levels, s, p, dt_s))
        return memory, PedalReading(travel, lost_1, lost_2, memory.levels[2] > s.pedal_disagreement_s)
    if abs(one - two) <= s.pedal_disagreement:
        travel = 0.5 * (one + two)
        if levels == _NO_LEVELS:  # mostly
            return _new(PedalMemory, (travel, (one, two), 0, levels)), PedalReading(travel, False, False, False)
        suspect, levels = 0, _rest(levels, s, p, dt_s)
        named = _named(levels, s.pedal_disagreement_s)
        travel = two if named == 1 else one if named == 2 else travel
    else:
        suspect = _suspect(memory, one, two, p.pedal_jump) or _named(levels, s.pedal_disagreement_s)
        travel = _believed(memory.travel, one, two, suspect, p.pedal_rise_1_s * dt_s)
        limit, forget, heal = s.pedal_disagreement_s, p.forget, p.heal_s
        levels = (
            up_down(levels[0], dt_s if suspect == 1 else 0.0, dt_s, limit, forget, heal),
            up_down(levels[1], dt_s if suspect == 2 else 0.0, dt_s, limit, forget, heal),
            up_down(levels[2], dt_s, dt_s, limit, forget, heal),
        )
    limit = s.pedal_disagreement_s
    named = _named(levels, limit)
    wrong = (named == 1, named == 2)
    memory = PedalMemory(travel, (one, two), suspect, levels)
    return memory, PedalReading(travel, False, False, levels[2] > limit, wrong)


def _rest(
    levels: tuple[float, float, float], s: SupervisionParameters, p: PlausibilityParameters, dt_s: float
) -> tuple[float, float, float]:
    """Levels after a sample that speaks for no fault."""
    if levels == _NO_LEVELS:
        return levels
    limit, forget, heal = s.pedal_disagreement_s, p.forget, p.heal_s
    a, b, c = levels
    return (
        up_down(a, 0.0, dt_s, limit, forget, heal),
        up_down(b, 0.0, dt_s, limit, forget, heal),
        up_down(c, 0.0, dt_s, limit, forget, heal),
    )


def _named(levels: tuple[float, float, float], limit: float) -> int:
    """Channel that has been found wrong for long enough, 1 or 2; 0: none. Never both."""
    return 0 if max(levels[0], levels[1]) <= limit else 1 if levels[0] >= levels[1] else 2


def _suspect(memory: PedalMemory, one: float, two: float, jump: float) -> int:
    """Channel that has jumped while the other has not, 1 or 2; 0 where that cannot be told."""
    jumped_1, jumped_2 = abs(one - memory.last[0]) > jump, abs(two - memory.last[1]) > jump
    if memory.suspect == 0:
        if jumped_1 == jumped_2:
            return 0
        # a channel that jumps back to what is acted on is not the one that is wrong
        channel, value = (1, one) if jumped_1 else (2, two)
        return 0 if abs(value - memory.travel) <= jump else channel
    trusted_jumped = jumped_2 if memory.suspect == 1 else jumped_1
    return 0 if trusted_jumped else memory.suspect


def _believed(travel: float, one: float, two: float, suspect: int, rise: float) -> float:
    """Travel to act on where the channels disagree; never below the lower of both."""
    if suspect:
        return two if suspect == 1 else one
    low, high = min(one, two), max(one, two)
    if math.isnan(travel):
        return high
    return max(low, min(high, travel + rise))
