"""The compiled passes over packet captures: CAN and CAN FD frames of plain records, all else is left to careful Python.

Numbers of a file are little-endian or big-endian as its writer was (``little``); SocketCAN identifiers are big-endian
in link type 227 and as the file is behind the headers of Linux cooked captures.
"""

import numpy as np

from hil.log.compiled import compiled

SOCKETCAN, COOKED, COOKED_2 = 227, 113, 276
_EXTENDED, _REMOTE_BIT, _ERROR_BIT = 0x8000_0000, 0x4000_0000, 0x2000_0000
_MAX_STANDARD = 0x7FF
_REMOTE, _ERROR, _FD, _BRS, _ESI, _SENT = 1, 2, 4, 8, 16, 32
_ENHANCED_PACKET = 6
_FLAGS_OPTION = 2


@compiled
def _word(buffer, p, little):
    """The 32-bit number at ``p``, which must lie 4 bytes before the end."""
    a, b = int(np.int64(buffer[p])), int(np.int64(buffer[p + 1]))  # signed: int() of a uint8 is not
    c, d = int(np.int64(buffer[p + 2])), int(np.int64(buffer[p + 3]))
    if little:
        return d << 24 | c << 16 | b << 8 | a
    return a << 24 | b << 16 | c << 8 | d


@compiled
def _frame(buffer, begin, captured, size, link, little, columns, n):
    """Write one packet as row ``n`` but for time and channel.

    Returns its interface (0 where the link type names none), or -1 for a packet to be left.
    """
    _, _, ids, wide, lengths, data, flags = columns
    width = data.shape[1]
    p, bits, interface = begin, 0, 0
    fd, big = False, True
    if link == COOKED:
        if captured < 24 or buffer[p + 14] != 0 or not 12 <= buffer[p + 15] <= 13:
            return -1
        fd, big = bool(buffer[p + 15] == 13), not little
        if buffer[p] == 0 and buffer[p + 1] == 4:
            bits = _SENT
        p += 16
    elif link == COOKED_2:
        if captured < 28 or buffer[p] != 0 or not 12 <= buffer[p + 1] <= 13:
            return -1
        fd, big = bool(buffer[p + 1] == 13), not little
        interface = _word(buffer, p + 4, False)
        if buffer[p + 10] == 4:
            bits = _SENT
        p += 20
    elif link != SOCKETCAN or captured < 8:
        return -1
    rest = captured - (p - begin)
    if rest > 72 or buffer[p + 4] > 64:
        return -1
    can_id, length, fd_bits = _word(buffer, p, not big), int(np.int64(buffer[p + 4])), int(np.int64(buffer[p + 5]))
    if link == SOCKETCAN:
        fd = fd_bits & 4 != 0 or size == 72 or length > 8
    if length > 8 and not (fd and length in (12, 16, 20, 24, 32, 48, 64)):
        return -1
    if fd:
        bits |= _FD | (fd_bits & 1) * _BRS | (fd_bits >> 1 & 1) * _ESI
    extended = can_id & _EXTENDED != 0
    if can_id & _REMOTE_BIT:
        bits |= _REMOTE
    if can_id & _ERROR_BIT:
        bits |= _ERROR
        extended = False
    elif not extended and can_id & 0x1FFF_FFFF > _MAX_STANDARD:
        return -1
    count = 0 if bits & _REMOTE else length
    if count > width or 8 + count > rest:
        return -1
    for j in range(count):
        data[n, j] = buffer[p + 8 + j]
    for j in range(count, width):
        data[n, j] = 0
    ids[n] = can_id & 0x1FFF_FFFF
    wide[n] = extended
    lengths[n] = length
    flags[n] = bits
    return interface


@compiled
def take_records(buffer, begin, little, unit_ns, link, interfaces, names, name_lengths, columns, n):
    """Add the records of a pcap file; ``interfaces`` gives the channel of each interface, -1 for a new one."""
    times, channels = columns[0], columns[1]
    rows, size = times.shape[0], buffer.shape[0]
    p = begin
    while p + 16 <= size and n < rows:
        seconds, fraction = _word(buffer, p, little), _word(buffer, p + 4, little)
        captured, original = _word(buffer, p + 8, little), _word(buffer, p + 12, little)
        if captured > 92 or p + 16 + captured > size or original < captured or fraction * unit_ns >= 1_000_000_000:
            return p, n
        interface = _frame(buffer, p + 16, captured, original, link, little, columns, n)
        if interface < 0 or interface >= interfaces.shape[0] or interfaces[interface] < 0:
            return p, n
        times[n] = seconds * 1_000_000_000 + fraction * unit_ns
        channels[n] = interfaces[interface]
        n += 1
        p += 16 + captured
    return p, n


@compiled
def _sent(buffer, p, end, little):
    """Whether the options between ``p`` and ``end`` say that the packet was sent."""
    while p + 4 <= end:
        word = _word(buffer, p, little)
        code, length = (word & 0xFFFF, word >> 16) if little else (word >> 16, word & 0xFFFF)
        if code == 0 or p + 4 + length > end:
            return False
        if code == _FLAGS_OPTION and length == 4:
            return _word(buffer, p + 4, little) & 3 == 2
        p += 4 + (length + 3) // 4 * 4
    return False


@compiled
def take_blocks(buffer, begin, little, links, scales, offsets, interfaces, names, name_lengths, columns, n):
    """Add the enhanced packets of one section of a pcapng file.

    For each interface of the section: ``links`` its link type, ``scales`` (k, 4) multiplier, divisor and power of two
    (32 at most) that turn its ticks into ns and the limit of ticks over that power, ``offsets`` ns to add (2 ** 61 at
    most), ``interfaces`` its channel, -1 for a new one.
    """
    times, channels, flags = columns[0], columns[1], columns[6]
    rows, size = times.shape[0], buffer.shape[0]
    p = begin
    while p + 32 <= size and n < rows:
        if _word(buffer, p, little) != _ENHANCED_PACKET:
            return p, n
        length, interface = _word(buffer, p + 4, little), _word(buffer, p + 8, little)
        captured, original = _word(buffer, p + 20, little), _word(buffer, p + 24, little)
        padded = (captured + 3) // 4 * 4
        if length % 4 or length < 32 + padded or p + length > size or original < captured or captured > 92:
            return p, n
        if _word(buffer, p + length - 4, little) != length or interface >= interfaces.shape[0]:
            return p, n
        if interfaces[interface] < 0 or links[interface] == COOKED_2:
            return p, n
        high, low = _word(buffer, p + 12, little), _word(buffer, p + 16, little)
        if high >= 1 << 30:
            return p, n
        ticks = high << 32 | low
        multiplier, divisor, power = scales[interface, 0], scales[interface, 1], scales[interface, 2]
        whole = ticks >> power
        if whole >= scales[interface, 3]:
            return p, n
        time_ns = whole * multiplier
        if divisor > 1:
            time_ns //= divisor
        if power:
            time_ns += ((ticks - (whole << power)) * multiplier) >> power
        if _frame(buffer, p + 28, captured, original, links[interface], little, columns, n) < 0:
            return p, n
        if _sent(buffer, p + 28 + padded, p + length - 4, little):
            flags[n] |= _SENT
        times[n] = time_ns + offsets[interface]
        channels[n] = interfaces[interface]
        n += 1
        p += length
    return p, n
