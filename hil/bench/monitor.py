"""What a run shows while it goes on and afterwards: last frames, signals, numbers."""

from pathlib import Path
from typing import TypeVar

import numpy as np

from dbc.bench_messages import BENCH_MESSAGES
from dbc.contract import Message, MessageSpec, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BRAKE_MESSAGES
from hil.bench.bench_run import BenchRun
from hil.bench.controls import RunControls, SessionError
from hil.bench.result import RunResult, Signals, measure, nearest

M = TypeVar("M", bound=Message)
CRAWL_MPS = 1.0  # below it a stop ends: motors fade out, the car comes to rest


class RunMonitor(RunControls):
    """What a run's stimulus node hears, and what its recorder writes."""

    def __init__(self) -> None:
        super().__init__()
        self._bench_run: BenchRun | None = None
        self._last: dict[tuple[BusName, int], bytes] = {}
        self._counts: dict[tuple[BusName, int], int] = {}

    @property
    def started(self) -> bool:
        """Whether the bench was brought to life."""
        return self._bench_run is not None

    @property
    def log(self) -> Path:
        """The recording so far."""
        bench_run = self._started()
        bench_run.flush()
        return bench_run.log

    @property
    def signals(self) -> Signals:
        """All signals recorded so far."""
        return Signals(self.log)

    @property
    def result(self) -> RunResult:
        """The numbers of the run so far."""
        return measure(self.signals)

    @property
    def speed_mps(self) -> float:
        """True speed of the car now."""
        motion = self._started().stimulus_node.motion
        return 0.0 if motion is None else motion.speed_mps or 0.0

    def latest(self, message_type: type[M]) -> M | None:
        """Last frame of a message, decoded; None where none was seen. Its protection is not checked."""
        spec = _known(message_type)
        data = self._last.get((spec.bus, spec.can_id))
        return None if data is None or len(data) != spec.length else spec.decode(data)

    def count(self, message_type: type[Message]) -> int:
        """How many frames of a message were seen."""
        spec = _known(message_type)
        return self._counts.get((spec.bus, spec.can_id), 0)

    def deceleration_dip(self, after: float = 0.0) -> float:
        """How far the deceleration fell below the demanded one, at most, m/s2.

        Looked at from ``after`` seconds after the fault injected last (the start where there was none), as long as the
        car is faster than 1 m/s. Negative where it always was above.
        """
        from_s = (self.fault_s or 0.0) + after
        signals = self.signals
        t_s, speed = signals.get("TRUTH_MOTION.SPEED")
        _, acceleration = signals.get("TRUTH_MOTION.ACCELERATION")
        slow = t_s[(t_s > from_s) & (speed < CRAWL_MPS)]
        inside = (t_s >= from_s - 1e-9) & (t_s < (slow[0] if len(slow) else np.inf))
        t_demand, demand = signals.get("BRAKE_STATUS.DEMANDED_DECELERATION")
        if not inside.any() or not len(t_demand):
            raise SessionError(f"deceleration_dip: nothing recorded from {from_s:g} s on; run the bench past it first")
        held = demand[np.clip(np.searchsorted(t_demand, t_s[inside], "right") - 1, 0, None)]
        return float(np.max(held + acceleration[inside]))

    def _listen(self, bench_run: BenchRun) -> None:
        """Keep what the stimulus node heard in its last step."""
        for item in bench_run.stimulus_node.inbox:
            if isinstance(item, Frame) and not item.extended:
                key = (item.bus, item.can_id)
                self._last[key] = item.data
                self._counts[key] = self._counts.get(key, 0) + 1

    def _started(self) -> BenchRun:
        if self._bench_run is None:
            raise SessionError("the bench has not run yet; call run() or run_until() first")
        return self._bench_run


def _known(message_type: type[Message]) -> MessageSpec:
    """Contract entry of what a test asks for."""
    known = {t.__name__: t for t in (*BRAKE_MESSAGES, *BENCH_MESSAGES)}
    if isinstance(message_type, type) and message_type in known.values():
        return spec_of(message_type)
    name = message_type.__name__ if isinstance(message_type, type) else str(message_type)
    raise SessionError(
        f"expected a message type of dbc.messages or dbc.bench_messages, such as BrakeStatus, got {message_type!r}; "
        f"{nearest(name, known)}"
    )
