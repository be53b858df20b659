"""What a set of signals must hold to be decoded, whatever kind of file they come from."""

import re
from collections.abc import Iterable, Sequence

from dbc.database_values import Signal, Warnings

MAX_FRAME_BYTES = 64  # CAN FD
MAX_TRANSPORT_BYTES = 1785  # J1939-21 transport protocol: 255 packets of 7
MAX_SIGNAL_BITS = 64
MAX_MUX_DEPTH = 16  # multiplexers above one signal; real ones have up to four

_ODD_LETTERS = re.compile(r"[^A-Za-z0-9_ ()/&%+-]")

Placed = tuple[int | None, Signal]  # a signal and its place in the text


def printable_name(name: str) -> str:
    """Return a name that is free text with what a table's head or a terminal could take amiss replaced by '_'."""
    return _ODD_LETTERS.sub("_", name)


def message_problem(can_id: int, extended: bool, length: int) -> str | None:
    """Say why a message cannot come on a CAN bus, None where it can."""
    if not 0 <= can_id <= (0x1FFF_FFFF if extended else 0x7FF):
        advice = "" if extended else "; a 29-bit one has bit 31 set (2147483648 added)"
        return f"identifier {can_id:#x} has more than {29 if extended else 11} bits{advice}"
    limit = MAX_TRANSPORT_BYTES if extended else MAX_FRAME_BYTES
    if length > limit:
        carrier = "J1939 transports" if extended else "a CAN FD frame has"
        return f"{length} bytes, {carrier} at most {limit}"
    return None


def signal_problem(start: int, length: int, big_endian: bool, is_float: bool, message_length: int) -> str | None:
    """Say why a signal cannot be cut out of its message, None where it can."""
    if not 1 <= length <= MAX_SIGNAL_BITS:
        return f"length {length} bits, expected 1 to {MAX_SIGNAL_BITS}"
    first = 8 * (start // 8) + 7 - start % 8 if big_endian else start
    if first < 0 or first + length > 8 * message_length:
        return f"bits {start}|{length} do not fit into {message_length} bytes"
    if is_float and length not in (16, 32, 64):
        return f"floating point of {length} bits, expected 32 or 64"
    return None


def merged(ranges: Iterable[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """Return ranges (first, last) in ascending order, none touching another, of numbers that 64 bits hold."""
    found: list[tuple[int, int]] = []
    for first, last in sorted(ranges):
        last = min(last, 2**64 - 1)
        if found and first <= found[-1][1] + 1:
            found[-1] = found[-1][0], max(last, found[-1][1])
        elif first <= last:
            found.append((first, last))
    return tuple(found)


def sound_signals(message: str, placed: Sequence[Placed], warnings: Warnings) -> tuple[Signal, ...]:
    """Return the signals that can be decoded together, by first bit; what is odd about them becomes warnings."""
    by_name: dict[str, Placed] = {}
    for position, signal in placed:
        if signal.name in by_name:
            warnings.add(position, f"signal {message}.{signal.name}: defined twice; the last one is used")
        by_name[signal.name] = position, signal
    kept = list(by_name.values())
    multiplexed = [p for p in kept if p[1].multiplexer is not None]
    if multiplexed:
        depth = _mux_depths({name: signal for name, (_, signal) in by_name.items()})
        kept = []
        for position, signal in by_name.values():
            if depth[signal.name] >= 0:
                kept.append((position, signal))
                continue
            why = f"its multiplexer {signal.multiplexer} cannot select it; left out"
            warnings.add(position, f"signal {message}.{signal.name}: {why}")
    _report_overlaps(message, kept, warnings)
    return tuple(sorted((signal for _, signal in kept), key=lambda s: s.first_bit))


def _mux_depths(signals: dict[str, Signal]) -> dict[str, int]:
    """Multiplexers above each signal; -1 where they form a loop, one is missing or none can select by value."""
    depths: dict[str, int] = {}
    for name in signals:
        path: list[str] = []
        on_path: set[str] = set()
        here: str | None = name
        while here is not None and here in signals and here not in depths and here not in on_path:
            path.append(here)
            on_path.add(here)
            here = signals[here].multiplexer
        if here is None:
            above = -1  # the last of the path is always there
            known = True
        elif here in depths and here not in on_path:
            above = depths[here]
            known = above >= 0 and not signals[here].is_float
        else:
            above, known = 0, False
        for step in reversed(path):
            above = above + 1
            known = known and above <= MAX_MUX_DEPTH
            depths[step] = above if known else -1
            known = known and not signals[step].is_float
    return depths


class _Occupied:
    """Bits of a message that signals hold, and which."""

    def __init__(self) -> None:
        self.mask = 0
        self._signals: list[Signal] = []
        self._owner: dict[int, str] = {}

    def put(self, signal: Signal, mask: int) -> None:
        self.mask |= mask
        self._signals.append(signal)

    def owners(self, mask: int) -> list[str]:
        """Names of the signals that hold bits of a mask."""
        for signal in self._signals:
            for bit in _bits(signal.mask()):
                self._owner.setdefault(bit, signal.name)
        self._signals = []
        return sorted({self._owner[bit] for bit in _bits(mask & self.mask)})


def _bits(mask: int) -> Iterable[int]:
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


def _report_overlaps(message: str, placed: list[Placed], warnings: Warnings) -> None:
    """Report signals that share a bit in one frame; branches of one multiplexer exclude each other."""
    held = 0
    for _, signal in placed:
        mask = signal.mask()
        if mask & held:
            break
        held |= mask
    else:
        return  # no two share a bit, multiplexed or not
    always = _Occupied()
    groups: dict[str, list[Placed]] = {}
    for position, signal in placed:
        if signal.multiplexer is not None:
            groups.setdefault(signal.multiplexer, []).append((position, signal))
            continue
        mask = signal.mask()
        if mask & always.mask:
            _say(message, position, signal, always.owners(mask), warnings)
        always.put(signal, mask)
    for group in groups.values():
        masks = [signal.mask() for _, signal in group]
        found: dict[int, set[str]] = {}
        for i, mask in enumerate(masks):
            if mask & always.mask:
                found[i] = set(always.owners(mask))
        _branch_overlaps(group, masks, found)
        for i, others in found.items():
            _say(message, group[i][0], group[i][1], sorted(others), warnings)


def _branch_overlaps(group: list[Placed], masks: list[int], found: dict[int, set[str]]) -> None:
    """Go up the multiplexer's values with the bits that are held there; add what overlaps by index to ``found``."""
    events: list[tuple[int, bool, int]] = []
    for i, (_, signal) in enumerate(group):
        for first, last in signal.mux_ranges:
            events += ((first, True, i), (last + 1, False, i))
    held = 0
    owner: dict[int, int] = {}
    holding: set[int] = set()
    for _, begins, i in sorted(events):  # what ends before a value ends before what begins there: False < True
        mask = masks[i]
        if not begins:
            if i in holding:
                holding.remove(i)
                held &= ~mask
        elif mask & held:
            found.setdefault(i, set()).update(group[owner[bit]][1].name for bit in _bits(mask & held))
        else:
            held |= mask
            holding.add(i)
            owner.update(dict.fromkeys(_bits(mask), i))


def _say(message: str, position: int | None, signal: Signal, others: Iterable[str], warnings: Warnings) -> None:
    for other in others:
        warnings.add(position, f"signal {message}.{signal.name}: overlaps {message}.{other}")
