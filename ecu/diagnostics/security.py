"""SecurityAccess: seed and key. A teaching example: the key follows from the seed by a published rule.

key = (seed XOR 0x4252414B) rotated left by 7 bits, plus 0x45, all in 32 bits, big endian. It keeps a tester from
writing by mistake, and nobody else.
"""

import zlib

from ecu.diagnostics.protocol import Nrc, Refused, expect_length

MOST_ATTEMPTS = 3  # choice, usual: wrong keys before the delay
DELAY_NS = 10_000_000_000  # choice, usual: before the next seed after that
REQUEST_SEED, SEND_KEY = 0x01, 0x02
_SECRET, _ADDED, _TURN = 0x4252414B, 0x45, 7
_WORD = 0xFFFF_FFFF


def key_of(seed: bytes) -> bytes:
    """Key that belongs to a seed of 4 bytes."""
    mixed = int.from_bytes(seed, "big") ^ _SECRET
    turned = (mixed << _TURN | mixed >> 32 - _TURN) & _WORD
    return ((turned + _ADDED) & _WORD).to_bytes(4, "big")


class Security:
    """Lock of one level; wrong keys are counted over sessions and resets."""

    def __init__(self) -> None:
        self.unlocked = False
        self._seed: bytes | None = None
        self._seeds = 0
        self._wrong = 0
        self._locked_until_ns = 0

    def lock(self) -> None:
        """Lock again, as at each change of the session."""
        self.unlocked, self._seed = False, None

    def serve(self, now_ns: int, request: bytes) -> bytes:
        """Answer to a request of either kind, from its sub-function on."""
        if request[1] & 0x7F == REQUEST_SEED:
            expect_length(request, 2)
            return bytes((REQUEST_SEED,)) + self._new_seed(now_ns)
        expect_length(request, 6)
        if self._seed is None:
            raise Refused(Nrc.REQUEST_SEQUENCE_ERROR)
        seed, self._seed = self._seed, None
        if request[2:] == key_of(seed):
            self.unlocked, self._wrong = True, 0
            return bytes((SEND_KEY,))
        self._wrong += 1
        if self._wrong < MOST_ATTEMPTS:
            raise Refused(Nrc.INVALID_KEY)
        self._wrong, self._locked_until_ns = 0, now_ns + DELAY_NS
        raise Refused(Nrc.EXCEEDED_NUMBER_OF_ATTEMPTS)

    def _new_seed(self, now_ns: int) -> bytes:
        if now_ns < self._locked_until_ns:
            raise Refused(Nrc.REQUIRED_TIME_DELAY_NOT_EXPIRED)
        if self.unlocked:
            return bytes(4)  # as the standard says
        self._seeds += 1
        # another one each time, the same again in a run of the same course
        word = zlib.crc32(f"{now_ns} {self._seeds}".encode()) or 1
        self._seed = word.to_bytes(4, "big")
        return self._seed
