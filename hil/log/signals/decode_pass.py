"""Compiled passes of decoding: frames into message order, and signals out of words.

Words are int64 throughout, so that shifts and masks give the same compiled and uncompiled.
"""

import numpy as np

from hil.log.compiled import compiled, inlined

_REMOTE, _ERROR = 1, 2
_TP_CM, _TP_DT = 0xEC00, 0xEB00
_CHUNK = 1024


@inlined
def _hash(key, seed, mask):
    """Place of a key; the seed is drawn anew in each process, so that no log can be made to collide."""
    x = (key ^ seed) & 0x3FFF_FFFF_FFFF_FFFF
    x = ((x ^ (x >> 29)) * 0x2545_F491) & 0x3FFF_FFFF_FFFF_FFFF
    x = ((x ^ (x >> 32)) * 0x1C69_B3F7) & 0x3FFF_FFFF_FFFF_FFFF
    return (x ^ (x >> 27)) & mask


@inlined
def _swapped(x):
    """The word with its bytes in reverse order."""
    x = ((x & 0x00FF00FF00FF00FF) << 8) | ((x >> 8) & 0x00FF00FF00FF00FF)
    x = ((x & 0x0000FFFF0000FFFF) << 16) | ((x >> 16) & 0x0000FFFF0000FFFF)
    return (x << 32) | ((x >> 32) & 0x00000000FFFFFFFF)


@compiled
def fill_hash(keys, values, seed, places, found):
    """Fill an open-addressing table (``places`` all -1, a power of two, at least twice as long as ``keys``)."""
    mask = places.shape[0] - 1
    for i in range(keys.shape[0]):
        at = _hash(int(keys[i]), int(seed), mask)
        while places[at] >= 0:
            at = (at + 1) & mask
        places[at] = keys[i]
        found[at] = values[i]


@inlined
def _take_note(per_slot, slot, n, number):
    """Count a frame of another length than the database says, and see whether it came on a new channel."""
    if n < per_slot[slot, 0]:
        per_slot[slot, 4] += 1
        per_slot[slot, 3] = min(per_slot[slot, 3], n)
    elif n > per_slot[slot, 1]:
        per_slot[slot, 5] += 1
    if number != per_slot[slot, 6]:
        per_slot[slot, 6] = number if per_slot[slot, 6] == -1 else -2


@inlined
def _identifiers(ids, wide, flags, found):
    """Standard identifiers of data frames, 2048 for all other frames."""
    for i in range(found.shape[0]):
        found[i] = min(ids[i], np.uint32(2048))
    for i in range(found.shape[0]):
        if (flags[i] & np.uint8(_ERROR | _REMOTE)) | np.uint8(wide[i]):
            found[i] = 2048


@compiled
def assign_standard(columns, channels, dense, per_slot, slots, left, totals):
    """Find the slot of every data frame with a standard identifier that a message has, and count.

    Parameters
    ----------
    columns : time_ns, channel, can_id, extended, length, flags of the frames.
    channels : network and number of each channel; -1 for a network without databases.
    dense : slot by network and standard identifier (networks, 2048), -1 for none.
    per_slot : int64 (slots, 7): length and most bytes by the database; filled in: count, least length, shorter,
        longer; channel of the first frame (-1 before it), or -2 where there are several, kept between tables.
    slots : filled in, one a frame; -1 for all other frames.
    left : filled in: rows of all other frames.
    totals : filled in: stamps that run back, number of rows left.

    Returns
    -------
    The first row whose channel is none, or -1.
    """
    times, channel, ids, wide, length, flags = columns
    networks, numbers = channels
    back, others = 0, 0
    for i in range(1, times.shape[0]):
        back += times[i] < times[i - 1]
    for begin in range(0, times.shape[0], _CHUNK):
        end = min(begin + _CHUNK, times.shape[0])
        here, found = channel[begin:end], slots[begin:end]
        different = 0
        for i in range(end - begin):
            different |= int(here[i]) ^ int(here[0])
        c = int(here[0])
        if different == 0 and c >= 0 and c < networks.shape[0] and networks[c] >= 0:
            _identifiers(ids[begin:end], wide[begin:end], flags[begin:end], found)
            number, row, lengths = numbers[c], dense[networks[c]], length[begin:end]
            for k in range(end - begin):
                j = np.uint64(k)
                slot = -1
                if found[j] < 2048:
                    slot = int(row[np.uint64(found[j])])
                found[j] = slot
                if slot < 0:
                    left[others] = begin + k
                    others += 1
                    continue
                at, n = np.uint64(slot), int(lengths[j])
                per_slot[at, 2] += 1
                if n != per_slot[at, 0] or number != per_slot[at, 6]:
                    _take_note(per_slot, at, n, number)
            continue
        for i in range(begin, end):
            c = int(channel[i])
            if c < 0 or c >= networks.shape[0]:
                return i
            slot = -1
            if networks[c] >= 0 and not flags[i] & (_ERROR | _REMOTE) and not wide[i] and ids[i] < 2048:
                slot = int(dense[networks[c], ids[i]])
            slots[i] = slot
            if slot < 0:
                left[others] = i
                others += 1
                continue
            per_slot[slot, 2] += 1
            if length[i] != per_slot[slot, 0] or numbers[c] != per_slot[slot, 6]:
                _take_note(per_slot, slot, int(length[i]), numbers[c])
    totals[0] = back
    totals[1] = others
    return -1


@compiled
def assign_left(left, columns, channels, tables, unknown, per_slot, slots, totals):
    """Find the slot of the other frames, and count; parameters as of `assign_standard`.

    Parameters
    ----------
    left : rows of these frames.
    tables : places, found, seed of the hash table of keys; j1939 by network.
    unknown : places, found, keys, counts of the identifiers that no database knows; kept between tables.
    slots : filled in; -1 for a frame that no message and no transfer has, count of slots for a transfer.
    totals : filled in: errors, remotes, unknown, transport frames, unknown of further identifiers, number of unknown
        identifiers kept (kept between tables).
    """
    _, channel, ids, wide, length, flags = columns
    networks, numbers = channels
    places, found, seed, j1939 = tables
    unknown_places, unknown_found, unknown_keys, unknown_counts = unknown
    mask, unknown_mask = places.shape[0] - 1, unknown_places.shape[0] - 1
    transfer, limit, kept = per_slot.shape[0], unknown_keys.shape[0], int(totals[5])
    errors, remotes, strangers, transports, further = 0, 0, 0, 0, 0
    for k in range(left.shape[0]):
        i = left[k]
        if flags[i] & (_ERROR | _REMOTE):
            if flags[i] & _ERROR:
                errors += 1
            else:
                remotes += 1
            continue
        c = int(channel[i])
        network, can_id = int(networks[c]), int(ids[i])
        slot = -1
        if network >= 0 and wide[i]:
            for kind in range(3 if j1939[network] else 1):
                value = can_id
                if kind == 1:
                    value = can_id & 0x3FF_FFFF
                elif kind == 2:
                    value = (can_id >> 8) & 0x3FFFF
                    if (value >> 8) & 0xFF < 240:
                        value &= 0x3FF00
                key = network << 34 | kind << 32 | value
                at = _hash(key, int(seed), mask)
                while places[at] >= 0 and places[at] != key:
                    at = (at + 1) & mask
                if places[at] >= 0:
                    slot = int(found[at])
                    break
            if slot < 0 and j1939[network]:
                value = (can_id >> 8) & 0x3FF00
                if value in (_TP_CM, _TP_DT):
                    slots[i] = transfer
                    transports += 1
                    continue
        if slot >= 0:
            slots[i] = slot
            per_slot[slot, 2] += 1
            _take_note(per_slot, slot, int(length[i]), numbers[c])
            continue
        strangers += 1
        key = int(numbers[c]) << 32 | can_id
        if wide[i]:
            key |= 1 << 31
        at = _hash(key, int(seed), unknown_mask)
        while unknown_places[at] >= 0 and unknown_places[at] != key:
            at = (at + 1) & unknown_mask
        if unknown_places[at] >= 0:
            unknown_counts[unknown_found[at]] += 1
        elif kept < limit:
            unknown_places[at] = key
            unknown_found[at] = kept
            unknown_keys[kept] = key
            unknown_counts[kept] = 1
            kept += 1
        else:
            further += 1
    totals[0] = errors
    totals[1] = remotes
    totals[2] = strangers
    totals[3] = transports
    totals[4] = further
    totals[5] = kept


@compiled
def scatter(slots, words, stride, position, rows, first):
    """Sort frames by slot (stable): row numbers, and the first word of each.

    ``position`` holds where each slot begins and is moved on; ``words`` has ``stride`` words a frame.
    """
    if slots.shape[0] * stride > words.shape[0]:
        return
    # unsigned, since an index that could be negative costs a branch each
    slot_end, end = np.uint64(position.shape[0]), np.uint64(min(rows.shape[0], first.shape[0]))
    for k in range(slots.shape[0]):
        i = np.uint64(k)
        if slots[i] < 0:
            continue
        slot = np.uint64(slots[i])
        if slot < slot_end:
            at = np.uint64(position[slot])
            if at >= end:
                return
            position[slot] = int(at) + 1
            rows[at] = k
            first[at] = words[i * np.uint64(stride)]


@compiled
def extract(words, jobs, ints, floats, as_int, as_float, counts, scratch):
    """Cut signals out of words.

    Parameters
    ----------
    words : int64.
    jobs : int64 (n, 4): row of ``ints`` and ``floats``, first word, number of words, first place in the output.
    ints : shift, mask, sign bit, swap, kind, factor, offset, low, high, raw value "not available", flags.
    floats : factor, offset, low, high.
    as_int, as_float : one output, seen as int64 and as float64.
    counts : filled in (n, 2): values not available, values out of range.
    scratch : int64 (1024,).

    Returns
    -------
    Number of jobs done; a job outside of its arrays ends the pass.
    """
    for j in range(jobs.shape[0]):
        s, begin, n, out = jobs[j, 0], jobs[j, 1], jobs[j, 2], jobs[j, 3]
        if s < 0 or s >= ints.shape[0] or n < 0 or begin < 0 or begin + n > words.shape[0]:
            return j
        if out < 0 or out + n > as_int.shape[0]:
            return j
        shift, mask, sign, swap, kind = ints[s, 0], ints[s, 1], ints[s, 2], ints[s, 3], ints[s, 4]
        absent, bad = 0, 0
        for chunk in range(0, n, _CHUNK):
            m = min(_CHUNK, n - chunk)
            # slices, since an index that is a sum could be negative, which keeps a loop from being vectorised
            source = words[begin + chunk : begin + chunk + m]
            whole_out = as_int[out + chunk : out + chunk + m]
            float_out = as_float[out + chunk : out + chunk + m]
            raw = scratch[:m]
            if swap:
                for i in range(m):
                    raw[i] = (((_swapped(source[i]) >> shift) & mask) ^ sign) - sign
            else:
                for i in range(m):
                    raw[i] = (((source[i] >> shift) & mask) ^ sign) - sign
            if kind == 0:
                factor, offset = floats[s, 0], floats[s, 1]
                for i in range(m):
                    float_out[i] = float(raw[i]) * factor + offset
            else:
                whole, start = ints[s, 5], ints[s, 6]
                for i in range(m):
                    whole_out[i] = raw[i] * whole + start
            flags, none = ints[s, 10], ints[s, 9]
            here, outside = 0, 0
            if flags & 1:
                for i in range(m):
                    if raw[i] == none:
                        here += 1
                absent += here
            if flags & 2:
                if kind == 0:
                    low, high = floats[s, 2], floats[s, 3]
                    for i in range(m):
                        v = float_out[i]
                        if v < low or v > high:
                            outside += 1
                    if here and outside:
                        for i in range(m):
                            v = float_out[i]
                            if raw[i] == none and (v < low or v > high):
                                outside -= 1
                else:
                    least, most = ints[s, 7], ints[s, 8]
                    for i in range(m):
                        w = whole_out[i]
                        if w < least or w > most:
                            outside += 1
                    if here and outside:
                        for i in range(m):
                            w = whole_out[i]
                            if raw[i] == none and (w < least or w > most):
                                outside -= 1
                bad += outside
        counts[j, 0] = absent
        counts[j, 1] = bad
    return jobs.shape[0]


@compiled
def leave_out(words, numbers, values, rows, kept):
    """Leave out the values that are not available.

    Parameters
    ----------
    words : int64 (n,), the words of one signal.
    numbers : its row of ``ints``, see `extract`.
    values : int64 (n,), moved together in place.
    rows, kept : int64 (n,), the frames, and filled in: those that stay.

    Returns
    -------
    Number of values that stay.
    """
    shift, mask, sign, swap, none = numbers[0], numbers[1], numbers[2], numbers[3], numbers[9]
    n = min(min(words.shape[0], values.shape[0]), min(rows.shape[0], kept.shape[0]))
    k = np.uint64(0)
    for j in range(n):
        i = np.uint64(j)
        word = _swapped(words[i]) if swap else words[i]
        values[k] = values[i]
        kept[k] = rows[i]
        k += np.uint64((((word >> shift) & mask) ^ sign) - sign != none)
    return int(k)
