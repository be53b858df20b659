"""Sends a recorded log back on a bus, on absolute deadlines, and never what somebody else on that bus sends.

    deadline(frame) = start + (stamp of the frame - stamp of the first one sent) / speed

``start`` is the next multiple of 100 ms of the clock plus the role's phase, so that a replayed plant keeps its place
between the ticks of a live ECU. Frames leave in the order of their stamps. After a stall of the machine whatever is
overdue is sent at once and counted as late; but of what is overdue by more than two cycles of the nodes (20 ms), only
each identifier's newest frame, and every frame of a message without a cycle: a burst of old values helps nobody. The
rest is counted as superseded. The frames after a stall keep their own deadlines: no drift.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dbc.contract import MessageSpec, contract
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.node_process import ECU, NODE_PERIOD_NS, PLANT, Role
from hil.bus.bus import Bus
from hil.errors import BrakebenchError
from hil.log.frames import FrameFlag, FrameTable, Recording
from hil.rt.clock import Clock
from hil.rt.loop import GRID_NS

ROLES: dict[str, Role | None] = {"all": None, "plant": PLANT, "ecu": ECU}
"""What can be replayed, by name; None for everything."""

LISTEN_NS = 250_000_000
"""How long the bus is listened to before the start: two cycles of the slowest message and more."""
LATE_NS = 1_000_000
"""A frame sent more than this after its deadline counts as late."""
STALL_NS = 2 * NODE_PERIOD_NS
"""Overdue by more than this, an older frame gives way to a newer one of the same identifier."""
_LOOK_NS = 20_000_000  # how often the bus and the stop are looked at in a gap of the log
_LEAD_NS = 1_000_000  # at least this between now and the first deadline
_BUSES = tuple(BusName)


class ReplayError(BrakebenchError):
    """A log that cannot be replayed here."""


class Identity(NamedTuple):
    """One identifier on one bus, and what our DBC knows of it (empty strings where it knows nothing)."""

    bus: BusName
    can_id: int
    extended: bool
    message: str
    sender: str
    on_change: bool

    def __str__(self) -> str:
        of = f" ({self.message} of {self.sender})" if self.message else ""
        return f"0x{self.can_id:X}{of} on the {self.bus} bus"


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """What of a log is to be sent.

    Attributes
    ----------
    frames : the frames in order of their stamps.
    time_ns : int64 (n,), their stamps counted from the first, ns.
    identities : the identifiers that occur.
    code : int32 (n,), which of ``identities`` each frame has.
    phase_ns : where in the bench's cycle the first one leaves, ns.
    left_out : frames of the log that are not sent, by reason.
    """

    frames: FrameTable
    time_ns: npt.NDArray[np.int64]
    identities: tuple[Identity, ...]
    code: npt.NDArray[np.int32]
    phase_ns: int
    left_out: dict[str, int]


def select(recording: Recording, role: str = "all", channel: str | None = None) -> Selection:
    """Choose what of a log is to be sent.

    Parameters
    ----------
    role : ``plant`` or ``ecu`` for what that side sends by our DBC, with the bench's stimulus for the *other* side,
        which is the one that listens; ``all`` for every data frame.
    channel : the log's channel that goes to the vehicle bus. By default the channels ``vehicle`` and ``bench`` of our
        own recordings go to the buses of these names, and a log's only channel to the vehicle bus.

    Raises
    ------
    ReplayError : no such channel, or nothing is left to be sent.
    """
    frames = recording.frames
    bus_of = _buses(recording, channel)
    bus = np.array([bus_of.get(name, -1) for name in frames.channels], np.int64)[frames.channel]
    owner = ROLES[role]
    left_out: dict[str, int] = {}
    chosen = np.ones(len(frames), np.bool_)

    def leave_out(reason: str, rows: npt.NDArray[np.bool_]) -> None:
        count = int(np.count_nonzero(chosen & rows))
        if count:
            left_out[reason] = count
            chosen[rows] = False

    leave_out("of another channel", bus < 0)
    leave_out("error or remote frames", frames.flags & int(FrameFlag.ERROR | FrameFlag.REMOTE) != 0)
    leave_out("CAN FD frames", frames.flags & int(FrameFlag.FD) != 0)
    key = bus << 30 | frames.extended.astype(np.int64) << 29 | frames.can_id
    if owner is not None:
        specs = {_BUSES.index(spec.bus) << 30 | spec.can_id: spec for spec in _replayed_by(owner)}
        leave_out(f"not of the {role}", ~np.isin(key, list(specs)))
        lengths = np.zeros(len(frames), np.int64)
        for known, spec in specs.items():
            lengths[key == known] = spec.length
        leave_out("of a length that is not the DBC's", frames.length != lengths)
    if not chosen.any():
        why = ", ".join(f"{count} {reason}" for reason, count in left_out.items()) or "it is empty"
        raise ReplayError(
            f"{recording.path}: nothing to send as {role} ({why}); its channels: "
            f"{', '.join(frames.channels) or 'none'}; choose with --channel and --role"
        )
    rows = np.flatnonzero(chosen)
    rows = rows[np.argsort(frames.time_ns[rows], kind="stable")]
    keys, code = np.unique(key[rows], return_inverse=True)
    table = frames.take(rows)
    time_ns = table.time_ns - table.time_ns[0]
    identities = tuple(map(_identity, keys.tolist()))
    phase_ns = owner.phase_ns if owner else 0
    return Selection(table, time_ns, identities, code.astype(np.int32), phase_ns, left_out)


def _buses(recording: Recording, channel: str | None) -> dict[str, int]:
    """Index of the bus that each of the log's channels goes to."""
    names = recording.frames.channels
    if channel is not None:
        if channel not in names:
            known = ", ".join(names) or "none"
            raise ReplayError(f"{recording.path}: has no channel {channel!r}; its channels: {known}")
        return {channel: _BUSES.index(BusName.VEHICLE)}
    ours = {str(bus): index for index, bus in enumerate(_BUSES) if str(bus) in names}
    if ours or not names:
        return ours
    if len(names) > 1:
        raise ReplayError(
            f"{recording.path}: expected channels vehicle and bench, or one alone, got {', '.join(names)}; "
            "say with --channel which one goes to the vehicle bus"
        )
    return {names[0]: _BUSES.index(BusName.VEHICLE)}


def _replayed_by(role: Role) -> list[MessageSpec]:
    """What a role sends, and the stimulus that the other role, being live, reads."""
    listener = "ECU" if role is PLANT else "PLANT"
    stimulus = [spec for spec in contract(BusName.BENCH).sent_by("BENCH") if listener in spec.receivers]
    return [spec for bus in _BUSES for spec in contract(bus).sent_by(*role.senders)] + stimulus


def _identity(key: int) -> Identity:
    bus, extended, can_id = _BUSES[key >> 30], bool(key >> 29 & 1), key & 0x1FFFFFFF
    spec = None if extended else contract(bus).by_id.get(can_id)
    if spec is None:
        return Identity(bus, can_id, extended, "", "", False)
    return Identity(bus, can_id, extended, spec.name, spec.sender, spec.cycle_ns == 0)


class Replay:
    """Sends a selection.

    Parameters
    ----------
    selection : what to send.
    buses : the buses that its identities name, open.
    clock : where time comes from.
    speed : 2 sends twice as fast.
    stopped : tells whether somebody asked to stop.

    Attributes
    ----------
    sent, late, superseded : frames handed to the bus; of these more than `LATE_NS` after their deadline; left out
        after a stall.
    refused : frames not sent because their sender was found live, by identity.
    intruders : the identities by which live senders were found.
    link_events : what the buses reported of themselves: their state and how often.
    lateness_ns : int64, of every sent frame in order.
    duration_ns : from sending the first frame to sending the last.
    """

    def __init__(
        self,
        selection: Selection,
        buses: Mapping[BusName, Bus],
        clock: Clock,
        speed: float = 1.0,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self.sent = self.late = self.superseded = 0
        self.refused: dict[Identity, int] = {}
        self.intruders: list[Identity] = []
        self.link_events: dict[LinkState, int] = {}
        self.duration_ns = 0
        self._selection = selection
        self._buses = buses
        self._clock = clock
        self._speed = speed
        self._stopped = stopped
        self._codes = {(i.bus, i.can_id, i.extended): code for code, i in enumerate(selection.identities)}
        self._blocked: set[int] = set()
        self._lateness_ns = np.zeros(len(selection.time_ns), np.int64)

    @property
    def lateness_ns(self) -> npt.NDArray[np.int64]:
        """Lateness of every frame sent, ns."""
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
        if self.intruders:
            first = self.intruders[0]
            raise ReplayError(
                f"bus {self._buses[first.bus].name}: somebody already sends {first}, which the replay would send; "
                "stop that one, or replay another role"
            )

    def run(self) -> None:
        """Send everything; ends early when told to stop, or when nothing is left that we may send."""
        clock = self._clock
        offset_ns = np.rint(self._selection.time_ns / self._speed).astype(np.int64)
        start_ns = -(-(clock.now_ns() + _LEAD_NS) // GRID_NS) * GRID_NS + self._selection.phase_ns
        row, first_ns = 0, -1
        while row < len(offset_ns) and not self._stopped():
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
        for bus in self._buses.values():
            for item in bus.receive(0.0):
                if isinstance(item, LinkEvent):
                    self.link_events[item.state] = self.link_events.get(item.state, 0) + item.number
                    continue
                code = self._codes.get((item.bus, item.can_id, item.extended))
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
        out: dict[BusName, list[Frame]] = {bus: [] for bus in self._buses}
        for i, (code, lateness_ns) in enumerate(zip(codes, overdue_ns.tolist(), strict=True)):
            identity = identities[code]
            if code in self._blocked:
                self.refused[identity] = self.refused.get(identity, 0) + 1
            elif not keep[i]:
                self.superseded += 1
            else:
                out[identity.bus].append(self._frame(start + i, identity))
                self._lateness_ns[self.sent] = lateness_ns
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
        return Frame(identity.bus, identity.can_id, data, 0, identity.extended)
