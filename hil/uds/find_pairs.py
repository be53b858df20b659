"""Finds connections of diagnostics in a log by what is said on them, whatever their identifiers.

All frames of such an identifier are ISO-TP, so the first frame that is none rules it out; that leaves hardly any of the
cyclic messages. Two of the rest are a connection when one answers a request of the other: the service's answer, with
the request's sub-function or identifier repeated, or its refusal, within P2* of the standard (5 s).
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameFlag, FrameTable
from hil.uds.addresses import Identifier, keys_of, standard_keys
from hil.uds.names import NEGATIVE_RESPONSE, REPEATED, RESPONSE_OFFSET, SERVICES, SUPPRESS_BIT, WITH_SUBFUNCTION

ANSWER_WITHIN_NS = 5_000_000_000  # P2* of ISO 14229-2
_CHANNEL_SHIFT = 32
_SHOWN = 5  # bytes of a message that are looked at: service and what an answer repeats


class _Asked(NamedTuple):
    time_ns: int
    key: int
    repeated: bytes


class PairFinder:
    """Takes the frames of a log and tells the connections that it met, beside the standard ones.

    Parameters
    ----------
    sign : an identifier that is looked for.
    own : identifiers of diagnostics that are known.

    Attributes
    ----------
    signed, strange : channels with frames of it; channels with frames that are no diagnostics.
    """

    def __init__(self, sign: Identifier | None = None, own: Iterable[Identifier] = ()) -> None:
        self.signed: set[str] = set()
        self.strange: set[str] = set()
        self._sign = -1 if sign is None else sign.key
        self._own = np.array([one.key for one in own], np.int64)
        self._ruled_out: set[int] = set()  # channel and key in one number
        self._asked: dict[tuple[int, int], _Asked] = {}
        self._pairs: dict[tuple[int, int], None] = {}
        # answer code of every first byte: service asked for (1..), answered (negative), nothing (0)
        self._meaning = np.zeros(256, np.int16)
        for service in SERVICES:
            self._meaning[service] = service
            self._meaning[service + RESPONSE_OFFSET] = -service
        self._meaning[NEGATIVE_RESPONSE] = -NEGATIVE_RESPONSE

    def pairs(self) -> list[tuple[Identifier, Identifier]]:
        """Connections found: request and answer."""
        found = {
            (Identifier.of_key(request & 0x3FFF_FFFF), Identifier.of_key(answer & 0x3FFF_FFFF)): None
            for request, answer in self._pairs
            if request not in self._ruled_out and answer not in self._ruled_out
        }
        return list(found)

    def take(self, tables: Iterable[FrameTable]) -> None:
        """Look through frames in order."""
        for table in tables:
            if len(table):
                self._take(table)

    def _take(self, table: FrameTable) -> None:
        keys = keys_of(table.can_id, table.extended)
        data_frame = (table.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)) == 0
        other = data_frame & ~standard_keys(keys)
        rows = np.flatnonzero(other)
        sign = keys == self._sign
        for mask, names in ((other & sign, self.signed), (other & ~sign & ~np.isin(keys, self._own), self.strange)):
            names.update(table.channels[k] for k in np.unique(table.channel[mask]).tolist())
        both = keys[rows] | table.channel[rows].astype(np.int64) << _CHANNEL_SHIFT
        if self._ruled_out:
            kept = ~np.isin(both, np.fromiter(self._ruled_out, np.int64))
            rows, both = rows[kept], both[kept]
        is_frame, place = _framing(table.data[rows], table.length[rows].astype(np.int64))
        self._ruled_out.update(np.unique(both[~is_frame]).tolist())
        first = table.data[rows, np.maximum(place, 0)]
        meaning = np.where(place > 0, self._meaning[first], 0)
        spoken = np.flatnonzero(meaning)
        if not len(spoken):
            return
        spoken = spoken[~np.isin(both[spoken], np.fromiter(self._ruled_out, np.int64, len(self._ruled_out)))]
        for k in spoken.tolist():
            row, at = int(rows[k]), int(place[k])
            message = table.data[row, at : min(at + _SHOWN, int(table.length[row]))].tobytes()
            self._hear(int(table.time_ns[row]), int(both[k]), int(meaning[k]), message)

    def _hear(self, time_ns: int, key: int, meaning: int, message: bytes) -> None:
        channel = key >> _CHANNEL_SHIFT
        if meaning > 0:
            repeated = bytearray(message[1 : 1 + REPEATED.get(meaning, 0)])
            if repeated and meaning in WITH_SUBFUNCTION:
                repeated[0] &= ~SUPPRESS_BIT
            self._asked[channel, meaning] = _Asked(time_ns, key, bytes(repeated))
            return
        refused = -meaning == NEGATIVE_RESPONSE
        if refused and len(message) < 3:
            return
        asked = self._asked.get((channel, message[1] if refused else -meaning))
        if asked is None or asked.key == key or not 0 <= time_ns - asked.time_ns <= ANSWER_WITHIN_NS:
            return
        if refused or message[1 : 1 + len(asked.repeated)] == asked.repeated:
            self._pairs[asked.key, key] = None


def _framing(
    data: npt.NDArray[np.uint8], length: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
    """Whether each frame can be one of ISO-TP, and where its message begins (0 where none does)."""
    head, low = data[:, 0] >> 4, (data[:, 0] & 0xF).astype(np.int64)
    second = data[:, 1].astype(np.int64)
    long = length > 8
    single = (head == 0) & np.where(
        long, (low == 0) & (second > 0) & (second <= length - 2), (low > 0) & (low <= length - 1)
    )
    first = (head == 1) & (length >= 8)
    escaped = first & (low == 0) & (second == 0)
    following = (head == 2) & (length > 1)
    flow = (head == 3) & (low <= 2) & (length >= 3)
    place = np.where(single, np.where(long, 2, 1), np.where(escaped, 6, np.where(first, 2, 0)))
    return single | first | following | flow, place.astype(np.int64)
