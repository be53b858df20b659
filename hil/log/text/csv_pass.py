"""The compiled passes over CSV rows of frames: rows of the plain form, everything odd is left to the careful parsers.

All of them end a row the same way and give back the begin of the first row they do not take; see
`hil.log.text.lines.LineParser.take` and `FrameBuilder.fill`.
"""

import numpy as np

from hil.log.compiled import HEX, NO_BYTE, NO_DIGIT, are_digits, byte_of, compiled, inlined, of_digits, word

_MAX_STANDARD, _MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
_MAX_SECONDS = 9_000_000_000
_REMOTE, _ERROR, _FD, _SENT = 1, 2, 4, 32
_QUICK = 32  # bytes that are left of a row when its stamp is looked at
_COMMA, _QUOTE, _POINT, _MINUS, _BLANK = 44, 34, 46, 45, 32

BASE64 = np.full(256, 64, np.uint8)
"""Value of a base64 letter, by its byte; 64 for all other bytes."""
for _value, _letter in enumerate(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"):
    BASE64[_letter] = _value
WORDS = np.zeros((6, 7), np.uint8)
"""The words of our flags, in the order of their bits, and a row's length in its last column."""
for _bit, _word in enumerate((b"remote", b"error", b"fd", b"brs", b"esi", b"tx")):
    WORDS[_bit, : len(_word)] = list(_word)
    WORDS[_bit, 6] = len(_word)


@compiled
def _number(buffer, p, most):
    """Value of up to ``most`` decimal digits, and where they end; nothing is taken where there is none."""
    value, stop, size = 0, p + most, buffer.shape[0]
    while p < size and p < stop and 48 <= buffer[p] <= 57:
        value = value * 10 + (int(buffer[p]) - 48)
        p += 1
    return value, p


@compiled
def _seconds(buffer, p):
    """Nanoseconds of ``-s.f`` before a comma, and what follows it; -1 for a stamp of another form."""
    size = buffer.shape[0]
    if p + _QUICK <= size and buffer[p + 10] == _POINT and buffer[p + 20] == _COMMA:  # as we write it, it may be
        first, last = word(buffer, p), word(buffer, p + 11)
        ninth, tenth, end = int(buffer[p + 8]) - 48, int(buffer[p + 9]) - 48, int(buffer[p + 19]) - 48
        if are_digits(first) and are_digits(last) and 0 <= ninth <= 9 and 0 <= tenth <= 9 and 0 <= end <= 9:
            seconds = of_digits(first) * 100 + ninth * 10 + tenth
            if seconds <= _MAX_SECONDS:
                return seconds * 1_000_000_000 + of_digits(last) * 10 + end, p + 21
    negative = p < size and buffer[p] == _MINUS
    if negative:
        p += 1
    begin = p
    value, p = _number(buffer, p, 10)
    if p == begin or value > _MAX_SECONDS or p >= size:
        return 0, -1
    value *= 1_000_000_000
    if buffer[p] == _POINT:
        begin = p + 1
        fraction, p = _number(buffer, begin, 9)
        if p == begin or p >= size:
            return 0, -1
        for _ in range(9 - (p - begin)):
            fraction *= 10
        value += fraction
    if buffer[p] != _COMMA:
        return 0, -1
    return (-value if negative else value), p + 1


@compiled
def _name(buffer, p, names, name_lengths, before):
    """Number of a known channel name, quoted or not, before a comma, and what follows it; -1 for any other."""
    size = buffer.shape[0]
    quoted = p < size and buffer[p] == _QUOTE
    if quoted:
        p += 1
    begin = p
    while p < size and 32 <= buffer[p] < 127 and buffer[p] != _QUOTE and (quoted or buffer[p] != _COMMA):
        p += 1
    length = p - begin
    if quoted:
        if p >= size or buffer[p] != _QUOTE:
            return 0, -1
        p += 1
    if p >= size or buffer[p] != _COMMA or length == 0:
        return 0, -1
    for k in range(names.shape[0]):  # the channel of the row before is tried first
        candidate = before if k == 0 else (k - 1 if k <= before else k)
        if name_lengths[candidate] == length:
            same = True
            for j in range(length):
                if buffer[begin + j] != names[candidate, j]:
                    same = False
                    break
            if same:
                return candidate, p + 1
    return 0, -1


@compiled
def _words(buffer, p):
    """Flags of words with one blank between them, before a comma, and what follows it; -1 for any other."""
    bits, size = 0, buffer.shape[0]
    if p < size and buffer[p] == _COMMA:
        return 0, p + 1
    while p < size:
        found = -1
        for bit in range(6):
            length = int(WORDS[bit, 6])
            if p + length >= size:
                continue
            same = True
            for j in range(length):
                if buffer[p + j] != WORDS[bit, j]:
                    same = False
                    break
            if same:
                found = bit
                break
        if found < 0:
            return 0, -1
        bits |= 1 << found
        p += int(WORDS[found, 6])
        if buffer[p] == _COMMA:
            return bits, p + 1
        if buffer[p] != _BLANK:
            return 0, -1
        p += 1
    return 0, -1


@compiled
def _line_end(buffer, p):
    """Begin of the next line where this one ends at ``p``, -1 where it does not."""
    size = buffer.shape[0]
    if p < size and buffer[p] == 13:
        p += 1
    if p < size and buffer[p] == 10:
        return p + 1
    return -1


@compiled
def _length_fits(length, fd):
    return length <= 8 or (fd and (length in (12, 16, 20, 24, 32, 48, 64)))


@inlined
def _short_name(names, name_lengths, channel):
    """A channel's name with its comma as a `word`, and the mask of its bytes; a mask of 0 for one that is longer."""
    text, length = np.uint64(0), 0
    if channel < names.shape[0] and 0 < name_lengths[channel] < 8:
        length = int(name_lengths[channel])
    for j in range(length):
        if names[channel, j] == _COMMA or names[channel, j] == _QUOTE:  # it is quoted in the file
            return text, np.uint64(0), 0
        text |= np.uint64(names[channel, j]) << np.uint64(8 * j)
    if length == 0:
        return text, np.uint64(0), 0
    text |= np.uint64(_COMMA) << np.uint64(8 * length)
    return text, np.uint64(0xFFFF_FFFF_FFFF_FFFF) >> np.uint64(56 - 8 * length), length


@compiled
def take_rows(buffer, begin, names, name_lengths, columns, n):
    """Add our own rows, ``time_s,channel,id,extended,flags,length,data``."""
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    channel, p = 0, begin
    text, mask, letters = _short_name(names, name_lengths, channel)
    while p < size and n < rows:
        start = p
        time_ns, p = _seconds(buffer, p)
        if p < 0:
            return start, n
        if letters and p + 8 <= size and word(buffer, p) & mask == text:  # as in the row before
            p += letters + 1
        else:
            channel, p = _name(buffer, p, names, name_lengths, channel)
            if p < 0:
                return start, n
            text, mask, letters = _short_name(names, name_lengths, channel)
        at = p
        can_id, p = _number(buffer, p, 9)
        if p == at or p + 3 >= size or buffer[p] != _COMMA or buffer[p + 2] != _COMMA:
            return start, n
        extended = buffer[p + 1] == 49
        if not extended and buffer[p + 1] != 48:
            return start, n
        bits, p = 0, p + 3
        if p < size and buffer[p] == _COMMA:
            p += 1
        else:
            bits, p = _words(buffer, p)
            if p < 0:
                return start, n
        error = bits & _ERROR != 0
        at = p
        length, p = _number(buffer, p, 2)
        if p == at or p >= size or buffer[p] != _COMMA or not _length_fits(length, bits & _FD != 0):
            return start, n
        if can_id > (_MAX_EXTENDED if extended or error else _MAX_STANDARD):
            return start, n
        p += 1
        count = 0 if bits & _REMOTE else length
        if count > width or p + 2 * count >= size:
            return start, n
        wrong = 0
        if count == 8:
            for j in range(8):
                byte = byte_of(buffer, p + 2 * j)
                wrong |= byte
                data[n, j] = byte & 255
        else:
            for j in range(count):
                byte = byte_of(buffer, p + 2 * j)
                wrong |= byte
                data[n, j] = byte & 255
        if wrong & NO_BYTE:
            return start, n
        p = _line_end(buffer, p + 2 * count)
        if p < 0:
            return start, n
        for j in range(count, width):
            data[n, j] = 0
        times[n] = time_ns
        channels[n] = channel
        ids[n] = can_id
        wide[n] = extended and not error
        lengths[n] = length
        flags[n] = bits
        n += 1
    return p, n


@compiled
def take_python_can(buffer, begin, names, name_lengths, columns, n):
    """Add python-can's rows, ``timestamp,0xID,extended,remote,error,dlc,BASE64``, all of the only channel."""
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    p = begin
    while p < size and n < rows:
        start = p
        time_ns, p = _seconds(buffer, p)
        if p < 0 or p + 2 >= size or buffer[p] != 48 or buffer[p + 1] != 120:  # 0x
            return start, n
        p += 2
        can_id, digits = 0, 0
        while p < size and HEX[buffer[p]] < NO_DIGIT and digits < 8:
            can_id = can_id << 4 | int(HEX[buffer[p]])
            p += 1
            digits += 1
        if digits == 0 or p + 8 >= size:
            return start, n
        kind = 0
        for k in range(3):  # extended, remote, error
            if buffer[p] != _COMMA or not 48 <= buffer[p + 1] <= 49:
                return start, n
            kind |= (int(buffer[p + 1]) - 48) << k
            p += 2
        if buffer[p] != _COMMA:
            return start, n
        extended, bits = kind & 1 != 0, kind >> 1
        error = bits & _ERROR != 0
        p += 1
        at = p
        length, p = _number(buffer, p, 2)
        if length > 8:
            bits |= _FD
        if p == at or p >= size or buffer[p] != _COMMA or not _length_fits(length, bits & _REMOTE == 0):
            return start, n
        if can_id > (_MAX_EXTENDED if extended or error else _MAX_STANDARD):
            return start, n
        p += 1
        count = 0 if bits & _REMOTE else length
        if count > width or p + (count + 2) // 3 * 4 >= size:
            return start, n
        j = 0
        while j < count:  # three bytes in four letters
            a, b, c, d = BASE64[buffer[p]], BASE64[buffer[p + 1]], BASE64[buffer[p + 2]], BASE64[buffer[p + 3]]
            more = count - j
            if a > 63 or b > 63:
                return start, n
            if (c > 63) if more > 1 else (buffer[p + 2] != 61):
                return start, n
            if (d > 63) if more > 2 else (buffer[p + 3] != 61):
                return start, n
            word = int(a) << 18 | int(b) << 12
            if more > 1:
                word |= int(c) << 6
            if more > 2:
                word |= int(d)
            data[n, j] = word >> 16
            if more > 1:
                data[n, j + 1] = word >> 8 & 255
            if more > 2:
                data[n, j + 2] = word & 255
            j += 3
            p += 4
        p = _line_end(buffer, p)
        if p < 0:
            return start, n
        for j in range(count, width):
            data[n, j] = 0
        times[n] = time_ns
        channels[n] = 0
        ids[n] = can_id
        wide[n] = extended and not error
        lengths[n] = length
        flags[n] = bits
        n += 1
    return p, n


@compiled
def _cell_is(buffer, p, word):
    """The begin of what follows a lower-case word and a comma, whatever its case; -1 where another word stands."""
    if p + len(word) >= buffer.shape[0]:
        return -1
    for j in range(len(word)):
        if buffer[p + j] | 32 != word[j]:
            return -1
    return p + len(word) + 1 if buffer[p + len(word)] == _COMMA else -1


_TRUE, _FALSE = tuple(b"true"), tuple(b"false")
_RX, _TX = tuple(b"rx"), tuple(b"tx")


@compiled
def take_gvret(buffer, begin, directed, buses, names, name_lengths, columns, n):
    """Add rows of GVRET's CSV, ``microseconds,ID,extended,[direction,]bus,length,byte,...``.

    ``directed`` says whether there is a direction; ``buses`` gives the channel of each bus number, -1 for a new one.
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size = times.shape[0], data.shape[1], buffer.shape[0]
    p = begin
    while p < size and n < rows:
        start = p
        time_us, p = _number(buffer, p, 16)
        if p == start or time_us > _MAX_SECONDS * 1_000_000 or p >= size or buffer[p] != _COMMA:
            return start, n
        p += 1
        can_id, digits = 0, 0
        while p < size and HEX[buffer[p]] < NO_DIGIT and digits < 8:
            can_id = can_id << 4 | int(HEX[buffer[p]])
            p += 1
            digits += 1
        if digits == 0 or p >= size or buffer[p] != _COMMA:
            return start, n
        p += 1
        after = _cell_is(buffer, p, _TRUE)
        extended = after >= 0
        if not extended:
            after = _cell_is(buffer, p, _FALSE)
            if after < 0:
                return start, n
        p = after
        bits = 0
        if directed:
            after = _cell_is(buffer, p, _RX)
            if after < 0:
                after = _cell_is(buffer, p, _TX)
                if after < 0:
                    return start, n
                bits = _SENT
            p = after
        at = p
        bus, p = _number(buffer, p, 3)
        if p == at or p >= size or buffer[p] != _COMMA or bus >= buses.shape[0] or buses[bus] < 0:
            return start, n
        p += 1
        at = p
        length, p = _number(buffer, p, 2)
        if p == at or length > width or not _length_fits(length, True):
            return start, n
        if can_id > (_MAX_EXTENDED if extended else _MAX_STANDARD):
            return start, n
        if length > 8:
            bits |= _FD
        if p + 3 * length >= size:
            return start, n
        for j in range(length):
            high, low = HEX[buffer[p + 1]], HEX[buffer[p + 2]]
            if buffer[p] != _COMMA or high == NO_DIGIT or low == NO_DIGIT:
                return start, n
            data[n, j] = high << 4 | low
            p += 3
        while p < size and buffer[p] == _COMMA:  # empty cells and zeros behind the data
            p += 1
            if p + 1 < size and buffer[p] == 48 and buffer[p + 1] == 48:
                p += 2
        p = _line_end(buffer, p)
        if p < 0:
            return start, n
        for j in range(length, width):
            data[n, j] = 0
        times[n] = time_us * 1000
        channels[n] = buses[bus]
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = length
        flags[n] = bits
        n += 1
    return p, n
