"""Which frames of a recorded log are sent back, on which bus, and when they are due."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dbc.contract import contract
from dbc.database import Message
from dbc.frame import BusName
from hil.bench.node_process import ECU, PLANT, Role
from hil.errors import BrakebenchError
from hil.log.choice import Choice
from hil.log.frames import FrameFlag, FrameTable, Recording
from hil.log.signals.databases import Databases

ALL = "all"
OWN_ROLES: dict[str, Role] = {"plant": PLANT, "ecu": ECU}
"""Sides of our own bench; any other role names nodes of the database."""

OUTSIDE = "outside --from and --to"
_BUSES = tuple(map(str, BusName))


class ReplayError(BrakebenchError):
    """A log that cannot be replayed here."""


class Identity(NamedTuple):
    """One identifier on one bus, and what the database knows of it (empty strings where it knows nothing).

    Attributes
    ----------
    bus : ``vehicle``, ``bench``, or what a channel map names.
    on_change : it has no cycle time: each of its frames counts.
    """

    bus: str
    can_id: int
    extended: bool
    message: str
    sender: str
    on_change: bool

    def __str__(self) -> str:
        of = f" ({self.message} of {self.sender})" if self.message else ""
        return f"0x{self.can_id:X}{of} on {f'the {self.bus} bus' if self.bus in _BUSES else self.bus}"


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """What of a log is to be sent.

    Attributes
    ----------
    frames : the frames in order of their stamps.
    time_ns : int64 (n,), when each is due, counted from the first, ns: the stamps, without what was cut from gaps.
    identities : the identifiers that occur.
    code : int32 (n,), which of ``identities`` each frame has.
    phase_ns : where in the bench's cycle the first one leaves, ns.
    left_out : frames of the log that are not sent, by reason.
    gaps, cut_ns : gaps that were shortened, and by how much in all, ns.
    """

    frames: FrameTable
    time_ns: npt.NDArray[np.int64]
    identities: tuple[Identity, ...]
    code: npt.NDArray[np.int32]
    phase_ns: int
    left_out: dict[str, int]
    gaps: int = 0
    cut_ns: int = 0


def select(
    recording: Recording,
    role: str = ALL,
    channel_map: Mapping[str, str] | None = None,
    databases: Databases | None = None,
    choice: Choice | None = None,
    max_gap_ns: int | None = None,
) -> Selection:
    """Choose what of a log is to be sent.

    Parameters
    ----------
    role : ``plant`` or ``ecu`` for what that side sends by our DBC, with the bench's stimulus for the *other* side,
        which is the one that listens; nodes of the databases, parted by commas, for what they send; ``all`` for every
        data frame.
    channel_map : bus by channel of the log: ``vehicle``, ``bench``, or any other name; channels that it does not name
        are left out. By default the channels ``vehicle`` and ``bench`` of our own recordings go to the buses of these
        names, and a log's only channel to the vehicle bus.
    databases : by channel of the log; None takes our own.
    choice : its span of time.
    max_gap_ns : a longer pause between two frames that are sent lasts so long.

    Raises
    ------
    ReplayError : no such channel or node, or nothing is left to be sent.
    """
    frames, left_out = recording.frames, {}
    if choice is not None and len(frames):
        frames = next(choice.frames([recording.frames]))
        if len(frames) < len(recording.frames):
            left_out[OUTSIDE] = len(recording.frames) - len(frames)
    bus_of = _buses(recording, channel_map or {})
    buses = tuple(dict.fromkeys(bus_of.values()))
    bus = np.array([buses.index(bus_of[n]) if n in bus_of else -1 for n in frames.channels], np.int64)[frames.channel]
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
    book = _Book(databases, buses, bus_of)
    wanted, phase_ns = _wanted(role, book, databases is not None)
    known = {k: book.message(k) for k in np.unique(key[chosen]).tolist()}
    if wanted is not None:
        owned = {k: message for k, message in known.items() if message is not None and wanted(buses[k >> 30], message)}
        leave_out(f"not of the {role}" if role in OWN_ROLES else f"not of {role}", ~np.isin(key, list(owned)))
        lengths = np.zeros(len(frames), np.int64)
        for k, message in owned.items():
            lengths[key == k] = message.length
        leave_out("of a length that is not the DBC's", frames.length != lengths)
    if not chosen.any():
        why = ", ".join(f"{count} {reason}" for reason, count in left_out.items()) or "it is empty"
        raise ReplayError(
            f"{recording.path}: nothing to send as {role} ({why}); its channels: "
            f"{', '.join(frames.channels) or 'none'}; choose with --map, --role, --from and --to"
        )
    rows = np.flatnonzero(chosen)
    rows = rows[np.argsort(frames.time_ns[rows], kind="stable")]
    keys, code = np.unique(key[rows], return_inverse=True)
    table = frames.take(rows)
    time_ns = table.time_ns - table.time_ns[0]
    gaps = cut_ns = 0
    if max_gap_ns is not None:
        beyond_ns = np.maximum(np.diff(time_ns) - max_gap_ns, 0)
        gaps, cut_ns = int(np.count_nonzero(beyond_ns)), int(beyond_ns.sum())
        time_ns[1:] -= np.cumsum(beyond_ns)
    states_cycles = book.databases.states_cycles
    identities = tuple(_identity(k, buses[k >> 30], known[k], states_cycles) for k in keys.tolist())
    return Selection(table, time_ns, identities, code.astype(np.int32), phase_ns, left_out, gaps, cut_ns)


class _Book:
    """What the databases know of a key (bus index << 30 | extended << 29 | identifier)."""

    def __init__(self, databases: Databases | None, buses: tuple[str, ...], bus_of: Mapping[str, str]) -> None:
        self.databases = databases or Databases.own()
        # our own databases go by the bus, others by the log's channel
        self._channels = [
            [name] if databases is None else [channel for channel, bus in bus_of.items() if bus == name]
            for name in buses
        ]

    def message(self, key: int) -> Message | None:
        for channel in self._channels[key >> 30]:
            found = self.databases.message(channel, key & 0x1FFFFFFF, bool(key >> 29 & 1))
            if found is not None:
                return found
        return None


def _wanted(role: str, book: _Book, foreign: bool) -> tuple[Callable[[str, Message], bool] | None, int]:
    """Which messages (bus, message) a role sends, None for all, and its phase in the bench's cycle, ns."""
    if role == ALL:
        return None, 0
    known = {message.sender for message in book.databases.messages() if message.sender}
    if role in OWN_ROLES and not foreign:
        own = OWN_ROLES[role]
        listener = "ECU" if own is PLANT else "PLANT"
        stimulus = {s.can_id for s in contract(BusName.BENCH).sent_by("BENCH") if listener in s.receivers}
        return (
            lambda bus, message: message.sender in own.senders or (bus == BusName.BENCH and message.can_id in stimulus)
        ), own.phase_ns
    nodes = {name.strip() for name in role.split(",")}
    strangers = nodes - known
    if strangers:
        raise ReplayError(
            f"--role {role}: no node {', '.join(sorted(strangers))} sends anything by the database; expected all, "
            f"{'' if foreign else 'plant, ecu, or '}nodes of {', '.join(sorted(known)) or 'none'}"
        )
    phase_ns = ECU.phase_ns if not foreign and nodes <= set(ECU.senders) else 0
    return (lambda _, message: message.sender in nodes), phase_ns


def _buses(recording: Recording, channel_map: Mapping[str, str]) -> dict[str, str]:
    """Bus that each of the log's channels goes to."""
    names = recording.frames.channels
    if channel_map:
        missing = [name for name in channel_map if name not in names]
        if missing:
            known = ", ".join(names) or "none"
            raise ReplayError(f"{recording.path}: has no channel {missing[0]!r}; its channels: {known}")
        return dict(channel_map)
    ours = {bus: bus for bus in _BUSES if bus in names}
    if ours or not names:
        return ours
    if len(names) > 1:
        raise ReplayError(
            f"{recording.path}: expected channels vehicle and bench, or one alone, got {', '.join(names)}; "
            f"say with --map which one goes where: --map {names[0]}=vehicle"
        )
    return {names[0]: str(BusName.VEHICLE)}


def _identity(key: int, bus: str, message: Message | None, states_cycles: bool) -> Identity:
    extended, can_id = bool(key >> 29 & 1), key & 0x1FFFFFFF
    if message is None:
        return Identity(bus, can_id, extended, "", "", False)
    return Identity(bus, can_id, extended, message.name, message.sender, states_cycles and not message.cycle_time_ms)
