"""The compiled pass over TRC lines of all versions, column by column; odd lines are left to the careful parser."""

from hil.log.compiled import HEX, NO_BYTE, NO_DIGIT, PAIRS, compiled, ends

MAX_LINE = 4096
_MAX_MS = 4_000_000_000_000
_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_REMOTE, _ERROR, _FD, _SWITCH, _STATE, _SENT = 1, 2, 4, 8, 16, 32
_N, _O, _T, _B, _I, _D_SMALL, _R, _L_SMALL, _L, _D = 78, 79, 84, 66, 73, 100, 82, 108, 76, 68


@compiled
def take_lines(buffer, begin, letters, numbers, origin, names, name_lengths, columns, n):
    """Add frames of lines; see `hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`.

    ``letters`` are those of the columns, ``D`` the last one; ``numbers`` has the channel by its bus number, -1 where
    it is new.
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    p = begin
    while p < size and n < rows:
        if buffer[p] == 10:
            p += 1
            continue
        start, sound = p, True
        offset, bits, bus, can_id, extended, count, held, coded = 0, 0, 1, 0, False, 0, 0, False
        for column in range(letters.shape[0]):
            letter = letters[column]
            blanks = p
            while p < size and (buffer[p] == 32 or buffer[p] == 9):
                p += 1
            if letter == _D:
                break
            if p >= size or (column > 0 and p == blanks):
                sound = False
                break
            word = p
            if letter in (_N, _R):
                while p < size and buffer[p] > 32:
                    p += 1
                if letter == _N and (buffer[word] < 48 or buffer[word] > 57):
                    sound = False
            elif letter == _O:
                whole, digits = 0, 0
                while p < size and digits < 13 and 48 <= buffer[p] <= 57:
                    whole = whole * 10 + (int(buffer[p]) - 48)
                    p += 1
                    digits += 1
                sound = digits > 0 and whole <= _MAX_MS
                fraction, digits = 0, 0
                if p < size and buffer[p] == 46:
                    p += 1
                    while p < size and digits < 6 and 48 <= buffer[p] <= 57:
                        fraction = fraction * 10 + (int(buffer[p]) - 48)
                        p += 1
                        digits += 1
                    sound = sound and digits > 0
                for _ in range(6 - digits):
                    fraction *= 10
                offset = whole * 1_000_000 + fraction
            elif letter == _I:
                while p < size and p - word < 8 and HEX[buffer[p]] < NO_DIGIT:
                    can_id = can_id << 4 | int(HEX[buffer[p]])
                    p += 1
                extended = p - word > 4
                sound = p > word and can_id <= (_MAX_EXTENDED if extended else _MAX_STANDARD)
            elif letter in (_B, _L, _L_SMALL):
                value = 0
                while p < size and p - word < 3 and 48 <= buffer[p] <= 57:
                    value = value * 10 + (int(buffer[p]) - 48)
                    p += 1
                sound = p > word
                if letter == _B:
                    bus = value
                else:
                    count, coded = value, letter == _L
            elif p + 2 < size:  # T, d
                first, second = buffer[p], buffer[p + 1]
                p += 2
                if letter == _D_SMALL:
                    if first == 84:
                        bits |= _SENT
                    sound = (first == 84 or first == 82) and second == 120
                elif first == 70:  # FD, FB, FE
                    bits |= _FD
                    if second == 66:
                        bits |= _SWITCH
                    elif second == 69:
                        bits |= _STATE
                    elif second != 68:
                        sound = False
                elif first == 66 and second == 73:
                    bits |= _FD | _SWITCH | _STATE
                elif first == 82 and second == 82:
                    bits |= _REMOTE
                elif first != 68 or second != 84:
                    sound = False
            else:
                sound = False
            if not sound or p >= size or not ends(buffer[p]):
                sound = False
                break
        if not sound or numbers[bus] < 0 or (not bits & _FD and count > 15):
            return start, n
        if bits & _FD:
            if coded and count > 8:
                if count > 15:
                    return start, n
                count = (count - 6) * 4 if count < 13 else (count - 11) * 16
            if count > 8 and count not in (12, 16, 20, 24, 32, 48, 64):
                return start, n
        else:
            count = min(count, 8)
        if p + 3 < size and buffer[p] == 82 and buffer[p + 1] == 84 and buffer[p + 2] == 82:  # RTR
            if bits & _FD:
                return start, n
            bits |= _REMOTE
            p += 3
        elif not bits & _REMOTE:
            if count > width or p + 3 * count >= size:  # the builder must widen first
                return start, n
            if count:
                p -= 1
                wrong = 0
                for j in range(count):
                    pair = int(PAIRS[int(buffer[p + 1]) + 256 * int(buffer[p + 2])])
                    wrong |= (pair & NO_BYTE) | ((int(buffer[p]) ^ 32) if j else 0)
                    data[n, j] = pair & 255
                    p += 3
                if wrong:
                    return start, n
            held = count
        for j in range(held, width):
            data[n, j] = 0
        while p < size and (buffer[p] == 32 or buffer[p] == 9):
            p += 1
        if p + 1 < size and buffer[p] == 13:
            p += 1
        if p >= size or buffer[p] != 10 or p - start > MAX_LINE:
            return start, n
        p += 1
        times[n] = origin + offset
        channels[n] = numbers[bus]
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = count
        flags[n] = bits
        n += 1
    return p, n
