"""Summary of a log, in memory that does not grow with it: identifiers, cycle times, bus load, order of the stamps."""

import sys
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hil.log.frames import FD_CODES, FrameTable
from hil.log.summary.bus_time import BITS
from hil.log.summary.numpy_counts import count_rows
from hil.log.summary.state import CODES, Channel, Id, State, Whole, bin_edges
from hil.log.summary.values import Backwards, ChannelSummary, Cycle, IdSummary, Summary

FEW_FRAMES = 50_000  # a log of fewer is counted without the compiled pass where none is loaded, which takes 0.3 s
GAP = 2.5  # an interval longer than so many cycles is a gap
CYCLIC_SHARE = 0.8  # of the intervals within half a median of the median: such an identifier is sent cyclically
LEAST_SPAN_NS = 10_000_000  # shorter logs have no bus load
_PS = 1_000_000_000_000

BitRates = tuple[int | None, int | None]
"""Bit rate and data bit rate (CAN FD) of a channel, bit/s; None where unknown."""


class Statistics:
    """Counts the tables of a log.

    Parameters
    ----------
    bit_rates : of a channel, by its name.
    fast : False never uses the compiled pass, True always; None leaves small logs to numpy. Both count the same.
    """

    def __init__(self, bit_rates: Callable[[str], BitRates] = lambda _: (None, None), fast: bool | None = None) -> None:
        self._bit_rates = bit_rates
        self._fast = fast
        self._state = State()
        self._places: dict[int, int] = {}
        self._names: tuple[str, ...] = ()
        self._scratch = np.zeros(1)

    def add(self, table: FrameTable) -> None:
        """Count further frames; all tables share one channel numbering."""
        if self._fast is None and len(table):
            self._fast = len(table) >= FEW_FRAMES or "hil.log.compiled" in sys.modules
        self._know_channels(table.channels)
        if not self._fast:
            count_rows(table, self._state, self._places)
            return
        from hil.log.summary import compiled_counts as summary_pass

        s = self._state
        columns = table.time_ns, table.channel, table.can_id, table.extended, table.length, table.flags
        scratch = self._scratch, self._scratch.view(np.int64)
        summary_pass.count_rows(
            columns, s.whole, s.ids, s.keys, s.places, s.intervals, s.channels, s.bit_ps, BITS, CODES, *scratch
        )

    def _know_channels(self, names: tuple[str, ...]) -> None:
        new = names[len(self._names) :]
        if not new:
            return
        state = self._state
        self._names = names
        state.channels = np.vstack((state.channels, np.zeros((len(new), len(Channel)), np.int64)))
        state.bit_ps = np.vstack((state.bit_ps, [self._bit_ps(name) for name in new]))

    def _bit_ps(self, name: str) -> tuple[int, int]:
        rate, data_rate = self._bit_rates(name)
        if rate is None:
            return 1, 1  # then bits are counted, not their time
        return round(_PS / rate), round(_PS / (data_rate or rate))

    def result(self, nominal_ns: Callable[[str, int, bool], int | None] = lambda *_: None) -> Summary:
        """Summary of all frames so far; ``nominal_ns`` gives the stated cycle time by channel, identifier, extended."""
        whole = self._state.whole
        rows = [self._id(row, nominal_ns) for row in range(int(whole[Whole.IDS]))]
        order = {name: number for number, name in enumerate(sorted(set(self._names)))}
        rows.sort(key=lambda one: (order[one.channel], one.extended, one.can_id))
        channels = [self._channel(number) for number, of in enumerate(self._state.channels) if of[Channel.FRAMES]]
        back = int(whole[Whole.BACK])
        return Summary(
            frames=int(whole[Whole.FRAMES]),
            first_ns=int(whole[Whole.LEAST]),
            last_ns=int(whole[Whole.GREATEST]),
            channels=tuple(sorted(channels, key=lambda one: one.name)),
            ids=tuple(rows),
            other_frames=int(whole[Whole.OTHER]),
            backwards=Backwards(back, int(whole[Whole.BACK_FRAME]), int(whole[Whole.BACK_NS])) if back else None,
        )

    def _id(self, row: int, nominal_ns: Callable[[str, int, bool], int | None]) -> IdSummary:
        key = int(self._state.keys[row])
        one = [int(value) for value in self._state.ids[row]]
        channel, can_id, extended = self._names[key >> 32], key & 0x1FFF_FFFF, bool(key >> 31 & 1)
        back = one[Id.BACK]
        return IdSummary(
            channel=channel,
            can_id=can_id,
            extended=extended,
            count=one[Id.COUNT],
            first_ns=one[Id.FIRST],
            last_ns=one[Id.LAST],
            cycle=_cycle(one, self._state.intervals[row], nominal_ns(channel, can_id, extended)),
            lengths=tuple(length for code, length in enumerate(FD_CODES) if one[Id.LENGTHS] >> code & 1),
            length_changes=one[Id.LENGTH_CHANGES],
            backwards=Backwards(back, one[Id.BACK_FRAME], one[Id.BACK_NS]) if back else None,
            remote=one[Id.REMOTE],
            fd=one[Id.FD],
            sent=one[Id.SENT],
        )

    def _channel(self, number: int) -> ChannelSummary:
        of = [int(value) for value in self._state.channels[number]]
        name = self._names[number]
        rate, data_rate = self._bit_rates(name)
        known = rate is not None and (data_rate is not None or not of[Channel.SWITCHED])
        duration_ns = of[Channel.GREATEST] - of[Channel.LEAST]
        mean = of[Channel.BUSY] / duration_ns if duration_ns >= LEAST_SPAN_NS else None
        worst: float | None = None
        if mean is not None and duration_ns >= 1_000_000_000:  # a whole second
            worst = max(float(of[Channel.WORST_BUSY]), mean * 1e9)  # the mean has the begun last second too
        per_s = 1e9 if rate is None else rate / 1000.0
        return ChannelSummary(
            name=name,
            frames=of[Channel.FRAMES],
            first_ns=of[Channel.LEAST],
            last_ns=of[Channel.GREATEST],
            errors=of[Channel.ERRORS],
            remote=of[Channel.REMOTE],
            fd=of[Channel.FD],
            sent=of[Channel.SENT],
            bit_rate=rate,
            data_bit_rate=data_rate,
            load=None if mean is None or not known else mean / 1000,
            worst_load=None if worst is None or not known else worst / _PS,
            bits_per_s=None if mean is None or known else mean * per_s,
            worst_bits_per_s=None if worst is None or known else worst * per_s / 1e9,
            worst_at_ns=int(self._state.whole[Whole.FIRST]) + of[Channel.WORST] * 1_000_000_000,
        )


def _roundest(low: float, high: float) -> float:
    """Return the number with the fewest digits from ``low`` to below ``high``: cycle times are made round."""
    step = 10.0 ** np.floor(np.log10(high))
    while np.ceil(low / step) * step >= high:
        step /= 10
    middle = float(np.round((low + high) / 2 / step) * step)
    return middle if low <= middle < high else float(np.ceil(low / step) * step)


def _cycle(one: list[int], histogram: npt.NDArray[np.uint32], nominal_ns: int | None) -> Cycle | None:
    n = one[Id.INTERVALS]
    if not n:
        return None
    edges = bin_edges()
    sums = np.cumsum(histogram, dtype=np.int64)
    low, high = one[Id.MIN], one[Id.MAX]

    def percentile(share: float) -> float:
        place = int(np.searchsorted(sums, max(1, int(np.ceil(share * n)))))
        return float(np.clip(_roundest(float(edges[place]), float(edges[place + 1])), low, high))

    def longer(limit_ns: float) -> int:
        first = int(np.searchsorted(edges[:-1], limit_ns))
        return n - int(sums[first - 1]) if first > 0 else n

    median = percentile(0.5)
    gaps = None
    if nominal_ns is not None:
        gaps = longer(GAP * nominal_ns)
    elif longer(0.5 * median) - longer(1.5 * median) >= CYCLIC_SHARE * n and n > 2:
        gaps = longer(GAP * median)
    return Cycle(
        nominal_ns,
        low,
        median,
        percentile(0.99),
        high,
        min(max(one[Id.SUM] / n, float(low)), float(high)),
        gaps,
        one[Id.MAX_AT],
    )
