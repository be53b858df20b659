"""The budgets, where each comes from, and what physics and the design leave of them.

What no controller could keep is no miss of the controller: it is told apart, with the bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dbc.messages import BrakeMode
from dbc.reception import FORGOTTEN_IN, MOST_LATE_CYCLES
from ecu.parameters.ecu import EcuParameters
from hil.faults.bus import DETECT_MS, MOTOR_ZERO_MS
from hil.faults.fault import Injection
from hil.validation.fault_campaign.drive import TICK_S
from hil.validation.fault_campaign.measure import SHORTFALL_MPS2, TAKEN, Measured
from hil.validation.fault_campaign.rules import is_seen, of_demands, on_their_own
from plant.demands import DEMAND_TIMEOUT_NS

FRICTION_BACK_MS = 150.0
DIP_REPORTED_MS, DIP_SILENT_MS = 100.0, 150.0
SHARE_OF_LONG_FLIPS = 0.006  # exact for CRC 0x1D over 64 bits: 0.475 % at 3 bits, about 0.39 % above
FOREIGN_BEFORE_FOUND = 3  # frames of a second sender taken before it can be found (foreign_frames_to_downgrade)
FOREIGN_AT_ACTUATOR = 15  # cycles until an actuator that does other than asked is found (budget of the silent motor)
_STANDS_MS = 300.0
_CYCLE_MS = 1e3 * TICK_S
_TOLD_MS = DEMAND_TIMEOUT_NS * 1e-6 + _CYCLE_MS  # when an actuator first shows that it lost its demand

ORIGINS = {
    "detect": f"{DETECT_MS:g} ms after the last valid frame (design); else what the fault library states for the fault",
    "motor_zero": f"no torque demand on the wire {MOTOR_ZERO_MS:g} ms after the last valid frame (design)",
    "friction_back": f"friction gives {TAKEN:.0%} of the lost regeneration {FRICTION_BACK_MS:g} ms after detection "
    "(design)",
    "dip": f"deceleration more than {SHORTFALL_MPS2:g} m/s2 below that without the fault for {DIP_REPORTED_MS:g} ms "
    f"where the motor reports its failure, {DIP_SILENT_MS:g} ms where it falls silent (design)",
    "release": f"less than half of the braking due for {DIP_SILENT_MS:g} ms at most: losing a demand never releases "
    "the brake (design)",
    "recovery": "ten valid frames, a second for each mode (design), the healing times of the trouble codes found, and "
    "2.5 s until the lateness of a foreign frame that was taken is forgotten",
    "stale_used": "1 or 2 bits turned: never; 3 to 16: 0.6 % (exact for the check value); old frames: never; of a "
    f"second sender: {FOREIGN_BEFORE_FOUND} until it is found, {FOREIGN_AT_ACTUATOR} where an actuator takes them",
    "wrong_code": "no trouble code of another part, no mode beside those of the fault library; of two faults the worse "
    "reaction",
    "exceptions": "none",
}
"""Each budget in words, with its origin."""

STANDS = "the car stands within 0.3 s"
GONE = "the brake's own pressure is gone: nobody else can give it"
WORN = "the pads give a part of what their pressure stands for: known only from how the wheels slow down"
LATE_ACTUATOR = f"the actuator itself shows nothing before {_TOLD_MS:g} ms (its own time-out and a cycle)"
NO_FASTER = "a brake that is asked for exactly what is lost is no faster (6 Hz, 20 ms dead time)"
JOLT = "a jolt of the road moves the sensor alike: only what lasts is a fault (acceleration_s of evidence)"
HELD = "without a valid pedal the last demand is held 200 ms (design), and the foot moves on"
OWN_MAP = "the actuators hear no controller: the brake's own pedal map knows neither pads nor driving resistances"
FITS = "the first wrong counter may fit the sequence: found a cycle later"
ALIAS = "the old frames fit counter and time: a shift by 15 frames cannot be seen by a counter 0 to 14"


@dataclass(frozen=True, slots=True)
class Miss:
    """A budget that a run did not keep.

    Attributes
    ----------
    budget : a key of `ORIGINS`.
    value, limit : ms, or frames.
    bound : why no controller could; empty where one could.
    text : what happened, where numbers do not say it.
    bound_ms : what the best controller would need, where that is a time.
    """

    budget: str
    value: float
    limit: float
    bound: str = ""
    text: str = ""
    bound_ms: float = math.nan


def judge(m: Measured, faults: Sequence[Injection], ecu: EcuParameters) -> list[Miss]:
    """Misses of one run, those that physics forces included; of a pair without the times of a single fault."""
    misses = []
    if m.error:
        misses.append(Miss("exceptions", 1.0, 0.0, text=m.error))
    if m.wrong_faults or m.wrong_modes:
        named = [f"reports {m.wrong_faults.name}"] if m.wrong_faults else []
        misses.append(Miss("wrong_code", 1.0, 0.0, text="; ".join([*named, *m.wrong_modes])))
    times = [
        Miss("release", m.release_ms, DIP_SILENT_MS, _released(m, faults, ecu)),
        Miss("recovery", m.recovery_ms, recovery_ms(m, ecu)),
    ]
    if len(faults) == 1:
        misses += _stale(m, faults[0])
        times += _times(m, faults[0], ecu)
    for miss in times:
        if miss.value > miss.limit + 1e-6:  # false where there is nothing to measure
            stands = 1e3 * m.left_s < min(miss.value, _STANDS_MS) and miss.budget != "recovery"
            misses.append(replace(miss, bound=STANDS if stands else miss.bound))
    return misses


def recovery_ms(m: Measured, ecu: EcuParameters) -> float:
    """Budget of the return to the mode without the fault."""
    s, healing_s = ecu.supervision, 0.0
    for text in m.healing:
        if "{communication_healing_s}" in text:
            healing_s = max(healing_s, s.communication_healing_s)
        elif "{heal_s}" in text:
            healing_s = max(healing_s, ecu.plausibility.heal_s)
    if any(code.endswith(("_second_sender", "_out_of_time")) for code in m.codes):
        # a foreign frame that was taken for a late one has to be forgotten before the own ones fit again
        healing_s = max(healing_s, s.communication_healing_s + 1e-3 * _CYCLE_MS * MOST_LATE_CYCLES * FORGOTTEN_IN)
    modes = max(m.worst_mode - int(BrakeMode.NORMAL), 0)
    return 1e3 * (healing_s + modes * s.upgrade_interval_s) + (s.frames_to_upgrade + 1) * _CYCLE_MS


def _stale(m: Measured, fault: Injection) -> list[Miss]:
    limit = 0.0
    if fault.kind.name in ("second_sender", "answering_sender", "id_space"):
        limit = FOREIGN_AT_ACTUATOR if of_demands(fault) else FOREIGN_BEFORE_FOUND
    elif fault.kind.name == "bits_flipped" and fault.number("bits") > 2.0:
        # a share over many frames: of one run no more than three times its mean and three
        limit = 3.0 + 3.0 * SHARE_OF_LONG_FLIPS * m.altered
    return [Miss("stale_used", m.stale_used, limit)] if m.stale_used > limit else []


def _released(m: Measured, faults: Sequence[Injection], ecu: EcuParameters) -> str:
    """Why braking is lost whatever the controller does; empty where it is not."""
    if any(fault.kind.name == "pad_friction" for fault in faults):
        return WORN
    if any(fault.expected.braking and fault.kind.family == "physical" for fault in faults):
        return GONE
    if m.stale_in_all and any(fault.kind.name == "replayed" for fault in faults):
        return ALIAS
    return _held(m, m.release_ms, ecu)


def _held(m: Measured, value_ms: float, ecu: EcuParameters) -> str:
    """Whether a time follows from holding the last demand while the pedal moves on, without a valid pedal."""
    hold_ms = 1e3 * ecu.supervision.demand_hold_s
    if m.worst_mode == BrakeMode.SAFE_STOP and value_ms <= hold_ms + FRICTION_BACK_MS:
        return HELD
    return ""


def _times(m: Measured, fault: Injection, ecu: EcuParameters) -> list[Miss]:
    right = fault.expected
    found = []
    if right.detect_ms is not None and is_seen(m, fault):
        limit_ms = right.detect_ms
        if fault.kind.family == "link" and fault.target.name == "PLANT":
            limit_ms = max(limit_ms, DETECT_MS)  # who is off the bus knows at once, the others find its silence
        value = math.inf if math.isnan(m.detect_ms) else m.detect_ms
        late = _found_late(fault, value, limit_ms, ecu)
        found.append(Miss("detect", value, limit_ms, late, bound_ms=_TOLD_MS if late == LATE_ACTUATOR else math.nan))
    if right.motor_zero_ms is not None:
        found.append(Miss("motor_zero", m.motor_zero_ms, right.motor_zero_ms))
    bound = _held(m, m.friction_back_ms, ecu)
    if on_their_own(fault):
        bound = OWN_MAP
    elif m.friction_bound_ms + 2.0 * _CYCLE_MS >= m.friction_back_ms:
        bound = NO_FASTER
    if not right.braking or on_their_own(fault):
        bound_ms = m.friction_bound_ms if bound == NO_FASTER else math.nan
        found.append(Miss("friction_back", m.friction_back_ms, FRICTION_BACK_MS, bound, bound_ms=bound_ms))
    if not right.braking:
        limit_ms = DIP_REPORTED_MS if fault.kind.name == "motor_dead" else DIP_SILENT_MS
        found.append(Miss("dip", m.dip_ms, limit_ms, _held(m, m.dip_ms, ecu)))
    return found


def _found_late(fault: Injection, value_ms: float, limit_ms: float, ecu: EcuParameters) -> str:
    """Why it cannot be found in time; from when it shows, the budget holds (of a motor: that of a silent one)."""
    after_ms = DIP_SILENT_MS if fault.target.name.startswith("MOTOR_DEMAND") else limit_ms
    if of_demands(fault) and value_ms <= _TOLD_MS + after_ms:
        return LATE_ACTUATOR
    if fault.target.name.startswith("BODY_MOTION.") and value_ms <= limit_ms + 1e3 * ecu.plausibility.acceleration_s:
        return JOLT
    return FITS if fault.kind.name.startswith("counter_") and value_ms <= limit_ms + _CYCLE_MS else ""
