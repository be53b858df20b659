"""One case from its plain values to what was measured: what a worker process does."""

from dataclasses import replace
from functools import lru_cache

from dbc.messages import BrakeMode
from hil.faults.fault import Expected
from hil.validation.fault_campaign.cases import PAIR, Case
from hil.validation.fault_campaign.drive import Trace, drive
from hil.validation.fault_campaign.measure import Measured, forget_brakes, measure, measured, without_car


@lru_cache(maxsize=64)
def twin(seed: int, timeout_s: float | None) -> Trace:
    """The stop without a fault."""
    return drive(seed, (), timeout_s)


def run(case: Case) -> Measured:
    """Drive a case and its twin, and measure."""
    if case.row[0] == PAIR:
        return _pair(case)
    (armed,) = case.faults
    fault = armed.injection()
    return measure(drive(case.seed, [fault], case.timeout_s), twin(case.seed, case.timeout_s), fault)


def _pair(case: Case) -> Measured:
    """Two faults at once beside each alone: the reaction has to be the worse of the two at least."""
    faults = [armed.injection() for armed in case.faults]
    beside = twin(case.seed, case.timeout_s)
    alone = [measure(drive(case.seed, [fault], case.timeout_s), beside, fault) for fault in faults]
    first, second = (fault.expected for fault in faults)
    right = Expected(frozenset(BrakeMode), first.trouble | second.trouble, braking=first.braking or second.braking)
    until_s = max(fault.until_s for fault in faults)
    both = measured(drive(case.seed, faults, case.timeout_s), beside, right, until_s, (), False)
    if any(map(without_car, faults)):
        forget_brakes(both)
    worst = max(one.worst_mode for one in alone)
    if both.worst_mode < worst:
        wrong = f"{BrakeMode(both.worst_mode).name} where one of the two alone leads to {BrakeMode(worst).name}"
        both = replace(both, wrong_modes=(*both.wrong_modes, wrong))
    return both
