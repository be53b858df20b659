"""The compiled pass over candump's screen form: data frames with a stamp; all other lines are left."""

import numpy as np

from hil.log.compiled import HEX, NO_BYTE, NO_DIGIT, byte_of, compiled, inlined

MAX_LINE = 4096
MAX_NS = 4_000_000_000_000_000_000
_MAX_SECONDS = 4_000_000_000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_FD, _SWITCH, _STATE, _SENT = 4, 8, 16, 32


@inlined
def _blanks(buffer, p, size):
    """Behind blanks; -1 where there is none."""
    begin = p
    while p < size and buffer[p] == 32:
        p += 1
    return p if p > begin and p < size else -1


@compiled
def take_lines(buffer, begin, delta, state, names, name_lengths, columns, n):
    """Add frames of lines; see `hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`.

    ``delta`` tells that stamps of less than ten digits are distances. ``state`` is changed: their sum (ns); behind
    which row the first such stamp, and the first CAN FD frame without ``-x``, was met (0 for none).
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    channel, p, total = 0, begin, state[0]
    while p < size and n < rows:
        if buffer[p] == 10:
            p += 1
            continue
        start, taken = p, False
        while True:  # left by a break where the line is not taken
            while p < size and buffer[p] == 32:
                p += 1
            if p >= size or buffer[p] != 40:  # (
                break
            p += 1
            seconds, digits = 0, 0
            while p < size and digits < 11 and 48 <= buffer[p] <= 57:
                seconds = seconds * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0 or digits > 10 or seconds > _MAX_SECONDS or p >= size or buffer[p] != 46:
                break
            absolute = digits == 10
            p += 1
            fraction, digits = 0, 0
            while p < size and digits < 9 and 48 <= buffer[p] <= 57:
                fraction = fraction * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0 or p >= size or buffer[p] != 41:
                break
            for _ in range(9 - digits):
                fraction *= 10
            time_ns = seconds * 1_000_000_000 + fraction
            if not absolute:
                if total > MAX_NS:
                    break
                if delta:
                    time_ns += total
            p = _blanks(buffer, p + 1, size)
            if p < 0:
                break
            found = -1
            for k in range(names.shape[0]):  # the channel of the line before is tried first
                candidate = channel if k == 0 else (k - 1 if k <= channel else k)
                length = name_lengths[candidate]
                if length > 0 and p + length < size and buffer[p + length] == 32:
                    same = True
                    for j in range(length):
                        if buffer[p + j] != names[candidate, j]:
                            same = False
                            break
                    if same:
                        found = candidate
                        p += length
                        break
            if found < 0:
                break
            p = _blanks(buffer, p, size)
            if p < 0 or p + 9 >= size:
                break
            bits, shown = 0, False
            if buffer[p + 1] == 88 and (buffer[p] == 82 or buffer[p] == 84) and buffer[p + 2] == 32:  # RX, TX
                shown = True
                if buffer[p + 4] != 32 or buffer[p + 6] != 32:
                    break
                if buffer[p] == 84:
                    bits |= _SENT
                if buffer[p + 3] == 66:
                    bits |= _SWITCH
                elif buffer[p + 3] != 45:
                    break
                if buffer[p + 5] == 69:
                    bits |= _STATE
                elif buffer[p + 5] != 45:
                    break
                p = _blanks(buffer, p + 6, size)
                if p < 0:
                    break
            can_id, digits = 0, 0
            while p < size and digits < 9 and HEX[buffer[p]] < NO_DIGIT:
                can_id = can_id << 4 | int(HEX[buffer[p]])
                p += 1
                digits += 1
            extended = digits == 8
            if (not extended and digits != 3) or can_id > (_MAX_EXTENDED if extended else _MAX_STANDARD):
                break
            p = _blanks(buffer, p, size)
            if p < 0 or p + 4 >= size or buffer[p] != 91:  # [
                break
            p += 1
            count, digits = 0, 0
            while digits < 2 and 48 <= buffer[p] <= 57:
                count = count * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0 or buffer[p] != 93:  # ]
                break
            if digits == 2:
                bits |= _FD
                if count > 8 and count not in (12, 16, 20, 24, 32, 48, 64):
                    break
            elif count > 8:
                break
            else:
                bits &= _SENT
            p += 1
            if count > width or p + 3 * count + 1 >= size:  # the builder must widen first
                break
            if count:
                if buffer[p] != 32:
                    break
                p += 1
                wrong = 0
                for j in range(count):
                    byte = byte_of(buffer, p + 1)
                    wrong |= (byte & NO_BYTE) | (np.int64(buffer[p]) ^ 32)
                    data[n, j] = byte & 255
                    p += 3
                if wrong:
                    break
            for j in range(count, width):
                data[n, j] = 0
            ended = p
            while p < size and buffer[p] == 32:
                p += 1
            if p > ended and p < size and buffer[p] == 39:  # '
                while p < size and buffer[p] != 10:
                    p += 1
            elif p < size and buffer[p] == 13:
                p += 1
            if p >= size or buffer[p] != 10 or p - start > MAX_LINE:
                break
            taken = True
            break
        if not taken:
            state[0] = total
            return start, n
        p += 1
        channel = found
        if not absolute:
            state[1] = state[1] if state[1] else n + 1
            total = time_ns if delta else total
        if bits & _FD and not shown:
            state[2] = state[2] if state[2] else n + 1
        times[n] = time_ns
        channels[n] = channel
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    state[0] = total
    return p, n
