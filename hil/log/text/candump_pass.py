"""The compiled pass over candump lines: those of the plain form, everything odd is left to the careful parser."""

import numpy as np

from hil.log.compiled import HEX, NO_BYTE, NO_DIGIT, are_digits, byte_of, compiled, inlined, of_digits, word

_ERROR_BIT = 0x2000_0000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_MAX_SECONDS = 9_000_000_000
_REMOTE, _ERROR, _FD, _SENT = 1, 2, 4, 32
_QUICK = 64  # bytes that the plainest line does not exceed
_TWO_BYTES, _TWO_ZEROS = np.uint64(16), np.uint64(0x3030)


@inlined
def _stamp(buffer, p, size):
    """Nanoseconds of ``(s.f) ``, and what follows; -1 where it is another form."""
    if p + _QUICK <= size and buffer[p + 11] == 46 and buffer[p + 18] == 41 and buffer[p + 19] == 32:
        first, last = word(buffer, p + 1), word(buffer, p + 12) << _TWO_BYTES | _TWO_ZEROS
        ninth, tenth = int(buffer[p + 9]) - 48, int(buffer[p + 10]) - 48
        if are_digits(first) and are_digits(last) and 0 <= ninth <= 9 and 0 <= tenth <= 9:
            seconds = of_digits(first) * 100 + ninth * 10 + tenth
            if seconds <= _MAX_SECONDS:
                return seconds * 1_000_000_000 + of_digits(last) * 1000, p + 20
        return -1, p
    p += 1
    seconds, digits = 0, 0
    while p < size and 48 <= buffer[p] <= 57 and digits < 10:
        seconds = seconds * 10 + (int(buffer[p]) - 48)
        p += 1
        digits += 1
    if digits == 0 or seconds > _MAX_SECONDS or p + 2 >= size or buffer[p] != 46:
        return -1, p
    p += 1
    fraction, digits = 0, 0
    while p < size and 48 <= buffer[p] <= 57 and digits < 9:
        fraction = fraction * 10 + (int(buffer[p]) - 48)
        p += 1
        digits += 1
    if digits == 0 or p + 2 >= size or buffer[p] != 41 or buffer[p + 1] != 32:
        return -1, p
    for _ in range(9 - digits):
        fraction *= 10
    return seconds * 1_000_000_000 + fraction, p + 2


@compiled
def take_lines(buffer, begin, names, name_lengths, columns, n):
    """Add lines ``(s.f) name ID#DATA``; see `hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`."""
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    channel, p = 0, begin
    while p < size and n < rows:
        if buffer[p] == 10:
            p += 1
            continue
        start = p
        if buffer[p] != 40:  # (
            return start, n
        time_ns, p = _stamp(buffer, p, size)
        if time_ns < 0:
            return start, n
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
                    p += length + 1
                    break
        if found < 0 or p + 4 >= size:
            return start, n
        channel = found
        extended = buffer[p + 3] != 35  # '#'
        can_id = np.int64(0)
        if extended:
            if p + 9 >= size or buffer[p + 8] != 35:
                return start, n
            wrong = 0
            for j in range(4):
                byte = byte_of(buffer, p + 2 * j)
                wrong |= byte
                can_id = can_id << 8 | (byte & 255)
            if wrong & NO_BYTE:
                return start, n
            p += 9
        else:
            first, second, third = np.int64(HEX[buffer[p]]), np.int64(HEX[buffer[p + 1]]), np.int64(HEX[buffer[p + 2]])
            if (first | second | third) & NO_DIGIT:
                return start, n
            can_id = first << 8 | second << 4 | third
            p += 4
        bits, limit = 0, _MAX_EXTENDED if extended else _MAX_STANDARD
        if extended and can_id & _ERROR_BIT:
            bits, extended, can_id = _ERROR, False, can_id & ~_ERROR_BIT
        if can_id > limit:
            return start, n
        count = 0
        if p + 17 <= size and buffer[p + 16] <= 32 and buffer[p] > 35:  # 8 bytes
            wrong = 0
            for j in range(8):
                byte = byte_of(buffer, p + 2 * j)
                wrong |= byte
                data[n, j] = byte & 255
            if not wrong & NO_BYTE:
                count = 8
                p += 16
                for j in range(8, width):
                    data[n, j] = 0
        if count == 0:
            most = 8
            if buffer[p] == 35:  # '##', CAN FD
                p += 1
                if p + 1 >= size or HEX[buffer[p]] == NO_DIGIT:
                    return start, n
                bits |= _FD | (int(HEX[buffer[p]]) & 3) << 3
                most = 64
                p += 1
            if buffer[p] == 82 and most == 8:  # R
                bits |= _REMOTE
                p += 1
                if p < size and 48 <= buffer[p] <= 56:
                    count = int(buffer[p]) - 48
                    p += 1
                for j in range(width):
                    data[n, j] = 0
            else:
                while p + 1 < size and count < most:
                    byte = byte_of(buffer, p)
                    if byte & NO_BYTE:
                        break
                    if count >= width:  # the builder must widen first
                        return start, n
                    data[n, count] = byte
                    count += 1
                    p += 2
                for j in range(count, width):
                    data[n, j] = 0
                if count > 8 and count not in (12, 16, 20, 24, 32, 48, 64):
                    return start, n
        if p + 1 < size and buffer[p] == 32 and (buffer[p + 1] == 84 or buffer[p + 1] == 82):  # direction
            if buffer[p + 1] == 84:
                bits |= _SENT
            p += 2
        if p < size and buffer[p] == 13:
            p += 1
        if p >= size or buffer[p] != 10:
            return start, n
        p += 1
        times[n] = time_ns
        channels[n] = channel
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    return p, n
