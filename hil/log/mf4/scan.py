"""Finds the records of an unsorted MDF 4 data group: each begins with the id of its group."""

import numpy as np
import numpy.typing as npt

END, UNKNOWN, FULL = 0, 1, 2


def scan_records(
    buffer: npt.NDArray[np.uint8],
    have: int,
    id_bytes: int,
    ids: npt.NDArray[np.uint64],
    sizes: npt.NDArray[np.int64],
    group: npt.NDArray[np.int32],
    begin: npt.NDArray[np.int64],
) -> tuple[int, int, int]:
    """Find whole records.

    Parameters
    ----------
    have : bytes of ``buffer`` that count.
    ids, sizes : ascending ids of the groups, and the bytes of their records; -1 for values of variable length, which
        begin with 4 bytes of length.
    group, begin : written; number (in ``ids``) of each record's group, and where it begins behind its id.

    Returns
    -------
    number of records, where the first byte that is in none of them stands, and why it stopped: `END` of the whole
    records, `UNKNOWN` id, `FULL` arrays.
    """
    n = 0
    at = 0
    last = 0
    while at + id_bytes <= have:
        value = np.uint64(0)
        for k in range(id_bytes):
            value |= np.uint64(buffer[at + k]) << np.uint64(8 * k)
        if ids[last] != value:
            low, high = 0, len(ids)
            while low < high:
                middle = (low + high) // 2
                if ids[middle] < value:
                    low = middle + 1
                else:
                    high = middle
            if low >= len(ids) or ids[low] != value:
                return n, at, UNKNOWN
            last = low
        first = at + id_bytes
        size = sizes[last]
        if size < 0:
            if first + 4 > have:
                return n, at, END
            size = np.int64(0)
            for k in range(4):
                size |= np.int64(buffer[first + k]) << np.int64(8 * k)
            size += 4
        if first + size > have:
            return n, at, END
        if n >= len(group):
            return n, at, FULL
        group[n] = last
        begin[n] = first
        n += 1
        at = first + size
    return n, at, END
