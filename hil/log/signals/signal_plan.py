"""Where in a message's words each signal lies, worked out once before any frame is looked at."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dbc.database import Message, Signal
from hil.log.frames import FD_CODES
from hil.log.signals.decoded import Values
from hil.log.signals.wanted import Wanted

SNA = "SNA"  # a raw value of this name means "signal not available": an empty cell, not a number

Words = npt.NDArray[np.uint64]
Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

FLOAT, INT, OTHER = 0, 1, 2
"""Kinds of values: float64, int64, and what only numpy works out (floating-point signals, 64 unsigned bits, ...)."""
COUNT_SNA, COUNT_RANGE = 1, 2
_INT_FIELDS, _FLOAT_FIELDS = 11, 4
_TOP = 2**63


class Limits(NamedTuple):
    """Stated range of the physical values."""

    low: float
    high: float


@dataclass(slots=True, eq=False)
class SignalPlan:
    """One signal; payloads are rows of 64-bit words, as they stand in memory (little endian).

    Attributes
    ----------
    end : bytes that a frame must have to hold it.
    word : the first word it touches; `straddles` where it goes on in the next one.
    shift : bits right of it in its word (in that of `joined`, where it straddles).
    big : its word is to be swapped first.
    kind : `FLOAT`, `INT` or `OTHER`.
    sna : raw values that mean "not available".
    limits : stated range, where values can lie outside it.
    named : raw values outside of that range that have a name, so that they are meant to be there.
    parent, ranges : the multiplexer and its raw values that select this signal.
    kept : it becomes a column.
    """

    signal: Signal
    kept: bool
    end: int
    word: int
    straddles: bool
    shift: int
    big: bool
    kind: int
    sna: tuple[int, ...]
    limits: Limits | None
    named: tuple[int, ...]
    ranges: tuple[tuple[int, int], ...]
    parent: "SignalPlan | None" = None

    def joined(self, first: Words, second: Words) -> Words:
        """Words of a signal that straddles: its bits at the right."""
        begin, over = self.signal.first_bit % 64, self.signal.first_bit % 64 + self.signal.length - 64
        if self.signal.big_endian:
            return first.byteswap() << np.uint64(over) | second.byteswap() >> np.uint64(64 - over)
        return first >> np.uint64(begin) | second << np.uint64(64 - begin)

    def raw(self, words: Words) -> Values:
        """Raw values: int64, uint64 (unsigned of 64 bits) or float64."""
        signal, length = self.signal, self.signal.length
        word = (words.byteswap() if self.big else words) >> np.uint64(self.shift)
        if signal.is_float:
            kinds = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
            as_int, as_float = kinds[length]
            return word.astype(as_int).view(as_float).astype(np.float64)
        spare = np.uint64(64 - length)
        word = word << spare
        if signal.signed:
            return word.view(np.int64) >> np.int64(64 - length)
        word = word >> spare
        return word if length == 64 else word.view(np.int64)

    def physical(self, raw: Values) -> Values:
        """Values in the DBC's unit: whole numbers stay integers where 64 bits hold them, all others are float64."""
        factor, offset = self.signal.factor, self.signal.offset
        if self.signal.is_integer and factor == 1 and offset == 0:
            return raw
        if self.signal.is_integer and raw.dtype == np.int64 and _fits(self.signal):
            return np.asarray(raw * np.int64(int(factor)) + np.int64(int(offset)), np.int64)
        return np.asarray(raw * float(factor) + float(offset), np.float64)

    def named_among(self, words: Words) -> int:
        """Number of values that lie outside of the range and have a name."""
        if not self.named:
            return 0
        raw = self.raw(words)
        return int(np.count_nonzero(np.isin(raw, np.array(self.named, raw.dtype))))

    def outside(self, values: Values) -> int:
        """Number of values outside the stated range, named ones among them."""
        if self.limits is None:
            return 0
        if values.dtype == np.int64:
            low, high = _whole(self.limits)
            return int(np.count_nonzero((values < low) | (values > high)))
        return int(np.count_nonzero(~((values >= self.limits.low) & (values <= self.limits.high))))


@dataclass(slots=True, eq=False)
class MessagePlan:
    """One message.

    Attributes
    ----------
    name : what its columns are called.
    signals : all that are kept, and their multiplexers.
    least : bytes below which a frame holds no signal at all.
    full : bytes from which a frame holds every signal (that its multiplexers select).
    plain : the compiled pass takes all signals, and all lie in the first word of every frame that is not short.
    ints, floats : what the compiled pass needs of each signal, see `hil.log.signals.decode_pass`.
    from_sources : a J1939 message, which several nodes may send.
    """

    name: str
    message: Message
    signals: list[SignalPlan]
    least: int
    full: int
    plain: bool
    ints: Ints
    floats: Floats
    from_sources: bool = False


def padded_length(length: int) -> int:
    """Most bytes that a frame of a message of ``length`` bytes has: CAN FD frames are padded up to the next length."""
    return next((size for size in FD_CODES if size >= length), length)


def plan_message(message: Message, name: str, wanted: Wanted) -> MessagePlan:
    """Work out where the signals of a message lie."""
    by_name = {s.name: s for s in message.signals}
    kept = {s.name for s in message.signals if wanted.takes(name, s.name)}
    needed: set[str] = set()
    for one in kept:
        at: str | None = one
        while at is not None and at not in needed:
            needed.add(at)
            at = by_name[at].multiplexer
    plans = {s.name: _plan(s, s.name in kept) for s in message.signals if s.name in needed}
    for plan in plans.values():
        if plan.signal.multiplexer is not None:
            plan.parent = plans[plan.signal.multiplexer]
    signals = list(plans.values())
    ends = _ends(message, by_name)
    least = min([message.length, *ends.values()])
    full = max([message.length, *ends.values()]) if signals else message.length
    ints, floats = np.zeros((len(signals), _INT_FIELDS), np.int64), np.zeros((len(signals), _FLOAT_FIELDS))
    for row, plan in enumerate(signals):
        if plan.kind != OTHER:
            ints[row], floats[row] = _numbers(plan)
    plain = all(
        plan.kind != OTHER and plan.parent is None and plan.word == 0 and not plan.straddles for plan in signals
    )
    return MessagePlan(name, message, signals, least, full, plain, ints, floats, message.pgn_match)


def _ends(message: Message, by_name: dict[str, Signal]) -> dict[str, int]:
    """Bytes that a frame must have to hold each signal and the multiplexers that select it."""
    ends: dict[str, int] = {}
    for signal in message.signals:
        chain: list[Signal] = []
        at: Signal | None = signal
        while at is not None and at.name not in ends:
            chain.append(at)
            at = None if at.multiplexer is None else by_name[at.multiplexer]
        end = 0 if at is None else ends[at.name]
        for one in reversed(chain):
            end = ends[one.name] = max(end, _end(one))
    return ends


def _end(signal: Signal) -> int:
    return (signal.first_bit + signal.length + 7) // 8


def _plan(signal: Signal, kept: bool) -> SignalPlan:
    word, begin = divmod(signal.first_bit, 64)
    straddles = begin + signal.length > 64
    shift = 0 if straddles else 64 - begin - signal.length if signal.big_endian else begin
    low, high = _raw_ends(signal)
    sna = () if signal.is_float else tuple(n for n, t in signal.choices.items() if t == SNA and low <= n <= high)
    limits = _limits(signal)
    kind = OTHER
    if not signal.is_float and len(sna) < 2 and high < _TOP:
        kind = INT if signal.is_integer and _fits(signal) else FLOAT
    return SignalPlan(
        signal=signal,
        kept=kept,
        end=_end(signal),
        word=word,
        straddles=straddles,
        shift=shift,
        big=signal.big_endian and not straddles,
        kind=kind,
        sna=sna,
        limits=limits,
        named=() if limits is None else _named_outside(signal, limits, sna, low, high),
        ranges=signal.mux_ranges,
    )


def _raw_ends(signal: Signal) -> tuple[int, int]:
    if signal.signed:
        return -(2 ** (signal.length - 1)), 2 ** (signal.length - 1) - 1
    return 0, 2**signal.length - 1


def _fits(signal: Signal) -> bool:
    """64 signed bits hold the whole numbers that the signal can have."""
    factor, offset = int(signal.factor), int(signal.offset)
    bits = signal.length - signal.signed
    ends = [factor * (-(2**bits) if signal.signed else 0) + offset, factor * (2**bits - 1) + offset]
    if factor == 1 and offset == 0:
        return bits < 64
    return bool(min(*ends, offset, factor) >= -_TOP and max(*ends, offset, factor) < _TOP)


def _limits(signal: Signal) -> Limits | None:
    """Stated range, a little widened; None where there is none or no value can lie outside it."""
    low, high = _bound(signal.minimum, -math.inf), _bound(signal.maximum, math.inf)
    if (low == 0 and high == 0) or (low == -math.inf and high == math.inf):
        return None
    if signal.is_float:  # a range in decimal digits, values of half or single precision
        share = 1e-3 if signal.length == 16 else 1e-6
        return Limits(low - share * abs(low), high + share * abs(high))
    if not signal.is_integer:
        low, high = low - abs(float(signal.factor)) / 100, high + abs(float(signal.factor)) / 100
    ends = [raw * float(signal.factor) + float(signal.offset) for raw in _raw_ends(signal)]
    if low <= min(ends) and max(ends) <= high:
        return None
    return Limits(low, high)


def _named_outside(signal: Signal, limits: Limits, sna: tuple[int, ...], low: int, high: int) -> tuple[int, ...]:
    if signal.is_float:
        return ()
    exact = signal.is_integer and _fits(signal)
    factor: float = int(signal.factor) if exact else float(signal.factor)
    offset: float = int(signal.offset) if exact else float(signal.offset)
    return tuple(
        raw
        for raw in signal.choices
        if low <= raw <= high and raw not in sna and not limits.low <= raw * factor + offset <= limits.high
    )


def _bound(stated: float | None, none: float) -> float:
    try:
        return none if stated is None or not math.isfinite(stated) else float(stated)
    except OverflowError:  # a whole number beyond all floats
        return none


def _whole(limits: Limits) -> tuple[int, int]:
    """The range for whole numbers of 64 bits."""
    low = -_TOP if limits.low < -_TOP else min(math.ceil(limits.low), _TOP - 1)
    high = _TOP - 1 if limits.high >= _TOP else max(math.floor(limits.high), -_TOP)
    return low, high


def _numbers(plan: SignalPlan) -> tuple[list[int], list[float]]:
    signal = plan.signal
    mask = -1 if signal.length == 64 else (1 << signal.length) - 1
    sign = 1 << (signal.length - 1) if signal.signed and signal.length < 64 else 0
    flags = (COUNT_SNA if plan.sna else 0) | (COUNT_RANGE if plan.limits else 0)
    low, high = _whole(plan.limits) if plan.limits else (0, 0)
    whole = plan.kind == INT
    ints = [
        plan.shift, mask, sign, int(plan.big), plan.kind,
        int(signal.factor) if whole else 0, int(signal.offset) if whole else 0,
        low, high, plan.sna[0] if plan.sna else 0, flags,
    ]  # fmt: skip
    return ints, [float(signal.factor), float(signal.offset), *(plan.limits or (0.0, 0.0))]
