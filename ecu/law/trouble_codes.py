"""The trouble codes: the closed list of what the controller can find wrong, and the memory of what it has found.

What is active at a tick is a set of codes: an integer with one bit for each row of `CODES`. The worst reaction of the
active codes is the best mode they allow.
"""

from functools import lru_cache
from typing import NamedTuple

from dbc.messages import BrakeMode, Fault
from ecu.law.types import Four, Source


class TroubleCode(NamedTuple):
    """One row of the list.

    ``number``: on the wire; ``reaction``: best mode while it is active; ``debounce``, ``healing``: when it becomes
    active, when it no longer is (``{name}`` stands for a parameter of supervision or plausibility); ``fault``: how it
    shows in BRAKE_STATUS.ACTIVE_FAULTS.
    """

    number: int
    name: str
    text: str
    reaction: BrakeMode
    debounce: str
    healing: str
    fault: Fault


_DEGRADED, _FRICTION, _STOP = BrakeMode.DEGRADED, BrakeMode.FRICTION_ONLY, BrakeMode.SAFE_STOP
_PEDALS = Fault.PEDAL_1 | Fault.PEDAL_2
_WHEEL_SPEEDS = Fault.WHEEL_SPEED_FRONT | Fault.WHEEL_SPEED_REAR
_MOTORS = Fault.MOTOR_FRONT | Fault.MOTOR_REAR
_GONE = "with its cause"
_HEALS = "{heal_s} without evidence"

SOURCES: tuple[tuple[Source, str, str, Fault, BrakeMode], ...] = (
    (Source.PEDAL, "pedal", "BRAKE_PEDAL", _PEDALS, _STOP),
    (Source.WHEEL_SPEED_FRONT, "wheel_speed_front", "WHEEL_SPEED_FRONT", Fault.WHEEL_SPEED_FRONT, _DEGRADED),
    (Source.WHEEL_SPEED_REAR, "wheel_speed_rear", "WHEEL_SPEED_REAR", Fault.WHEEL_SPEED_REAR, _DEGRADED),
    (Source.BODY_MOTION, "body_motion", "BODY_MOTION", Fault.BODY_MOTION, _DEGRADED),
    (Source.EHB_PRESSURE_FRONT, "pressure_front", "EHB_PRESSURE_FRONT", Fault.EHB_PRESSURE_FRONT, _DEGRADED),
    (Source.EHB_PRESSURE_REAR, "pressure_rear", "EHB_PRESSURE_REAR", Fault.EHB_PRESSURE_REAR, _DEGRADED),
    (Source.MOTOR_FRONT, "motor_front", "MOTOR_STATUS_FRONT", Fault.MOTOR_FRONT, _DEGRADED),
    (Source.MOTOR_REAR, "motor_rear", "MOTOR_STATUS_REAR", Fault.MOTOR_REAR, _DEGRADED),
    (Source.STEERING, "steering", "STEERING", Fault.STEERING, _DEGRADED),
    (Source.BATTERY, "battery", "BATTERY_STATUS", Fault.BATTERY, _FRICTION),
)
"""Each source with its name, its message, its fault, and the mode that is left without it."""

WHEELS = (("fl", "front left"), ("fr", "front right"), ("rl", "rear left"), ("rr", "rear right"))


def _of_sources() -> list[TroubleCode]:
    codes = []
    clean = "{communication_healing_s} without any odd frame"
    rate = (
        "{bad_frames_to_downgrade} bad frames in a row, or more than one in four for longer: a bad frame makes up for "
        "{bad_frame_weight} good ones"
    )
    beside = (
        "{foreign_frames_to_downgrade} foreign frames in a row, or more than one in five for longer: one makes up for "
        "{foreign_frame_weight} good ones; more than every second frame doubled"
    )
    for source, name, message, fault, without in SOURCES:
        limit = "battery_timeout_s" if source is Source.BATTERY else "timeout_s"
        alone = _STOP if source is Source.PEDAL else _FRICTION
        odd = fault | Fault.COMMUNICATION
        rows: list[tuple[str, str, BrakeMode, str, str, Fault]] = [
            ("lost", f"{message} does not come", without, f"no usable frame for {{{limit}}}", _GONE, fault),
            ("corrupt", f"{message} often has a wrong check value or old bytes", _FRICTION, rate, clean, odd),
            ("second_sender", f"another one sends {message}, too", alone, beside, clean, odd),
            (
                "out_of_time",
                f"the counter of {message} is not the one that is due: replayed or delayed frames, or it stands still",
                alone,
                "{foreign_frames_to_downgrade} such frames, and none of the stream for the time-out",
                clean,
                odd,
            ),
        ]
        if source is not Source.PEDAL:
            text = f"{message} has a value that is not available"
            rows.append(("not_available", text, without, "none", _GONE, fault))
        for number, (what, text, reaction, debounce, healing, shows) in enumerate(rows, 0x1001 + 0x10 * source):
            codes.append(TroubleCode(number, f"{name}_{what}", text, reaction, debounce, healing, shows))
    return codes


def _of_wheels() -> list[TroubleCode]:
    codes = []
    for i, (wheel, where) in enumerate(WHEELS):
        axle = i // 2
        speed = (Fault.WHEEL_SPEED_FRONT, Fault.WHEEL_SPEED_REAR)[axle]
        pressure = (Fault.EHB_PRESSURE_FRONT, Fault.EHB_PRESSURE_REAR)[axle]
        motor = (Fault.MOTOR_FRONT, Fault.MOTOR_REAR)[axle]
        rows = [
            (
                f"wheel_speed_{wheel}_implausible",
                f"wheel speed {where} does not agree with the others and the car's motion",
                *(_DEGRADED, "{wheel_s} of evidence; a slow wheel 1 s", _HEALS, speed),
            ),
            (
                f"pressure_{wheel}_implausible",
                f"brake pressure {where} does not agree with its demand and the others",
                *(_DEGRADED, "{pressure_s} of evidence", _HEALS, pressure),
            ),
            (
                f"motor_{wheel}_failed",
                f"motor {where} reports its failure, or no state",
                *(_DEGRADED, "none", _GONE, motor),
            ),
            (
                f"motor_{wheel}_torque",
                f"motor {where} reports another torque than demanded, or none",
                *(
                    _DEGRADED,
                    "{motor_s} of evidence",
                    "after {motor_retry_s} of free pedal",
                    motor | Fault.MOTOR_TORQUE,
                ),
            ),
        ]
        codes += [TroubleCode(0x2001 + 0x10 * i + k, *row) for k, row in enumerate(rows)]
    return codes


_OTHERS = [
    TroubleCode(0x3001, "pedal_1_lost", "pedal channel 1 is not available", _DEGRADED, "none", _GONE, Fault.PEDAL_1),
    TroubleCode(0x3002, "pedal_2_lost", "pedal channel 2 is not available", _DEGRADED, "none", _GONE, Fault.PEDAL_2),
    TroubleCode(0x3003, "pedal_1_implausible", "pedal channel 1 moves as no pedal does", _DEGRADED,
                "{pedal_disagreement_s} of evidence", _HEALS, Fault.PEDAL_1),
    TroubleCode(0x3004, "pedal_2_implausible", "pedal channel 2 moves as no pedal does", _DEGRADED,
                "{pedal_disagreement_s} of evidence", _HEALS, Fault.PEDAL_2),
    TroubleCode(0x3005, "pedal_disagree", "the two pedal channels do not agree", _DEGRADED,
                "{pedal_disagreement} of travel apart for {pedal_disagreement_s}", _HEALS, Fault.PEDAL_DISAGREE),
    TroubleCode(0x3006, "pedal_none", "neither pedal channel can be used", _STOP, "none", _GONE, _PEDALS),
    TroubleCode(0x3011, "wheel_speed_both_axles", "wheel speeds of both axles are lost or wrong", _FRICTION, "none",
                _GONE, _WHEEL_SPEEDS),
    TroubleCode(0x3012, "acceleration_implausible", "the acceleration sensor does not agree with the wheels", _DEGRADED,
                "{acceleration_s} of evidence", _HEALS, Fault.BODY_MOTION),
    TroubleCode(0x3021, "brake_front_failed", "the brake reports failure of its front axle", _DEGRADED, "none", _GONE,
                Fault.EHB_PRESSURE_FRONT),
    TroubleCode(0x3022, "brake_rear_failed", "the brake reports failure of its rear axle", _DEGRADED, "none", _GONE,
                Fault.EHB_PRESSURE_REAR),
    TroubleCode(0x3023, "brake_own_map", "the brake follows its own pedal map, or does not say what", _FRICTION,
                "{timeout_s} where it has followed, else {own_map_tolerated_s}; not while it was asked to", _GONE,
                Fault.EHB_OWN_MAP),
    TroubleCode(0x3031, "motors_none", "no motor can be used", _FRICTION, "none", _GONE, _MOTORS),
    TroubleCode(0x3041, "link_down", "the link to the vehicle bus is down (bus-off, unplugged)", _FRICTION, "none",
                "when the link is back", Fault.LINK),
    TroubleCode(0x3042, "own_second_sender", "another one sends messages of the controller, too", _FRICTION,
                "{foreign_frames_to_downgrade} ticks in a row, or more than one in five for longer",
                "no such frame for {communication_healing_s}", Fault.COMMUNICATION),
]  # fmt: skip

CODES: tuple[TroubleCode, ...] = (*_of_sources(), *_of_wheels(), *_OTHERS)
"""All of them, in the order of their bits."""

BIT = {code.name: 1 << i for i, code in enumerate(CODES)}
"""Bit of each code in a set of codes, by name."""


def bits(form: str) -> tuple[int, ...]:
    """Bits of the codes of all sources, or all wheels: ``{}`` in ``form`` stands for their name; 0 where none is."""
    names = [wheel for wheel, _ in WHEELS] if form.format("fl") in BIT else [source[1] for source in SOURCES]
    return tuple([BIT.get(form.format(name), 0) for name in names])


def codes_of(active: int) -> list[TroubleCode]:
    """The codes of a set."""
    return [code for i, code in enumerate(CODES) if active >> i & 1]


@lru_cache(maxsize=1024)
def consequence(active: int) -> tuple[BrakeMode, Fault]:
    """Best mode that a set of codes allows, and how it shows in ACTIVE_FAULTS."""
    faults, mode = Fault.NONE, BrakeMode.NORMAL
    for code in codes_of(active):
        faults |= code.fault
        mode = max(mode, code.reaction)
    return mode, faults


class FreezeFrame(NamedTuple):
    """The car when a code first became active; values as they were received, NaN where none was."""

    mode: BrakeMode
    speed_mps: float
    demanded_deceleration_mps2: float
    pedal: tuple[float, float]
    pressure_pa: Four
    motor_current_a: Four


class Trouble(NamedTuple):
    """A code in the memory; times since the controller's start.

    ``last_s``: when it last became active or ceased to be; ``occurrences``: how often it became active.
    """

    code: TroubleCode
    active: bool
    occurrences: int
    first_s: float
    last_s: float
    freeze_frame: FreezeFrame


class TroubleMemory(NamedTuple):
    """What has been found since the start: the set that is active, and each code once, in order of appearance."""

    active: int
    troubles: tuple[Trouble, ...]


NO_TROUBLE = TroubleMemory(0, ())
MOST_OCCURRENCES = 255  # that the wire can tell


def remember(memory: TroubleMemory, active: int, time_s: float, freeze_frame: FreezeFrame) -> TroubleMemory:
    """The memory after the active set has changed to ``active`` at ``time_s``."""
    changed = memory.active ^ active
    troubles = []
    for trouble in memory.troubles:
        bit = BIT[trouble.code.name]
        if changed & bit:
            more = bool(active & bit)
            occurrences = min(trouble.occurrences + more, MOST_OCCURRENCES)
            trouble = trouble._replace(active=more, occurrences=occurrences, last_s=time_s)
            changed &= ~bit
        troubles.append(trouble)
    troubles += [Trouble(code, True, 1, time_s, time_s, freeze_frame) for code in codes_of(changed & active)]
    return TroubleMemory(active, tuple(troubles))


def forget(memory: TroubleMemory, codes: tuple[TroubleCode, ...]) -> TroubleMemory:
    """The memory without some codes; what is still active is found anew."""
    numbers = {code.number for code in codes}
    active = memory.active
    for code in codes:
        active &= ~BIT[code.name]
    return TroubleMemory(active, tuple([t for t in memory.troubles if t.code.number not in numbers]))
