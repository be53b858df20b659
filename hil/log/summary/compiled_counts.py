"""The compiled pass that counts frames for the summary; `hil.log.summary.numpy_counts` does exactly the same."""

import numpy as np

from hil.log.compiled import compiled
from hil.log.summary.state import FIRST_PLACE, HASH_SIZE, LEAST_NS, MAX_IDS, MOST_NS, SHIFT, Channel, Id, Whole

_REMOTE, _ERROR, _FD, _SWITCHED, _SENT = 1, 2, 4, 8, 32
_SECOND = 1_000_000_000
_MASK = HASH_SIZE - 1
_FRAMES, _PREVIOUS, _BACK, _BACK_FRAME = map(int, (Whole.FRAMES, Whole.PREVIOUS, Whole.BACK, Whole.BACK_FRAME))
_BACK_NS, _BACK_FROM, _OTHER, _IDS = map(int, (Whole.BACK_NS, Whole.BACK_FROM, Whole.OTHER, Whole.IDS))
_FIRST, _LEAST, _GREATEST = map(int, (Whole.FIRST, Whole.LEAST, Whole.GREATEST))
_C = tuple(int(c) for c in Channel)
_I = tuple(int(i) for i in Id)


@compiled
def count_rows(
    columns, whole, ids, keys, places, intervals, channels, bit_ps, frame_bits, codes, scratch, scratch_bits
):
    """Count the rows of one table.

    ``frame_bits`` is `hil.log.summary.bus_time.BITS`, ``codes`` `hil.log.summary.state.CODES`; ``scratch_bits`` is a
    view of ``scratch``, float64 (1,), as int64.
    """
    c_frames, c_errors, c_remote, c_fd, c_switched, c_sent, c_least, c_greatest = _C[:8]
    c_busy, c_second, c_second_busy, c_worst, c_worst_busy = _C[8:]
    i_count, i_first, i_last, i_data, i_previous, i_intervals, i_sum, i_min, i_max, i_max_at = _I[:10]
    i_back, i_back_frame, i_back_ns, i_length, i_changes, i_lengths, i_remote, i_fd, i_sent = _I[10:]
    times, channel, can_ids, extended, lengths, flags = columns
    for i in range(times.shape[0]):
        t = np.int64(times[i])
        c = np.int64(channel[i])
        bits = np.int64(flags[i])
        length = np.int64(lengths[i])
        if c < 0 or c >= channels.shape[0] or length > 64:
            continue
        if whole[_FRAMES] == 0:
            whole[_FIRST] = whole[_LEAST] = whole[_GREATEST] = whole[_PREVIOUS] = t
        whole[_FRAMES] += 1
        if t < whole[_PREVIOUS]:
            whole[_BACK] += 1
            if whole[_BACK] == 1:
                whole[_BACK_FRAME] = whole[_FRAMES]
                whole[_BACK_NS] = t
                whole[_BACK_FROM] = whole[_PREVIOUS]
        whole[_PREVIOUS] = t
        whole[_LEAST] = min(whole[_LEAST], t)
        whole[_GREATEST] = max(whole[_GREATEST], t)

        of = channels[c]
        if of[c_frames] == 0:
            of[c_least] = of[c_greatest] = t
            of[c_second] = (t - whole[_FIRST]) // _SECOND
        of[c_frames] += 1
        of[c_least] = min(of[c_least], t)
        of[c_greatest] = max(of[c_greatest], t)
        if bits & _SENT:
            of[c_sent] += 1
        if bits & _ERROR:
            of[c_errors] += 1
            continue
        kind = 4 if extended[i] else 0
        if bits & _REMOTE:
            of[c_remote] += 1
            kind += 1
        elif bits & _FD:
            kind += 3 if bits & _SWITCHED else 2
            if bits & _SWITCHED:
                of[c_switched] += 1
        if bits & _FD:
            of[c_fd] += 1
        busy = frame_bits[kind, length, 0] * bit_ps[c, 0] + frame_bits[kind, length, 1] * bit_ps[c, 1]
        of[c_busy] += busy
        second = (t - whole[_FIRST]) // _SECOND
        if second != of[c_second] and second != of[c_second] - 1:  # a frame a little late counts where it stands
            of[c_second] = second
            of[c_second_busy] = 0
        of[c_second_busy] += busy
        if of[c_second_busy] > of[c_worst_busy]:
            of[c_worst_busy] = of[c_second_busy]
            of[c_worst] = of[c_second]

        can_id = np.int64(can_ids[i])
        key = c << 32 | can_id
        if extended[i]:
            key |= 1 << 31
        place = ((can_id * 2654435761 >> 15) + c * 7 + kind // 4) & _MASK
        row = np.int64(-1)
        for _ in range(HASH_SIZE):
            held = np.int64(places[place])
            if held == 0:
                if whole[_IDS] < MAX_IDS:
                    row = whole[_IDS]
                    whole[_IDS] += 1
                    places[place] = row + 1
                    keys[row] = key
                break
            if keys[held - 1] == key:
                row = held - 1
                break
            place = (place + 1) & _MASK
        if row < 0:
            whole[_OTHER] += 1
            continue
        one = ids[row]
        if one[i_count] == 0:
            one[i_first] = t
        one[i_count] += 1
        one[i_last] = t
        if bits & _SENT:
            one[i_sent] += 1
        if bits & _FD:
            one[i_fd] += 1
        if bits & _REMOTE:
            one[i_remote] += 1
            continue
        one[i_lengths] |= 1 << codes[length]
        if one[i_data] > 0:
            if length != one[i_length]:
                one[i_changes] += 1
            interval = t - one[i_previous]
            if interval < 0:
                one[i_back] += 1
                if one[i_back] == 1:
                    one[i_back_frame] = whole[_FRAMES]
                    one[i_back_ns] = t
            else:
                if one[i_intervals] == 0 or interval < one[i_min]:
                    one[i_min] = interval
                if one[i_intervals] == 0 or interval > one[i_max]:
                    one[i_max] = interval
                    one[i_max_at] = one[i_previous]
                one[i_intervals] += 1
                one[i_sum] += interval
                scratch[0] = float(min(max(interval, LEAST_NS), MOST_NS))
                intervals[row, (scratch_bits[0] >> SHIFT) - FIRST_PLACE] += 1
        one[i_data] += 1
        one[i_length] = length
        one[i_previous] = t
