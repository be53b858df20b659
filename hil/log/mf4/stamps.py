"""Stamps of the records of an MDF 4 file: whole nanoseconds, exact wherever the file holds whole ticks."""

import numpy as np
import numpy.typing as npt

from hil.log.mf4.fields import Bytes, Mask, unsigned
from hil.log.mf4.layout import VIRTUAL_MASTER, Member

Stamps = npt.NDArray[np.int64]
MAX_SECONDS = 1 << 34  # of a tick, and of the first one
MAX_NS = 1 << 62  # farther from the start than any log (146 years)


def is_time(master: Member, size: int) -> bool:
    """A channel can be read as the time, out of records of ``size`` bytes."""
    if not master.linear or abs(master.factor) > MAX_SECONDS or abs(master.offset) > MAX_SECONDS:
        return False
    if master.kind == VIRTUAL_MASTER:
        return True
    if master.floating:
        return master.bit == 0 and master.bits in (16, 32, 64) and master.byte + master.bits // 8 <= size
    whole = master.data_type <= 3 and master.bits >= 1 and master.bit + master.bits <= 64
    return whole and master.byte + (master.bit + master.bits + 7) // 8 <= size


class Clock:
    """Turns the raw time of records into stamps.

    Parameters
    ----------
    master : channel of the time, for which `is_time` holds.
    start_ns : start time of the file.
    """

    def __init__(self, master: Member, start_ns: int) -> None:
        self.master = master
        self.start_ns = start_ns
        self.factor = master.factor * 10**9
        self.offset = master.offset * 10**9

    def stamps(self, records: Bytes, first: int) -> tuple[Stamps, Mask]:
        """Stamps of records, and which of them can be one; ``first`` is the number of records before."""
        master, n = self.master, len(records)
        good = np.ones(n, np.bool_)
        if master.kind == VIRTUAL_MASTER:
            return self._whole(np.arange(first, first + n, dtype=np.int64), good)
        if master.floating:
            return self._floating(records)
        raw = unsigned(records, master)
        if master.data_type in (2, 3):
            spare = 64 - master.bits
            ticks = (raw.astype(np.uint64) << np.uint64(spare)).view(np.int64) >> np.int64(spare)
        else:
            if raw.dtype == np.uint64:
                good = raw < np.uint64(2**63)
            ticks = raw.astype(np.int64)
        return self._whole(ticks, good)

    def _floating(self, records: Bytes) -> tuple[Stamps, Mask]:
        """Seconds as floating-point numbers, rounded to the nanosecond."""
        master = self.master
        size = master.bits // 8
        order = "<" if master.data_type == 4 else ">"
        raw = records[:, master.byte : master.byte + size].view(f"{order}f{size}")
        seconds = raw[:, 0].astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            if master.factor != 1 or master.offset:
                seconds = seconds * float(master.factor) + float(master.offset)
            return self._rounded(np.rint(seconds * 1e9), np.ones(len(records), np.bool_))

    def _whole(self, ticks: Stamps, good: Mask) -> tuple[Stamps, Mask]:
        """Start + offset + ticks * factor, in whole numbers where numerator and denominator of the factor are small."""
        base = self.start_ns + round(self.offset)
        top, bottom = self.factor.numerator, self.factor.denominator
        if top == bottom:
            good = good & (ticks >= -(2**63) - min(0, base)) & (ticks <= 2**63 - 1 - max(0, base))
            return np.where(good, ticks, 0) + base, good
        if bottom >= 2**31 or abs(top) >= 2**31:
            scale = np.longdouble(float(self.factor))
            return self._rounded(np.rint(ticks * scale + np.longdouble(float(self.offset))), good)
        bound = MAX_NS * bottom // max(1, abs(top)) - 1
        if bound < 2**63:
            good = good & (ticks >= -bound) & (ticks <= bound)
        whole, rest = np.divmod(np.where(good, ticks, 0), bottom)
        return whole * top + (rest * top + bottom // 2) // bottom + base, good

    def _rounded(self, ns: npt.NDArray[np.floating], good: Mask) -> tuple[Stamps, Mask]:
        good = good & (np.abs(ns) < float(MAX_NS))
        return np.where(good, ns, 0).astype(np.int64) + self.start_ns, good
