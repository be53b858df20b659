"""The compiled pass over lines of frames in a BUSMASTER log of CAN; odd lines are left to the careful parser."""

from hil.log.compiled import HEX, NO_BYTE, byte_of, compiled, inlined

ABSOLUTE, RELATIVE, SYSTEM = 0, 1, 2
MAX_LINE = 4096
MAX_NS = 4_000_000_000_000_000_000
_HALF_DAY_NS, _DAY_NS = 43_200_000_000_000, 86_400_000_000_000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_REMOTE, _FD, _SENT = 1, 4, 32


@inlined
def _number(buffer, p, size, most):
    """Decimal number of at most ``most`` digits, and where it ends; -1 for none."""
    value, begin = 0, p
    while p < size and p - begin < most and 48 <= buffer[p] <= 57:
        value = value * 10 + (int(buffer[p]) - 48)
        p += 1
    return (value, p) if p > begin else (-1, p)


@compiled
def take_lines(buffer, begin, numbers, state, start_ns, mode, base, names, name_lengths, columns, n):
    """Add frames of lines; see `hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`.

    ``numbers`` has the channel by its number in the log, -1 where it is new. ``state`` is changed: midnight before
    the last line, stamp of the last line (ns).
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    p, midnight, last = begin, state[0], state[1]
    while p < size and n < rows:
        if buffer[p] == 10:
            p += 1
            continue
        start, taken = p, False
        while True:  # left by a break where the line is not taken
            hours, p = _number(buffer, p, size, 6)
            if hours < 0 or p >= size or buffer[p] != 58:
                break
            minutes, p = _number(buffer, p + 1, size, 2)
            if minutes < 0 or minutes > 59 or p >= size or buffer[p] != 58:
                break
            seconds, p = _number(buffer, p + 1, size, 2)
            if seconds < 0 or seconds > 59 or p >= size or buffer[p] != 58:
                break
            ticks, p = _number(buffer, p + 1, size, 4)
            if ticks < 0 or p + 4 >= size or buffer[p] != 32 or buffer[p + 2] != 120 or buffer[p + 3] != 32:
                break
            time_ns, day = (hours * 3600 + minutes * 60 + seconds) * 1_000_000_000 + ticks * 100_000, midnight
            if mode == SYSTEM:
                time_ns += day
                if time_ns < last - _HALF_DAY_NS:
                    time_ns, day = time_ns + _DAY_NS, day + _DAY_NS
            else:
                time_ns += start_ns if mode == ABSOLUTE else last
            if time_ns > 2 * MAX_NS or day > MAX_NS:
                break
            bits = 0
            if buffer[p + 1] == 84:
                bits = _SENT
            elif buffer[p + 1] != 82:
                break
            number, p = _number(buffer, p + 4, size, 4)
            if number < 0 or numbers[number] < 0 or p + 3 >= size or buffer[p] != 32:
                break
            p += 1
            most = 10
            if base == 16:
                most = 8
                if buffer[p] == 48 and buffer[p + 1] == 120:  # 0x
                    p += 2
            can_id, digits = 0, 0
            while p < size and digits < most and HEX[buffer[p]] < base:
                can_id = can_id * base + int(HEX[buffer[p]])
                p += 1
                digits += 1
            if digits == 0 or p + 6 >= size or buffer[p] != 32:
                break
            extended = buffer[p + 1] == 120  # x
            if can_id > (_MAX_EXTENDED if extended else _MAX_STANDARD) or not (extended or buffer[p + 1] == 115):
                break
            p += 2
            if buffer[p] == 114:
                bits |= _REMOTE
                p += 1
            elif buffer[p] == 45 and buffer[p + 1] == 102 and buffer[p + 2] == 100:
                bits |= _FD
                p += 3
            if buffer[p] != 32:
                break
            count, p = _number(buffer, p + 1, size, 2)
            if count < 0 or p >= size:
                break
            if bits & _FD:
                if count > 8 and count not in (12, 16, 20, 24, 32, 48, 64):
                    break
            elif count > 8:
                break
            if bits & _REMOTE:
                for j in range(width):
                    data[n, j] = 0
            else:
                if count > width:  # the builder must widen first
                    break
                sound = True
                for j in range(count):
                    if p + 3 >= size or buffer[p] != 32:
                        sound = False
                        break
                    if base == 16:
                        byte = byte_of(buffer, p + 1)
                        p += 3
                    else:
                        byte, p = _number(buffer, p + 1, size, 3)
                    if byte < 0 or byte >= NO_BYTE:
                        sound = False
                        break
                    data[n, j] = byte
                if not sound:
                    break
                for j in range(count, width):
                    data[n, j] = 0
            while p < size and buffer[p] == 32:
                p += 1
            if p < size and buffer[p] == 13:
                p += 1
            if p >= size or buffer[p] != 10 or p - start > MAX_LINE:
                break
            taken = True
            break
        if not taken:
            p = start
            break
        p += 1
        midnight, last = day, time_ns
        times[n] = time_ns
        channels[n] = numbers[number]
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    state[0], state[1] = midnight, last
    return p, n
