"""Debounce with a memory: evidence counts up, its absence slowly down, so that an intermittent fault adds up."""

from ecu.law.compiled import helper


def up_down(level_s: float, evidence_s: float, dt_s: float, limit_s: float, forget: float, heal_s: float) -> float:
    """Level of an up-down counter after one more sample, s; what it counts is a fault where it exceeds ``limit_s``.

    Parameters
    ----------
    level_s : of the last sample.  evidence_s : time by which this sample speaks for the fault, 0 where it does not.
    dt_s : time since the last sample.  limit_s : evidence that makes a fault.
    forget : share of the time without evidence that is taken off again.
    heal_s : time without any evidence after which a fault is none; half its evidence is kept then.
    """
    if level_s > limit_s:
        level_s = limit_s + heal_s if evidence_s > 0.0 else level_s - dt_s
        return level_s if level_s > limit_s else 0.5 * limit_s
    if evidence_s > 0.0:
        level_s += evidence_s
        return limit_s + heal_s if level_s > 0.999 * limit_s else level_s
    return max(level_s - forget * dt_s, 0.0)


compiled_up_down = helper(up_down)
