"""The compiled pass over BLF objects: the same rules as `hil.log.blf.objects.ObjectStream`, which takes what it leaves.

It leaves the first rejected pieces (whose text is shown), objects that are not all there, and what needs the builder: a
new channel, more than 8 data bytes.
"""

import numpy as np

from hil.log.compiled import compiled

_REMOTE, _ERROR, _FD, _BRS, _ESI, _SENT = 1, 2, 4, 8, 16, 32
_LENGTHS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int64)
_PADDING, _LOOK, _MAX_HEADER, _SURPLUS, _MAX_OBJECT = 7, 16, 64, 64, 16 * 1024 * 1024
REQUESTS, UNKNOWN = 256, 257
"""Where ``passed`` counts requests to send, and objects of types from 256 on."""


@compiled
def _u8(buffer, at):
    return np.int64(buffer[at])  # signed, as numba makes floats of signed and unsigned together


@compiled
def _u16(buffer, at):
    return _u8(buffer, at) | _u8(buffer, at + 1) << 8


@compiled
def _u32(buffer, at):
    return _u8(buffer, at) | _u8(buffer, at + 1) << 8 | _u8(buffer, at + 2) << 16 | _u8(buffer, at + 3) << 24


@compiled
def _signed_64(buffer, at):
    high = _u32(buffer, at + 4)
    if high >= 0x8000_0000:
        high -= 0x1_0000_0000
    return high * 0x1_0000_0000 + _u32(buffer, at)


@compiled
def _begins(buffer, at):
    """Whether an object's signature stands at ``at``."""
    return buffer[at] == 76 and buffer[at + 1] == 79 and buffer[at + 2] == 66 and buffer[at + 3] == 74


@compiled
def _find(buffer, begin, end):
    """Where the first signature wholly in begin..end stands; -1 for none."""
    for at in range(begin, end - 3):
        if buffer[at] == 76 and _begins(buffer, at):
            return at
    return -1


@compiled
def take_objects(
    buffer, begin, outer, final, layout, limits, indices, passed, rejected, names, name_lengths, columns, n
):
    """Take objects from ``begin`` on, where one begins; see `FrameBuilder.fill` for what it returns.

    ``layout`` holds the least and the full body of each type, ``limits`` the start and the least and greatest stamp of
    each unit, ``indices`` the channel index of each channel number (-1: not yet known). ``passed`` and ``rejected``
    count; ``rejected[0]`` is negative while rejected pieces are to be left. ``rejected[1]`` becomes 1 where what
    follows is searched for the next object. ``outer``: leave containers.
    """
    times, channels, ids, wide, lengths, data, flags = columns
    rows, width, size_all = times.shape[0], data.shape[1], buffer.shape[0]
    start, least_10us, most_10us, least_ns, most_ns = limits[0], limits[1], limits[2], limits[3], limits[4]
    may_reject = rejected[0] >= 0
    p = begin
    while n < rows:
        # The next object begins within the padding, or what stands here is none.
        found = -1
        for k in range(_PADDING + 1):
            if p + k + 4 > size_all:
                break
            if _begins(buffer, p + k):
                found = p + k
                break
        if found < 0:
            if size_all - p < _LOOK and not final:
                return p, n
            if size_all - p <= _PADDING:
                return size_all, n
            if not may_reject:
                return p, n
            rejected[0] += 1
            found = _find(buffer, p, size_all)
            if found < 0:
                rejected[1] = 1
                return max(p, size_all - 3), n
        if found + 16 > size_all:
            return found, n
        p = found
        header, version = _u16(buffer, p + 4), _u16(buffer, p + 6)
        size, kind = _u32(buffer, p + 8), _u32(buffer, p + 12)
        least = layout[0, kind] if kind < 256 else 0
        if least == 0:
            if outer and kind == 10:
                return p, n
            sound = 16 <= header <= size and size <= _MAX_OBJECT
        else:
            body = size - header
            sound = 1 <= version <= 2 and 32 <= header <= _MAX_HEADER
            sound = sound and least <= body <= layout[1, kind] + _SURPLUS
        if not sound:
            if not may_reject:
                return p, n
            rejected[0] += 1
            found = _find(buffer, p + 4, size_all)
            if found < 0:
                rejected[1] = 1
                return max(p + 4, size_all - 3), n
            p = found
            continue
        end = p + size
        if end > size_all:
            if not final:
                return p, n
            found = _find(buffer, p + 16, size_all)
            if found < 0 or not may_reject:
                return p, n
            rejected[0] += 1
            p = found
            continue
        if least == 0:
            landed = False
            for k in range(_PADDING + 1):
                if end + k + 4 > size_all:
                    break
                if _begins(buffer, end + k):
                    landed = True
                    break
            if not landed:
                if size_all - end < _LOOK and not final:
                    return p, n
                if size_all - end > _PADDING:
                    found = _find(buffer, p + 16, min(end + 3, size_all))
                    if found >= 0:
                        if not may_reject:
                            return p, n
                        rejected[0] += 1
                        p = found
                        continue
            passed[kind if kind < 256 else UNKNOWN] += 1
            p = end
            continue
        at = p + header
        bits, channel, dlc, can_id, direction = 0, 0, 0, 0, 0
        held, used = 8, layout[1, kind]  # data bytes there are, bytes of the layout
        if kind == 1 or kind == 86:
            channel, mark, dlc, can_id = (
                _u16(buffer, at),
                _u8(buffer, at + 2),
                _u8(buffer, at + 3),
                _u32(buffer, at + 4),
            )
            at += 8
            direction = mark & 15
            if mark & 0x80:
                bits |= _REMOTE
        elif kind == 100:
            channel, mark, dlc, can_id = (
                _u16(buffer, at),
                _u8(buffer, at + 2),
                _u8(buffer, at + 3),
                _u32(buffer, at + 4),
            )
            fd, held = _u8(buffer, at + 13), min(_u8(buffer, at + 14), body - 20)
            at += 20
            direction = mark & 15
            if mark & 0x80:
                bits |= _REMOTE
            if fd & 1:
                bits |= _FD | (_BRS if fd & 2 else 0) | (_ESI if fd & 4 else 0)
        elif kind == 101:
            channel, dlc, can_id = _u8(buffer, at), _u8(buffer, at + 1), _u32(buffer, at + 4)
            fd, behind = _u32(buffer, at + 12), _u8(buffer, at + 35)
            held = min(_u8(buffer, at + 2), (min(behind, size) if behind else size) - header - 40)
            direction = _u8(buffer, at + 34)
            used = 40 + max(held, 0)
            at += 40
            if fd & 0x10:
                bits |= _REMOTE
            if fd & 0x1000:
                bits |= _FD | (_BRS if fd & 0x2000 else 0) | (_ESI if fd & 0x4000 else 0)
        elif kind == 2:
            bits, channel = _ERROR, _u16(buffer, at)
        elif kind == 73:
            bits, channel, dlc, can_id = _ERROR, _u16(buffer, at), _u8(buffer, at + 10) & 15, _u32(buffer, at + 16)
            direction = 1 if _u16(buffer, at + 20) & 0x4000 else 0
            at += 24
        else:
            bits, channel, dlc, can_id = _ERROR, _u8(buffer, at), _u8(buffer, at + 1) & 15, _u32(buffer, at + 12)
            direction = 1 if _u16(buffer, at + 6) & 0x4000 else 0
            fd, behind = _u16(buffer, at + 8), _u8(buffer, at + 10)
            held = min(_u8(buffer, at + 2), (min(behind, size) if behind else size) - header - 44)
            used = 44 + max(held, 0)
            at += 44
            if fd & 0x80:
                bits |= _FD | (_BRS if fd & 0x40 else 0) | (_ESI if fd & 0x20 else 0)
        if body > used:
            if size_all < end + 3 and not final:
                return p, n
            found = _find(buffer, p + header + used, min(end + 3, size_all))
            if found >= 0:
                if not may_reject:
                    return p, n
                rejected[0] += 1
                p = found
                continue
        if direction == 2:
            passed[REQUESTS] += 1
            p = end
            continue
        if direction == 1:
            bits |= _SENT
        extended = can_id & 0x8000_0000 != 0
        can_id &= 0x1FFF_FFFF
        stamp = _signed_64(buffer, p + 24)
        if _u32(buffer, p + 16) == 1:
            sound = least_10us <= stamp <= most_10us
            stamp *= 10_000 if sound else 0
        else:
            sound = least_ns <= stamp <= most_ns
        if bits & _ERROR:
            extended = False
        elif not extended and can_id > 0x7FF:
            sound = False
        if dlc > 15 or not sound:
            if not may_reject:
                return p, n
            rejected[0] += 1
            p = end
            continue
        length = _LENGTHS[dlc] if bits & _FD else min(dlc, 8)
        held = 0 if bits & _REMOTE else min(held, length)
        index = indices[channel]
        if index < 0 or (length > width and not bits & _REMOTE):
            return p, n
        times[n] = start + stamp
        channels[n] = index
        ids[n] = can_id
        wide[n] = extended
        lengths[n] = length
        flags[n] = bits
        if held == 8 and width == 8:
            for j in range(8):
                data[n, j] = buffer[at + j]
        else:
            for j in range(width):
                data[n, j] = buffer[at + j] if j < held else 0
        n += 1
        p = end
    return p, n
