"""The compiled pass over candump lines: those of the plain form, everything odd is left to the careful parser."""

from hil.log.compiled import HEX, NO_DIGIT, compiled

_ERROR_BIT = 0x2000_0000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_MAX_SECONDS = 9_000_000_000
_REMOTE, _ERROR, _FD, _SENT = 1, 2, 4, 32


@compiled
def take_lines(buffer, begin, names, name_lengths, columns, n):  # type: ignore[no-untyped-def]
    """Add lines ``(s.f) name ID#DATA``; see `hil.log.lines.LineParser.take` and `FrameBuilder.fill`."""
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
        p += 1
        seconds, digits = 0, 0
        while p < size and 48 <= buffer[p] <= 57 and digits < 10:
            seconds = seconds * 10 + (int(buffer[p]) - 48)
            p += 1
            digits += 1
        if digits == 0 or seconds > _MAX_SECONDS or p + 2 >= size or buffer[p] != 46:
            return start, n
        p += 1
        fraction, digits = 0, 0
        while p < size and 48 <= buffer[p] <= 57 and digits < 9:
            fraction = fraction * 10 + (int(buffer[p]) - 48)
            p += 1
            digits += 1
        if digits == 0 or p + 2 >= size or buffer[p] != 41 or buffer[p + 1] != 32:
            return start, n
        for _ in range(9 - digits):
            fraction *= 10
        p += 2
        name = p
        while p < size and buffer[p] > 32 and buffer[p] < 127:
            p += 1
        found = -1
        for k in range(names.shape[0]):  # the channel of the line before is tried first
            candidate = channel if k == 0 else (k - 1 if k <= channel else k)
            if name_lengths[candidate] == p - name:
                same = True
                for j in range(p - name):
                    if buffer[name + j] != names[candidate, j]:
                        same = False
                        break
                if same:
                    found = candidate
                    break
        if found < 0 or p + 4 >= size or buffer[p] != 32:
            return start, n
        channel = found
        p += 1
        can_id, digits = 0, 0
        while p < size and HEX[buffer[p]] < NO_DIGIT and digits < 8:
            can_id = can_id << 4 | int(HEX[buffer[p]])
            p += 1
            digits += 1
        if p + 1 >= size or buffer[p] != 35:  # '#'
            return start, n
        p += 1
        extended = digits == 8
        if not extended and digits != 3:
            return start, n
        bits = 0
        if extended and can_id & _ERROR_BIT:
            bits, extended, can_id = _ERROR, False, can_id & ~_ERROR_BIT
        if can_id > (_MAX_EXTENDED if digits == 8 else _MAX_STANDARD):
            return start, n
        limit = 8
        if buffer[p] == 35:  # '##', CAN FD
            p += 1
            if p + 1 >= size or HEX[buffer[p]] == NO_DIGIT:
                return start, n
            nibble = int(HEX[buffer[p]])
            bits |= _FD | (nibble & 3) << 3
            limit = 64
            p += 1
        count = 0
        if buffer[p] == 82 and limit == 8:  # R
            bits |= _REMOTE
            p += 1
            if p < size and 48 <= buffer[p] <= 56:
                count = int(buffer[p]) - 48
                p += 1
            for j in range(width):
                data[n, j] = 0
        else:
            while p + 1 < size and count < limit:
                high, low = HEX[buffer[p]], HEX[buffer[p + 1]]
                if high == NO_DIGIT or low == NO_DIGIT:
                    break
                if count >= width:  # the builder must widen first
                    return start, n
                data[n, count] = high << 4 | low
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
        times[n] = seconds * 1_000_000_000 + fraction
        channels[n] = channel
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    return p, n
