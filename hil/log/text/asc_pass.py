"""The compiled pass over ASC lines: frames as CANoe, CANalyzer and python-can write them; odd lines are left."""

from hil.log.compiled import HEX, NO_BYTE, NO_DIGIT, PAIRS, compiled, ends, inlined

MAX_LINE = 4096
MAX_NS = 4_000_000_000_000_000_000  # the sum of two of them stays below 2**63
_MAX_SECONDS = 4_000_000_000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_REMOTE, _ERROR, _FD, _SWITCH, _STATE, _SENT = 1, 2, 4, 8, 16, 32
_ASC_REMOTE, _ASC_FD = 0x10, 0x1000  # in the flags of a CANFD line


@inlined
def _blanks(buffer, p, size):
    """Behind blanks and tabs; -1 where there is none."""
    begin = p
    while p < size and (buffer[p] == 32 or buffer[p] == 9):
        p += 1
    return p if p > begin and p < size else -1


@inlined
def _is(buffer, p, size, word):
    """Whether a word stands here, and a blank or the end of the line behind it."""
    n = len(word)
    if p + n >= size:
        return False
    for k in range(n):
        if buffer[p + k] != word[k]:
            return False
    return ends(buffer[p + n])


_CANFD = (67, 65, 78, 70, 68)
_ERROR_FRAME = (69, 114, 114, 111, 114, 70, 114, 97, 109, 101)
_RX, _TX, _TXRQ = (82, 120), (84, 120), (84, 120, 82, 113)


@compiled
def take_lines(buffer, begin, numbers, state, origin, relative, base, names, name_lengths, columns, n):
    """Add frames of lines; see `hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`.

    ``numbers`` has the channel by its number in the log, -1 where it is new. ``state`` is changed: offset of the last
    line from the start (ns), requests to send that were passed over.
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    p, last = begin, state[0]
    while p < size and n < rows:
        if buffer[p] == 10:
            p += 1
            continue
        start, taken = p, False
        while True:  # left by a break where the line is not taken
            bits, extended, can_id, count, request = 0, False, 0, 0, False
            while p < size and (buffer[p] == 32 or buffer[p] == 9):
                p += 1
            negative = p < size and buffer[p] == 45
            if negative:
                p += 1
            seconds, digits = 0, 0
            while p < size and 48 <= buffer[p] <= 57 and digits < 10:
                seconds = seconds * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0 or seconds > _MAX_SECONDS or p >= size or buffer[p] != 46:
                break
            p += 1
            fraction, digits = 0, 0
            while p < size and 48 <= buffer[p] <= 57 and digits < 9:
                fraction = fraction * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0:
                break
            for _ in range(9 - digits):
                fraction *= 10
            stamp = seconds * 1_000_000_000 + fraction
            if negative:
                stamp = -stamp
            if relative:
                if last > MAX_NS or last < -MAX_NS:
                    break
                stamp += last
                if stamp > MAX_NS or stamp < -MAX_NS:
                    break
            p = _blanks(buffer, p, size)
            if p < 0:
                break
            fd = buffer[p] == 67
            if fd:
                if not _is(buffer, p, size, _CANFD):
                    break
                p = _blanks(buffer, p + 5, size)
                if p < 0:
                    break
            number, digits = 0, 0
            while p < size and 48 <= buffer[p] <= 57 and digits < 4:
                number = number * 10 + (int(buffer[p]) - 48)
                p += 1
                digits += 1
            if digits == 0 or numbers[number] < 0:
                break
            p = _blanks(buffer, p, size)
            if p < 0:
                break
            if fd:  # the direction stands before the identifier
                if _is(buffer, p, size, _TX):
                    bits = _SENT
                elif not _is(buffer, p, size, _RX):
                    break
                p = _blanks(buffer, p + 2, size)
                if p < 0:
                    break
            if _is(buffer, p, size, _ERROR_FRAME):
                bits |= _ERROR
                p += 10
                while p < size and buffer[p] != 10:
                    p += 1
            else:
                digits = 0
                while p < size and digits < 10 and HEX[buffer[p]] < base:
                    can_id = can_id * base + int(HEX[buffer[p]])
                    p += 1
                    digits += 1
                if p < size and buffer[p] == 120:  # x
                    extended = True
                    p += 1
                limit = _MAX_EXTENDED if extended else _MAX_STANDARD
                if digits == 0 or (base == 16 and digits > 8) or can_id > limit:
                    break
                p = _blanks(buffer, p, size)
                if p < 0:
                    break
                if fd:
                    if not (buffer[p] <= 49 and buffer[p] >= 48 and p + 1 < size and buffer[p + 1] <= 32):
                        while p < size and buffer[p] > 32:  # the name of the message
                            p += 1
                        p = _blanks(buffer, p, size)
                        if p < 0:
                            break
                    if p + 6 >= size or buffer[p] < 48 or buffer[p] > 49 or buffer[p + 1] != 32:
                        break
                    if buffer[p + 2] < 48 or buffer[p + 2] > 49 or buffer[p + 3] != 32:
                        break
                    switch, error_state = buffer[p] == 49, buffer[p + 2] == 49
                    code = int(HEX[buffer[p + 4]])
                    if code == NO_DIGIT:
                        break
                    p = _blanks(buffer, p + 5, size)
                    if p < 0:
                        break
                    digits = 0
                    while p < size and digits < 2 and 48 <= buffer[p] <= 57:
                        count = count * 10 + (int(buffer[p]) - 48)
                        p += 1
                        digits += 1
                    if digits == 0:
                        break
                    if count > 8 and count not in (12, 16, 20, 24, 32, 48, 64):
                        break
                else:
                    if _is(buffer, p, size, _TX):
                        bits = _SENT
                        p += 2
                    elif _is(buffer, p, size, _RX):
                        p += 2
                    elif _is(buffer, p, size, _TXRQ):
                        request = True
                        p += 4
                    else:
                        break
                    p = _blanks(buffer, p, size)
                    if p < 0 or p + 3 >= size:
                        break
                    if buffer[p] == 114 and buffer[p + 1] == 32:  # r
                        bits |= _REMOTE
                    elif buffer[p] != 100 or buffer[p + 1] != 32:  # d
                        break
                    code = int(HEX[buffer[p + 2]])
                    if code == NO_DIGIT or not ends(buffer[p + 3]):
                        break
                    p += 3
                    if bits & _REMOTE:
                        code = min(code, 8)
                    elif code > 8:  # 8 bytes, or as many as CAN FD has by that code
                        break
                    count = code
                if count > width and not bits & _REMOTE:  # the builder must widen first
                    break
                if bits & _REMOTE:
                    for j in range(width):
                        data[n, j] = 0
                elif base == 16:
                    if p + 3 * count >= size:
                        break
                    wrong = 0
                    for j in range(count):
                        pair = int(PAIRS[int(buffer[p + 1]) + 256 * int(buffer[p + 2])])
                        wrong |= (pair & NO_BYTE) | (int(buffer[p]) ^ 32)
                        data[n, j] = pair & 255
                        p += 3
                    if wrong:
                        break
                    for j in range(count, width):
                        data[n, j] = 0
                else:
                    sound = True
                    for j in range(count):
                        p = _blanks(buffer, p, size)
                        if p < 0:
                            sound = False
                            break
                        value, digits = 0, 0
                        while p < size and digits < 3 and 48 <= buffer[p] <= 57:
                            value = value * 10 + (int(buffer[p]) - 48)
                            p += 1
                            digits += 1
                        if digits == 0 or value > 255:
                            sound = False
                            break
                        data[n, j] = value
                    if not sound:
                        break
                    for j in range(count, width):
                        data[n, j] = 0
                if p >= size or not ends(buffer[p]):
                    break
                while p < size and (buffer[p] == 32 or buffer[p] == 9):
                    p += 1
                if fd:
                    sound = True
                    for _ in range(2):  # duration, bits on the bus
                        while p < size and buffer[p] > 32:
                            p += 1
                        if p >= size or (buffer[p] != 32 and buffer[p] != 9):
                            sound = False
                            break
                        while p < size and (buffer[p] == 32 or buffer[p] == 9):
                            p += 1
                    if not sound:
                        break
                    asc_flags, digits = 0, 0
                    while p < size and digits < 8 and HEX[buffer[p]] < NO_DIGIT:
                        asc_flags = asc_flags << 4 | int(HEX[buffer[p]])
                        p += 1
                        digits += 1
                    if digits == 0 or p >= size or not ends(buffer[p]):
                        break
                    if asc_flags & _ASC_REMOTE:
                        if count:
                            break
                        bits |= _REMOTE
                        count = min(code, 8)
                    elif asc_flags & _ASC_FD or count > 8 or switch or error_state:
                        bits |= _FD
                        if switch:
                            bits |= _SWITCH
                        if error_state:
                            bits |= _STATE
                    while p < size and buffer[p] != 10:
                        p += 1
                elif p < size and buffer[p] == 76:  # Length = ...
                    while p < size and buffer[p] != 10:
                        p += 1
                elif p < size and buffer[p] == 13:
                    p += 1
            if p >= size or buffer[p] != 10 or p - start > MAX_LINE:
                break
            taken = True
            break
        if not taken:
            state[0] = last
            return start, n
        p += 1
        last = stamp
        if request:
            state[1] += 1
            continue
        if bits & _ERROR:
            for j in range(width):
                data[n, j] = 0
        times[n] = origin + stamp
        channels[n] = numbers[number]
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    state[0] = last
    return p, n
