"""Identifiers that no database knows, counted; only a bounded number of them is kept apart."""

from collections import Counter
from secrets import randbits

import numpy as np
import numpy.typing as npt

KEPT = 10_000
OTHERS = "other identifiers"
PLACES = 32_768

SEED = randbits(61)
"""Of the hash tables of this process."""


class UnknownIds:
    """Counts by (channel, identifier); the first `KEPT` of the log are told apart.

    Attributes
    ----------
    places, found, keys, counts : hash table, identifiers and counts for the compiled pass.
    kept : number of identifiers kept.
    """

    def __init__(self) -> None:
        self.places = np.full(PLACES, -1, np.int64)
        self.found = np.zeros(PLACES, np.int64)
        self.keys = np.zeros(KEPT, np.int64)
        self.counts = np.zeros(KEPT, np.int64)
        self.kept = 0
        self._entries: dict[int, int] = {}

    def add(self, keys: npt.NDArray[np.int64]) -> int:
        """Count frames, in the order of the log; return how many have an identifier that is not kept."""
        distinct, first, counts = np.unique(keys, return_index=True, return_counts=True)
        further = 0
        order = np.argsort(first)
        for key, count in zip(distinct[order].tolist(), counts[order].tolist(), strict=True):
            entry = self._entries.get(key)
            if entry is None:
                if self.kept >= KEPT:
                    further += count
                    continue
                entry = self._entries[key] = self.kept
                self.keys[entry] = key
                self.kept += 1
            self.counts[entry] += count
        return further

    def hashed(self) -> None:
        """Bring the hash table up to what `add` has counted; after this only the compiled pass counts."""
        from hil.log.signals.decode_pass import fill_hash

        if self._entries:
            numbers = np.arange(self.kept, dtype=np.int64)
            fill_hash(self.keys[: self.kept], numbers, SEED, self.places, self.found)
            self._entries = {}

    def take(self, channels: list[str], further: int) -> Counter[str]:
        """Counts of this table by name, and begin the next one."""
        names: Counter[str] = Counter()
        for entry in np.flatnonzero(self.counts[: self.kept]).tolist():
            key = int(self.keys[entry])
            can_id = key & 0x1FFF_FFFF
            name = f"{can_id:#010x}" if key >> 31 & 1 else f"{can_id:#05x}"
            names[f"{channels[key >> 32]} {name}"] = int(self.counts[entry])
        self.counts[: self.kept] = 0
        if further:
            names[OTHERS] = further
        return names
