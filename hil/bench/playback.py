"""Sends a recorded log back on a bus, on absolute deadlines, and never what somebody else on that bus sends.

    deadline(frame) = start + (stamp of the frame - stamp of the first one sent) / speed

``start`` is the next multiple of 100 ms of the clock plus the role's phase, so that a replayed plant keeps its place
between the ticks of a live ECU; or 2 ms after the frame that was waited for. A round of a loop lasts up to the next
multiple of 10 ms after its last frame: each round has the same place between those ticks.

Frames leave in the order of their stamps. After a stall of the machine whatever is overdue is sent at once and counted
as late; but of what is overdue by more than two cycles of the nodes (20 ms), only each identifier's newest frame, and
every frame of a message without a cycle: a burst of old values helps nobody; nor do rounds that a stall ate whole. The
rest is counted as superseded. The frames after a stall keep their own deadlines: no drift.
"""

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.node_process import NODE_PERIOD_NS
from hil.bench.replay_selection import Identity, ReplayError, Selection
from hil.bus.bus import Bus
from hil.rt.clock import Clock
from hil.rt.loop import GRID_NS

LISTEN_NS = 250_000_000
"""How long the bus is listened to before the start: two cycles of the slowest message and more."""
LATE_NS = 1_000_000
"""A frame sent more than this after its deadline counts as late."""
STALL_NS = 2 * NODE_PERIOD_NS
"""Overdue by more than this, an older frame gives way to a newer one of the same identifier."""
_LOOK_NS = 20_000_000  # how often the bus and the stop are looked at in a gap of the log
_LEAD_NS = 1_000_000  # at least this between now and the first deadline
_WAIT_LOOK_NS = 1_000_000  # how often the bus is looked at for the frame that is waited for
AFTER_CUE_NS = 2 * _WAIT_LOOK_NS
"""From the frame that is waited for to the first one sent: one look at the bus, and the time to act on it."""


class Replay:
    """Sends a selection.

    Parameters
    ----------
    selection : what to send.
    buses : the buses that its identities name, open; frames for any but ``bench`` go as those of the vehicle bus.
    clock : where time comes from.
    speed : 2 sends twice as fast.
    stopped : tells whether somebody asked to stop.
    loop : begin again at the end, until told to stop.
    wait_for : identifier of the frame, on any of the buses, with which the replay starts.

    Attributes
    ----------
    sent, late, superseded : frames handed to the bus; of these more than `LATE_NS` after their deadline; left out
        after a stall.
    refused : frames not sent because their sender was found live, by identity.
    intruders : the identities by which live senders were found.
    link_events : what the buses reported of themselves: their state and how often.
    dealt : frames sent, superseded or refused.
    rounds : rounds of the selection that were ended.
    lateness_ns : int64, of every sent frame, of a loop those of the last round; in order unless looped.
    most_late_ns : greatest lateness of all.
    duration_ns : from sending the first frame to sending the last.
    """

    def __init__(
        self,
        selection: Selection,
        buses: Mapping[str, Bus],
        clock: Clock,
        speed: float = 1.0,
        stopped: Callable[[], bool] = lambda: False,
        loop: bool = False,
        wait_for: int | None = None,
    ) -> None:
        self.sent = self.late = self.superseded = self.rounds = self.most_late_ns = 0
        self.refused: dict[Identity, int] = {}
        self.intruders: list[Identity] = []
        self.link_events: dict[LinkState, int] = {}
        self.duration_ns = 0
        self._selection = selection
        self._buses = buses
        self._clock = clock
        self._speed = speed
        self._stopped = stopped
        self._loop = loop
        self._cue = wait_for
        self._cue_ns: int | None = None
        self._codes = {(i.bus, i.can_id, i.extended): code for code, i in enumerate(selection.identities)}
        self._blocked: set[int] = set()
        self._lateness_ns = np.zeros(len(selection.time_ns), np.int64)
        cued = [i for i in selection.identities if i.can_id == wait_for]
        if cued:
            raise ReplayError(f"waits for {cued[0]}, which the replay itself would send; replay another role")

    @property
    def dealt(self) -> int:
        """Frames sent, superseded or refused."""
        return self.sent + self.superseded + sum(self.refused.values())

    @property
    def lateness_ns(self) -> npt.NDArray[np.int64]:
        """Lateness of the frames sent, ns; of a loop that of the last ones, as many as a round has."""
        return self._lateness_ns[: self.sent]

    def listen(self) -> None:
        """Listen for `LISTEN_NS`.

        Raises
        ------
        ReplayError : somebody sends what we would send.
        """
        end_ns = self._clock.now_ns() + LISTEN_NS
        while self._clock.now_ns() < end_ns and not self._stopped():
            self._clock.sleep_until(min(end_ns, self._clock.now_ns() + _LOOK_NS))
            self._heed()
        self._refuse_to_start()

    def _refuse_to_start(self) -> None:
        if self.intruders:
            first = self.intruders[0]
            raise ReplayError(
                f"bus {self._buses[first.bus].name}: somebody already sends {first}, which the replay would send; "
                "stop that one, or replay another role"
            )

    def wait(self) -> None:
        """Wait for the frame that starts the replay, where one was named; or until told to stop.

        Raises
        ------
        ReplayError : as of `listen`.
        """
        self._cue_ns = None
        while self._cue is not None and self._cue_ns is None and not self._stopped():
            self._clock.sleep_until(self._clock.now_ns() + _WAIT_LOOK_NS)
            self._heed()
            self._refuse_to_start()

    def run(self) -> None:
        """Send everything; ends early when told to stop, or when nothing is left that we may send."""
        clock = self._clock
        offset_ns = np.rint(self._selection.time_ns / self._speed).astype(np.int64)
        round_ns = (int(offset_ns[-1]) // NODE_PERIOD_NS + 1) * NODE_PERIOD_NS
        start_ns = -(-(clock.now_ns() + _LEAD_NS) // GRID_NS) * GRID_NS + self._selection.phase_ns
        if self._cue_ns is not None:
            start_ns = max(self._cue_ns + AFTER_CUE_NS, clock.now_ns())
        row, first_ns = 0, -1
        while not self._stopped():
            if row == len(offset_ns):
                self.rounds += 1
                if not self._loop:
                    break
                row, start_ns = 0, start_ns + round_ns
                missed = max(0, clock.now_ns() - start_ns) // round_ns  # whole rounds, in a stall
                self.superseded += missed * len(offset_ns)
                start_ns += missed * round_ns
            if len(self._blocked) == len(self._codes):
                self._refuse_rest(row)
                break
            clock.sleep_until(min(start_ns + int(offset_ns[row]), clock.now_ns() + _LOOK_NS))
            self._heed()
            now_ns = clock.now_ns()
            end = int(np.searchsorted(offset_ns, now_ns - start_ns, side="right"))
            overdue_ns = now_ns - start_ns - offset_ns[row:end]
            if overdue_ns.size:
                self._send(row, overdue_ns)
                first_ns = now_ns if first_ns < 0 else first_ns
                self.duration_ns = now_ns - first_ns
                row += overdue_ns.size
        self._heed()

    def _refuse_rest(self, row: int) -> None:
        """Count what is left when every sender turned out to be live."""
        for code in self._selection.code[row:].tolist():
            identity = self._selection.identities[code]
            self.refused[identity] = self.refused.get(identity, 0) + 1

    def _heed(self) -> None:
        """Take what arrived: whoever sends an identifier of ours has that node's identifiers from now on."""
        for name, bus in self._buses.items():
            for item in bus.receive(0.0):
                if isinstance(item, LinkEvent):
                    self.link_events[item.state] = self.link_events.get(item.state, 0) + item.number
                    continue
                if item.can_id == self._cue and self._cue_ns is None:
                    self._cue_ns = item.time_ns or self._clock.now_ns()
                code = self._codes.get((name, item.can_id, item.extended))
                if code is None or code in self._blocked:
                    continue
                found = self._selection.identities[code]
                self.intruders.append(found)
                for other, identity in enumerate(self._selection.identities):
                    if other == code or (found.sender and identity.sender == found.sender):
                        self._blocked.add(other)

    def _send(self, start: int, overdue_ns: npt.NDArray[np.int64]) -> None:
        """Send the frames from row ``start`` on whose deadlines have come, so long ago."""
        identities = self._selection.identities
        codes = self._selection.code[start : start + len(overdue_ns)].tolist()
        keep = self._keep(codes, overdue_ns)
        out: dict[str, list[Frame]] = {bus: [] for bus in self._buses}
        for i, (code, lateness_ns) in enumerate(zip(codes, overdue_ns.tolist(), strict=True)):
            identity = identities[code]
            if code in self._blocked:
                self.refused[identity] = self.refused.get(identity, 0) + 1
            elif not keep[i]:
                self.superseded += 1
            else:
                out[identity.bus].append(self._frame(start + i, identity))
                self._lateness_ns[self.sent % len(self._lateness_ns)] = lateness_ns
                self.most_late_ns = max(self.most_late_ns, lateness_ns)
                self.sent += 1
                self.late += lateness_ns > LATE_NS
        for bus, frames in out.items():
            if frames:
                self._buses[bus].send(frames)

    def _keep(self, codes: list[int], overdue_ns: npt.NDArray[np.int64]) -> list[bool]:
        """Which frames are still of use; all of them unless there was a stall."""
        stale = overdue_ns > STALL_NS
        keep = [True] * len(codes)
        if not stale[0]:
            return keep
        newer: set[int] = set()
        for i in range(len(codes) - 1, -1, -1):
            keep[i] = not (stale[i] and codes[i] in newer) or self._selection.identities[codes[i]].on_change
            newer.add(codes[i])
        return keep

    def _frame(self, row: int, identity: Identity) -> Frame:
        frames = self._selection.frames
        data = frames.data[row, : frames.length[row]].tobytes()
        bus = BusName.BENCH if identity.bus == BusName.BENCH else BusName.VEHICLE
        return Frame(bus, identity.can_id, data, 0, identity.extended)
