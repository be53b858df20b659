"""The compiled passes that write rows of a frame table as lines of text; see `hil.log.text.line_writer.write_rows`."""

import numpy as np
import numpy.typing as npt

from hil.log.compiled import compiled, inlined

_REMOTE, _ERROR, _FD, _SWITCH, _STATE, _SENT = 1, 2, 4, 8, 16, 32
_BLANK, _ZERO, _MINUS, _POINT, _LINE_END = 32, 48, 45, 46, 10
_DIGITS = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_SMALL = np.frombuffer(b"0123456789abcdef", np.uint8)


def _letters(text: str) -> npt.NDArray[np.uint8]:
    return np.frombuffer(text.encode(), np.uint8)


_TAIL = _letters(f" {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n")
_NO_NAME = _letters(f"  {'':>32} ")
_NO_TIMES = _letters(f" {0:>8} {0:>4} ")
_ERROR_FRAME = _letters("  ErrorFrame\n")
_ERROR_SENT = _letters(" Tx   ErrorFrame\n")
_CANFD = _letters(" CANFD ")
_TRC_KINDS = _letters("DTFDFBFEBIRRER")
_TRC_ERROR = _letters("        - ")
_TRC_UNKNOWN = _letters(" -  5    08 00 00 00 00\r\n")
_WORDS = np.frombuffer(b"remoteerror\0fd\0\0\0\0brs\0\0\0esi\0\0\0tx\0\0\0\0", np.uint8).reshape(6, 6)
_WORD_LENGTHS = np.array([6, 5, 2, 3, 3, 2])


@inlined
def _put(out, at, text):
    for k in range(text.shape[0]):
        out[at + k] = text[k]
    return at + text.shape[0]


@inlined
def _padded(out, at, value, base, width, fill):
    """A number that is not negative, at least ``width`` wide."""
    size, rest = 1, value // base
    while rest:
        rest //= base
        size += 1
    for _ in range(width - size):
        out[at] = fill
        at += 1
    for k in range(size):
        out[at + size - 1 - k] = _DIGITS[value % base]
        value //= base
    return at + size


@inlined
def _zeroed(out, at, value, width):
    """Just ``width`` decimal digits."""
    for k in range(width):
        out[at + width - 1 - k] = _ZERO + value % 10
        value //= 10
    return at + width


@inlined
def _stamp(out, at, value, unit, digits, width):
    """A stamp in ns as decimal fraction of ``unit`` ns with ``digits`` behind the point, its integer ``width`` wide."""
    whole, fraction, step = value // unit, value % unit, unit
    if value < 0:  # away from zero, and never the number itself, which may have no positive counterpart
        if fraction:
            whole, fraction = whole + 1, unit - fraction
        whole = -whole
    for _ in range(digits):
        step //= 10
    fraction //= step
    if value < 0:
        rest, used = whole // 10, 2
        while rest:
            rest //= 10
            used += 1
        for _ in range(width - used):
            out[at] = _BLANK
            at += 1
        out[at] = _MINUS
        at = _padded(out, at + 1, whole, 10, 1, _BLANK)
    else:
        at = _padded(out, at, whole, 10, width, _BLANK)
    out[at] = _POINT
    return _zeroed(out, at + 1, fraction, digits)


@inlined
def _bytes(out, at, data, row, count):
    """Bytes, a blank before each."""
    for j in range(count):
        byte = int(data[row, j])
        out[at] = _BLANK
        out[at + 1] = _DIGITS[byte >> 4]
        out[at + 2] = _DIGITS[byte & 15]
        at += 3
    return at


@inlined
def _code(count):
    """Length code of CAN FD."""
    if count <= 8:
        return count
    if count <= 24:
        return 6 + count // 4
    return 11 + count // 16


@compiled
def asc_rows(out, columns, first, stop, numbers, start, fine):
    """Lines of ASC; ``numbers`` are those of the channels, row by row."""
    times, _, ids, wide, lengths, data, flags = columns
    at = 0
    for row in range(first, stop):
        bits, count = int(flags[row]), int(lengths[row])
        at = _stamp(out, at, times[row] - start, 1_000_000_000, 9 if fine else 6, 4)
        direction = 84 if bits & _SENT else 82
        if (bits & _ERROR and bits & _SENT) or (bits & _FD and not bits & (_ERROR | _REMOTE)):
            at = _put(out, at, _CANFD)
            at = _padded(out, at, int(numbers[row]), 10, 3, _BLANK)
            if bits & _ERROR:
                at = _put(out, at, _ERROR_SENT)
                continue
            out[at], out[at + 1], out[at + 2] = _BLANK, direction, 120
            out[at + 3], out[at + 4], out[at + 5] = _BLANK, _BLANK, _BLANK
            at = _padded(out, at + 6, int(ids[row]), 16, 7 if wide[row] else 8, _BLANK)
            if wide[row]:
                out[at] = 120
                at += 1
            at = _put(out, at, _NO_NAME)
            out[at], out[at + 1] = _ZERO + (bits >> 3 & 1), _BLANK
            out[at + 2], out[at + 3] = _ZERO + (bits >> 4 & 1), _BLANK
            out[at + 4], out[at + 5] = _SMALL[_code(count)], _BLANK
            at = _padded(out, at + 6, count, 10, 2, _BLANK)
            at = _bytes(out, at, data, row, count)
            at = _put(out, at, _NO_TIMES)
            at = _padded(out, at, 1 << 12 | (bits >> 3 & 3) << 13, 16, 8, _BLANK)
            at = _put(out, at, _TAIL)
            continue
        out[at] = _BLANK
        at = _padded(out, at + 1, int(numbers[row]), 10, 1, _BLANK)
        if bits & _ERROR:
            at = _put(out, at, _ERROR_FRAME)
            continue
        out[at], out[at + 1] = _BLANK, _BLANK
        end = at + 17
        at = _padded(out, at + 2, int(ids[row]), 16, 1, _BLANK)
        if wide[row]:
            out[at] = 120
            at += 1
        while at < end + 1:
            out[at] = _BLANK
            at += 1
        out[at], out[at + 1] = direction, 120
        out[at + 2], out[at + 3], out[at + 4] = _BLANK, _BLANK, _BLANK
        out[at + 5] = 114 if bits & _REMOTE else 100
        out[at + 6] = _BLANK
        out[at + 7] = _SMALL[min(count, 8)]
        at += 8
        if not bits & _REMOTE:
            at = _bytes(out, at, data, row, count)
        out[at] = _LINE_END
        at += 1
    return at


@compiled
def trc_rows(out, columns, first, stop, numbers, start, before):
    """Lines of TRC 2.1, ``before`` of which were written."""
    times, _, ids, wide, lengths, data, flags = columns
    at = 0
    for row in range(first, stop):
        bits, count = int(flags[row]), int(lengths[row])
        at = _padded(out, at, before + row + 1, 10, 7, _BLANK)
        out[at] = _BLANK
        rounded = (times[row] + 500) // 1000 * 1000 - start
        at = _stamp(out, at + 1, rounded, 1_000_000, 3, 9)
        kind = 0
        if bits & _ERROR:
            kind = 6
        elif bits & _REMOTE:
            kind = 5
        elif bits & _FD:
            kind = 1 + (bits >> 3 & 3)
        out[at], out[at + 1], out[at + 2] = _BLANK, _TRC_KINDS[2 * kind], _TRC_KINDS[2 * kind + 1]
        out[at + 3] = _BLANK
        at = _padded(out, at + 4, int(numbers[row]), 10, 2, _BLANK)
        if kind == 6:
            at = _put(out, at, _TRC_ERROR)
        else:
            for _ in range(1 if wide[row] else 5):
                out[at] = _BLANK
                at += 1
            at = _padded(out, at, int(ids[row]), 16, 8 if wide[row] else 4, _ZERO)
            out[at] = _BLANK
            at += 1
        out[at], out[at + 1] = 84 if bits & _SENT else 82, 120
        at += 2
        if kind == 6:
            at = _put(out, at, _TRC_UNKNOWN)
            continue
        out[at], out[at + 1], out[at + 2], out[at + 3] = _BLANK, _MINUS, _BLANK, _BLANK
        at = _padded(out, at + 4, count, 10, 1, _BLANK)
        if count and kind != 5:
            for _ in range(3 if count < 10 else 2):
                out[at] = _BLANK
                at += 1
            at = _bytes(out, at, data, row, count)
        out[at], out[at + 1] = 13, _LINE_END
        at += 2
    return at


@compiled
def candump_rows(out, columns, first, stop, names, starts, fine, directed):
    """Lines of candump's log form."""
    times, channels, ids, wide, lengths, data, flags = columns
    at = 0
    for row in range(first, stop):
        bits, count, channel = int(flags[row]), int(lengths[row]), channels[row]
        out[at] = 40
        at = _zeroed(out, at + 1, times[row] // 1_000_000_000, 10)
        out[at] = _POINT
        fraction = times[row] % 1_000_000_000
        at = _zeroed(out, at + 1, fraction, 9) if fine else _zeroed(out, at + 1, fraction // 1000, 6)
        out[at], out[at + 1] = 41, _BLANK
        at += 2
        for k in range(starts[channel], starts[channel + 1]):
            out[at] = names[k]
            at += 1
        out[at] = _BLANK
        error = bits & _ERROR
        can_id = int(ids[row]) | (0x2000_0000 if error else 0)
        at = _padded(out, at + 1, can_id, 16, 8 if error or wide[row] else 3, _ZERO)
        out[at] = 35
        at += 1
        if bits & _REMOTE:
            out[at], out[at + 1] = 82, _ZERO + min(count, 8)
            at += 2
        else:
            if bits & _FD:
                out[at], out[at + 1] = 35, _ZERO + (bits >> 3 & 3)
                at += 2
            for j in range(count):
                byte = int(data[row, j])
                out[at], out[at + 1] = _DIGITS[byte >> 4], _DIGITS[byte & 15]
                at += 2
        if directed:
            out[at], out[at + 1] = _BLANK, 84 if bits & _SENT else 82
            at += 2
        out[at] = _LINE_END
        at += 1
    return at


@compiled
def csv_rows(out, columns, first, stop, names, starts):
    """Lines of our CSV; ``names`` are quoted where they must be."""
    times, channels, ids, wide, lengths, data, flags = columns
    at = 0
    for row in range(first, stop):
        bits, count, channel = int(flags[row]), int(lengths[row]), channels[row]
        at = _stamp(out, at, times[row], 1_000_000_000, 9, 1)
        out[at] = 44
        at += 1
        for k in range(starts[channel], starts[channel + 1]):
            out[at] = names[k]
            at += 1
        out[at] = 44
        at = _padded(out, at + 1, int(ids[row]), 10, 1, _BLANK)
        out[at], out[at + 1], out[at + 2] = 44, _ZERO + int(wide[row]), 44
        at += 3
        begin = at
        for word in range(6):
            if bits >> word & 1:
                if at > begin:
                    out[at] = _BLANK
                    at += 1
                for k in range(_WORD_LENGTHS[word]):
                    out[at + k] = _WORDS[word, k]
                at += _WORD_LENGTHS[word]
        out[at] = 44
        at = _padded(out, at + 1, count, 10, 1, _BLANK)
        out[at] = 44
        at += 1
        if not bits & _REMOTE:
            for j in range(count):
                byte = int(data[row, j])
                out[at], out[at + 1] = _DIGITS[byte >> 4], _DIGITS[byte & 15]
                at += 2
        out[at] = _LINE_END
        at += 1
    return at
