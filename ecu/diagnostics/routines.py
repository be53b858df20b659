"""Routines: self test, bleeding of the brake, zero of the pressure sensors."""

import math
import struct
from enum import IntEnum

from ecu.diagnostics.exchange import View
from ecu.diagnostics.protocol import Nrc, Refused
from ecu.law.types import UNKNOWN, Four

SELF_TEST, BLEED, PRESSURE_ZERO = 0x0201, 0x0202, 0x0203
NAMES = {SELF_TEST: "self test", BLEED: "bleed the brake", PRESSURE_ZERO: "zero of the pressure sensors"}
SECURED = (BLEED, PRESSURE_ZERO)
START, STOP, RESULTS = 0x01, 0x02, 0x03
BLEED_PA = 30e5  # choice: opens and closes the pads well below what holds the car
PULSES, PULSE_S, PAUSE_S = 3, 0.4, 0.4  # choice: of each wheel; the brake's circuit settles within 0.2 s
SUPPLIED_S = 1.0  # choice: ten cycles of the slowest source
ZERO_S = 0.5  # choice: mean of 50 samples
ZERO_MOST_PA = 3e5  # choice: a sensor further off is broken


class State(IntEnum):
    """Where a routine is."""

    NOT_STARTED = 0
    RUNNING = 1
    DONE = 2
    ABORTED = 3
    FAILED = 4


class Routines:
    """Runs at most one routine at a time; results stay until it is started again.

    Attributes
    ----------
    zero_pa : zero of the pressure sensors that was just found, until the server takes it; the node keeps it.
    """

    def __init__(self) -> None:
        self._states = dict.fromkeys(NAMES, State.NOT_STARTED)
        self._results = dict.fromkeys(NAMES, b"")
        self._running: int | None = None
        self._since_s = 0.0
        self._samples: list[Four] = []
        self.zero_pa: Four | None = None

    @property
    def running(self) -> bool:
        """A routine goes on."""
        return self._running is not None

    def control(self, kind: int, routine: int, view: View, actuators_taken: bool) -> bytes:
        """Answer to a request behind the routine's number: its state, and its results where they are asked for."""
        if kind == START:
            self._start(routine, view, actuators_taken)
        elif kind == STOP:
            if self._running != routine:
                raise Refused(Nrc.REQUEST_SEQUENCE_ERROR)
            self.abort()
        elif self._states[routine] == State.NOT_STARTED:
            raise Refused(Nrc.REQUEST_SEQUENCE_ERROR)
        else:
            return bytes((self._states[routine],)) + self._results[routine]
        return bytes((self._states[routine],))

    def abort(self) -> None:
        """End what runs."""
        if self._running is not None:
            self._states[self._running], self._running = State.ABORTED, None

    def _start(self, routine: int, view: View, actuators_taken: bool) -> None:
        if routine == SELF_TEST:
            supplied = sum((h.age_s < SUPPLIED_S) << i for i, h in enumerate(view.inputs.health))
            codes = min(view.troubles.active.bit_count(), 255)
            well = supplied == (1 << len(view.inputs.health)) - 1 and not codes
            self._states[routine] = State.DONE if well else State.FAILED
            self._results[routine] = struct.pack(">HBB", supplied, codes, view.outputs.mode)
            return
        if self.running or actuators_taken or not view.actuators_free:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        self._running, self._since_s, self._samples = routine, view.time_s, []
        self._states[routine], self._results[routine] = State.RUNNING, b""

    def step(self, view: View) -> Four | None:
        """Go on by one tick; return the pressures that the routine asks for, None where it asks for none."""
        if self._running is None:
            return None
        if not view.actuators_free:
            self.abort()
            return None
        elapsed_s = view.time_s - self._since_s
        if self._running == BLEED:
            return self._bleed(elapsed_s)
        self._samples.append(view.inputs.pressure_pa)
        if elapsed_s >= ZERO_S:
            self._find_zero(view.pressure_zero_pa)
        return None

    def _bleed(self, elapsed_s: float) -> Four | None:
        pulse, phase_s = divmod(elapsed_s, PULSE_S + PAUSE_S)
        wheel = int(pulse) // PULSES
        if wheel > 3:
            self._states[BLEED], self._running = State.DONE, None
            return None
        pressure = [math.nan] * 4
        pressure[wheel] = BLEED_PA if phase_s < PULSE_S else 0.0
        return (pressure[0], pressure[1], pressure[2], pressure[3])

    def _find_zero(self, known: Four) -> None:
        n = len(self._samples)
        a, b, c, d = (sum(values) / n for values in zip(*self._samples, strict=True))
        found = (known[0] + a, known[1] + b, known[2] + c, known[3] + d)
        self._running = None
        if all(abs(value) <= ZERO_MOST_PA for value in found):  # NaN is none
            self._states[PRESSURE_ZERO], self.zero_pa = State.DONE, found
        else:
            self._states[PRESSURE_ZERO], found = State.FAILED, found if math.isfinite(sum(found)) else UNKNOWN
        self._results[PRESSURE_ZERO] = struct.pack(">4f", *found)
