"""Faults of the process that plays a node: killed, stopped, busy, late; in virtual time what others see of that."""

from dbc.frame import Frame, Received
from dbc.messages import BrakeMode, Fault
from hil.faults.act import Act
from hil.faults.bus import DETECT_MS, NORMAL
from hil.faults.fault import Expected, FaultKind, Injection, Side
from hil.faults.targets import Takes
from hil.rt.clock import WallClock
from hil.rt.process import kill_self, stop_self


class Killed(Act):
    """The process is gone; in virtual time the node is neither stepped nor heard."""

    def runs(self, now_ns: int) -> bool:
        """Never again."""
        if self.real and self.acts(now_ns):
            kill_self()
        return not self.acts(now_ns)


class Stopped(Act):
    """The process stands still; what arrives meanwhile waits for it."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._waits: list[Received] = []

    @property
    def holds(self) -> bool:
        """Whether frames wait."""
        return bool(self._waits)

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """Nothing while it stands, then everything at once."""
        if self.real:
            if self.acts(now_ns):
                stop_self(self.injection.number("for_s"))
                self.left = 0.0
            return inbox
        waits = self._waits + inbox
        self._waits = waits if self.acts(now_ns) else []
        return [] if self.acts(now_ns) else waits

    def runs(self, now_ns: int) -> bool:
        """Not while it stands."""
        return self.real or not self.acts(now_ns)


class Busy(Stopped):
    """One tick takes too long: its frames come late, ticks are skipped."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._late: list[Frame] | None = None

    @property
    def holds(self) -> bool:
        """Whether its frames are still to come."""
        return bool(self._waits or self._late)

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """The first tick hears; the others wait."""
        return inbox if self.real or self._late is None else super().hear(now_ns, inbox)

    def runs(self, now_ns: int) -> bool:
        """The first tick, and those behind."""
        return self.real or self._late is None or not self.acts(now_ns)

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """Nothing until the work is done."""
        acts = self.acts(now_ns)
        if self.real:
            if acts:
                clock = WallClock()
                end_ns = clock.now_ns() + round(self.injection.number("for_s") * 1e9)
                while clock.now_ns() < end_ns:
                    pass
                self.left = 0.0
            return frames
        if acts:
            self._late = frames if self._late is None else self._late
            return []
        late, self._late = self._late or [], []
        return late + frames


class Late(Act):
    """The node joins late: it neither sends nor hears before."""

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """Nothing."""
        return [] if self.acts(now_ns) else inbox

    def runs(self, now_ns: int) -> bool:
        """Not yet."""
        return not self.acts(now_ns)


_ROW = "process killed, stopped, busy"
_EVERYTHING = Fault((1 << 14) - 1)  # one that heard nobody for a while may report any of them
_MODES = frozenset({BrakeMode.FRICTION_ONLY, BrakeMode.SAFE_STOP, BrakeMode.DEGRADED})
_GONE = Expected(_MODES, _EVERYTHING, detect_ms=DETECT_MS, motor_zero_ms=50.0, braking=True)
_SHORT = Expected(_MODES | NORMAL, _EVERYTHING)


def _kind(number: int, name: str, text: str, reaction: Expected, for_s: float, row: str = _ROW) -> FaultKind:
    return FaultKind(
        number, name, "process", text, row, Side.PROCESS, Takes.PROCESS, ("ECU", "PLANT"), reaction, of_target=False,
        usual_values=(("for_s", for_s),) if for_s else (),
    )  # fmt: skip


FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (_kind(90, "process_killed", "The node's process is killed (SIGKILL).", _GONE, 0.0), Killed),
    (_kind(91, "process_stopped", "The node's process stands still for `for_s` (SIGSTOP, SIGCONT).", _SHORT, 0.05),
     Stopped),
    (_kind(92, "process_busy", "One tick of the node takes `for_s`: an overrun.", _SHORT, 0.05), Busy),
    (_kind(93, "process_late", "The node joins `for_s` after the others.", _SHORT, 0.5, "start order, late join"),
     Late),
)  # fmt: skip
