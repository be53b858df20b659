"""Bit errors: seeded, each bit alike and independent of the others."""

import math
from random import Random


class BitErrors:
    """Where the next wrong bit is; one draw per error instead of one per bit.

    Parameters
    ----------
    rate : probability that a bit is read wrong, 0 to below 1.
    seed : of the draws.
    """

    def __init__(self, rate: float, seed: str) -> None:
        if not 0.0 <= rate < 1.0:
            raise ValueError(f"bit error rate {rate}; expected a probability from 0 to below 1")
        self.rate = rate
        self._random = Random(seed)
        self._good_bits = self._draw()

    def _draw(self) -> float:
        """Good bits before the next wrong one: geometrically distributed."""
        if self.rate == 0.0:
            return math.inf
        return math.floor(math.log(1.0 - self._random.random()) / math.log1p(-self.rate))

    def within(self, bits: int) -> int | None:
        """Let ``bits`` pass: index of the first wrong one, None where all are good."""
        if self._good_bits >= bits:
            self._good_bits -= bits
            return None
        wrong, self._good_bits = int(self._good_bits), self._draw()
        return wrong
