"""The budgets, where each comes from, and what physics leaves of them.

A time that no controller could keep is no miss of the controller: it is told apart, with the bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from dbc.messages import BrakeMode
from ecu.parameters.control import SupervisionParameters
from ecu.parameters.ecu import EcuParameters
from ecu.parameters.plausibility import PlausibilityParameters
from hil.faults.bus import DETECT_MS, MOTOR_ZERO_MS
from hil.faults.fault import Injection
from hil.validation.fault_campaign.drive import TICK_S
from hil.validation.fault_campaign.measure import FROM_THE_CONTROLLER, LITTLE_NM, SHORTFALL_MPS2, TAKEN, Measured
from plant.demands import DEMAND_TIMEOUT_NS
from plant.hydraulics import pressure_jerk
from plant.parameters.brakes import EhbParameters
from plant.parameters.plant import PlantParameters

FRICTION_BACK_MS = 150.0
DIP_REPORTED_MS, DIP_SILENT_MS = 100.0, 150.0
SHARE_OF_LONG_FLIPS = 0.006  # exact for CRC 0x1D over 64 bits: 0.475 % at 3 bits, about 0.39 % above
FOREIGN_BEFORE_FOUND = (
    3  # frames of a second sender that are taken before it can be found (foreign_frames_to_downgrade)
)
FOREIGN_AT_ACTUATOR = 15  # cycles until an actuator that does other than asked is found (budget of the silent motor)
NO_DIP_MPS2 = 0.3
ORIGINS = {
    "detect": f"{DETECT_MS:g} ms after the last valid frame (design); else what the fault library states for the fault",
    "motor_zero": f"no torque demand on the wire {MOTOR_ZERO_MS:g} ms after the last valid frame (design)",
    "friction_back": f"friction gives {TAKEN:.0%} of the lost regeneration {FRICTION_BACK_MS:g} ms after detection "
    "(design)",
    "dip": f"deceleration more than {SHORTFALL_MPS2:g} m/s2 below that without the fault for {DIP_REPORTED_MS:g} ms "
    f"where the motor reports its failure, {DIP_SILENT_MS:g} ms where it falls silent (design)",
    "recovery": "ten valid frames, a second for each mode, and the healing of the trouble codes found (design, list of "
    "trouble codes)",
    "stale_used": "1 or 2 bits turned: never; 3 to 16: 0.6 % (exact for the check value); old frames: never; of a "
    "second sender: three until it is found",
    "release": f"less than half of the braking due for {DIP_SILENT_MS:g} ms at most: losing a demand never releases the "
    "brake (design)",
    "wrong_code": "no trouble code of another part, no mode beside those of the fault library",
    "exceptions": "none",
}
"""Each budget in words, with its origin."""


@dataclass(frozen=True, slots=True)
class Miss:
    """A budget that a run did not keep.

    Attributes
    ----------
    budget : a key of `ORIGINS`.
    value, limit : of the unit that the budget has (ms; frames).
    bound : why no controller could; empty where one could.
    text : what happened, where numbers do not say it.
    """

    budget: str
    value: float
    limit: float
    bound: str = ""
    text: str = ""


@cache
def rise_s(share: float, step_pa: float, ehb: EhbParameters) -> float:
    """Time from a step of the demand at the brake to a share of it in the pads, s, at best.

    Dead time, second order and limited rate of the brake: no controller is faster without asking for too much.
    """
    dt_s = 1e-4
    pressure = rate = 0.0
    time_s = ehb.dead_time_s
    while pressure < share * step_pa and time_s < 2.0:
        jerk = pressure_jerk(
            step_pa, pressure, rate, ehb.natural_frequency_hz, ehb.damping_ratio, ehb.build_rate_pa_s,
            ehb.release_rate_pa_s,
        )  # fmt: skip
        rate = min(rate + jerk * dt_s, ehb.build_rate_pa_s)
        pressure += rate * dt_s
        time_s += dt_s
    return time_s


def step_pa(lost_nm: float, ecu: EcuParameters) -> float:
    """Pressure in all four brakes that gives a torque, Pa, with the nominal pads."""
    brake = ecu.friction_brake
    per_pa = sum(
        4.0 * brake.pad_friction * brake.efficiency * area * radius
        for area, radius in zip(brake.cylinder_area_m2, brake.effective_radius_m, strict=True)
    )
    return lost_nm / per_pa


def judge(m: Measured, faults: Sequence[Injection], plant: PlantParameters, ecu: EcuParameters) -> list[Miss]:
    """Misses of one run, those that physics forces included; of a pair without the times of a single fault."""
    fault = faults[0] if len(faults) == 1 else None
    misses = []
    if m.error:
        misses.append(Miss("exceptions", 1.0, 0.0, text=m.error))
    if m.wrong_faults or m.wrong_modes:
        named = [f"reports {m.wrong_faults.name}"] if m.wrong_faults else []
        misses.append(Miss("wrong_code", 1.0, 0.0, text="; ".join([*named, *m.wrong_modes])))
    misses += _stale(m, fault)
    release = Miss("release", m.release_ms, DIP_SILENT_MS, _forced(faults))
    times = [release, Miss("recovery", m.recovery_ms, recovery_ms(m, ecu.supervision, ecu.plausibility))]
    if fault is not None:
        times += _times(m, fault, plant, ecu)
    for miss in times:
        if miss.value > miss.limit + 1e-6:  # false where there is nothing to measure
            stands = 1e3 * m.left_s < min(miss.value, 300.0) and miss.budget != "recovery"
            misses.append(Miss(miss.budget, miss.value, miss.limit, STANDS if stands else miss.bound))
    return misses


STANDS = "the car stands within 0.3 s"


def _stale(m: Measured, fault: Injection | None) -> list[Miss]:
    if fault is None or not m.stale_used:
        return []
    limit = 0.0
    if fault.kind.name in ("second_sender", "answering_sender", "id_space"):
        ours = fault.target.name in FROM_THE_CONTROLLER
        limit = FOREIGN_AT_ACTUATOR if ours else FOREIGN_BEFORE_FOUND
    elif fault.kind.name == "bits_flipped" and fault.number("bits") > 2.0:
        # a share over many frames: of one run no more than three times its mean and three
        limit = 3.0 + 3.0 * SHARE_OF_LONG_FLIPS * m.altered
    return [Miss("stale_used", m.stale_used, limit)] if m.stale_used > limit else []


def _forced(faults: Sequence[Injection]) -> str:
    """Why braking is lost whatever the controller does; empty where it is not."""
    if any(fault.expected.braking and fault.kind.family == "physical" for fault in faults):
        return "the brake's own pressure is gone: nobody else can give it"
    return ""


def silent_controller(fault: Injection) -> bool:
    """Whether nobody hears the controller: the actuators are on their own."""
    return fault.target.name == "ECU" and fault.kind.family in ("process", "link", "bus")


def _detect_limit_ms(fault: Injection) -> float | None:
    """As the library states; who is off the bus knows at once, the others find its silence."""
    limit_ms = fault.expected.detect_ms
    others = fault.kind.family == "link" and fault.target.name == "PLANT"
    return max(limit_ms, DETECT_MS) if limit_ms is not None and others else limit_ms


def _times(m: Measured, fault: Injection, plant: PlantParameters, ecu: EcuParameters) -> list[Miss]:
    right, name = fault.expected, fault.target.name
    found = []
    late_ms, why = 0.0, ""
    if name in FROM_THE_CONTROLLER and fault.kind.family in ("bus", "protection"):
        late_ms = DEMAND_TIMEOUT_NS * 1e-6 + 1e3 * TICK_S
        why = f"the actuator itself tells nothing before {late_ms:g} ms (its own time-out and a cycle)"
    limit_ms = _detect_limit_ms(fault)
    if limit_ms is not None and is_seen(m, fault):
        value = math.inf if math.isnan(m.detect_ms) else m.detect_ms
        after_ms = DIP_SILENT_MS if name.startswith("MOTOR_DEMAND") else limit_ms
        bound = why if value <= late_ms + after_ms else ""
        if fault.kind.name.startswith("counter_") and value <= limit_ms + 1e3 * TICK_S:
            bound = bound or "the first wrong counter may fit the sequence: found a cycle later"
        found.append(Miss("detect", value, limit_ms, bound))
    if right.motor_zero_ms is not None and is_seen(m, fault):
        found.append(Miss("motor_zero", m.motor_zero_ms, right.motor_zero_ms, why if late_ms else ""))
    lost_pa = step_pa(m.lost_nm, ecu) if m.lost_nm > 0.0 else 0.0
    if lost_pa:
        on_the_way_ms = 1e3 * TICK_S  # a cycle from the controller to the brake's next tick and back to the car's
        bound_ms = on_the_way_ms + 1e3 * rise_s(TAKEN, lost_pa, plant.ehb)
        bound = ""
        if silent_controller(fault):
            bound = "nobody hears the controller: the brake's own pedal map does not know the pads' friction"
        elif bound_ms > FRICTION_BACK_MS and m.friction_back_ms < bound_ms + 30.0:
            bound = f"the brake needs {bound_ms:.0f} ms to {TAKEN:.0%} of {lost_pa * 1e-5:.0f} bar"
        found.append(Miss("friction_back", m.friction_back_ms, FRICTION_BACK_MS, bound))
    if not right.braking:
        limit = DIP_REPORTED_MS if fault.kind.name == "motor_dead" else DIP_SILENT_MS
        found.append(Miss("dip", m.dip_ms, limit))
    return found


def is_seen(m: Measured, fault: Injection) -> bool:
    """Whether there was anything to find: a frame befallen, for longer than the budget, and not without any effect.

    What is sent under the controller's own name it does not hear: it can see what an actuator makes of it.
    """
    limit_s = (fault.expected.detect_ms or 0.0) * 1e-3
    if math.isnan(m.befallen_s) or fault.until_s - m.befallen_s <= limit_s or m.left_s <= limit_s:
        return False
    harmless = not m.stale_used and m.dip_mps2 < NO_DIP_MPS2 and m.lost_nm < LITTLE_NM
    return not (harmless and fault.target.name in FROM_THE_CONTROLLER and fault.kind.family in ("bus", "protection"))


def recovery_ms(m: Measured, s: SupervisionParameters, p: PlausibilityParameters) -> float:
    """Budget of the return to the mode without the fault; infinite for a motor that did not do what it was asked.

    Such a motor is tried again some time after the pedal is released, which is not in this stop.
    """
    healing_s = 0.0
    for name, text in zip(m.codes, m.healing, strict=True):
        if "communication_healing_s" in text:
            healing_s = max(healing_s, s.communication_healing_s)
        elif "plausibility" in text:
            healing_s = max(healing_s, math.inf if name.startswith("motor_") else p.heal_s)
    modes = max(m.worst_mode - int(BrakeMode.NORMAL), 0)
    return 1e3 * (healing_s + (s.frames_to_upgrade + 1) * TICK_S + modes * s.upgrade_interval_s)
