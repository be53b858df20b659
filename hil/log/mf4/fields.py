"""Members of the records of an MDF 4 file as arrays: bits at any place, in either order of bytes."""

from typing import Any

import numpy as np
import numpy.typing as npt

from hil.log.mf4.layout import VIRTUAL, VLSD, Member

Bytes = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Numbers = npt.NDArray[Any]  # of uint8, uint16, uint32 or uint64
_BEHIND = np.arange(64) < np.arange(65)[:, None]
KEPT_64 = np.where(_BEHIND, 0xFF, 0).astype(np.uint8).view(np.uint64)  # (65, 8): mask of the first bytes of a row
KEPT_8 = KEPT_64[:9, 0].copy()


def fits(member: Member, size: int, data: bool) -> bool:
    """A member can be read out of a record."""
    if member.kind == VIRTUAL or (not member.bits and not data):
        whole = member.factor.denominator == 1 and member.offset.denominator == 1
        return whole and 0 <= member.factor < 2**32 and 0 <= member.offset < 2**32
    inside = member.byte + (member.bit + member.bits + 7) // 8 <= size
    if data and member.kind != VLSD:
        return inside and member.bits >= 8
    if not (inside and 1 <= member.bits <= 64 and member.bit + member.bits <= 64):
        return False
    if not data and (member.data_type > 3 or not member.linear):
        return member.data_type <= 3 and member.factor == 1 and not member.offset
    return member.factor.denominator == 1 and member.offset.denominator == 1 and 0 <= member.factor < 2**32


def unsigned(records: Bytes, member: Member) -> Numbers:
    """Raw bits of a member, (n,), in the narrowest of uint8, uint16, uint32, uint64 that holds the bytes it touches."""
    touched = (member.bit + member.bits + 7) // 8
    big = member.data_type in (1, 3, 5)
    value = _word(records, member.byte, touched, big)
    if member.bit:
        value = value >> np.array(member.bit, value.dtype)
    if member.bits < 8 * value.dtype.itemsize:
        value = value & np.array((1 << member.bits) - 1, value.dtype)
    return value


def _word(records: Bytes, first: int, n: int, big: bool) -> Numbers:
    """``n`` bytes of every record as one number; parts of 4, 2 and 1 bytes where 1, 2, 4 or 8 do not fit."""
    if n == 1:
        return records[:, first]
    if n in (2, 4, 8):
        view = records[:, first : first + n].view(f"{'>' if big else '<'}u{n}")[:, 0]
        return view.astype(f"u{n}")
    kind = np.dtype("u4" if n < 4 else "u8")
    part = 1 << (n.bit_length() - 1)
    before, behind = _word(records, first, part, big), _word(records, first + part, n - part, big)
    upper, lower, shift = (before, behind, 8 * (n - part)) if big else (behind, before, 8 * part)
    return (upper.astype(kind) << np.array(shift, kind)) | lower.astype(kind)


def data_bytes(records: Bytes, member: Member, width: int) -> Bytes:
    """Bytes of a fixed array, (n, width); of one that begins within a byte, shifted."""
    first = records[:, member.byte : member.byte + width]
    if not member.bit:
        return first
    behind = records[:, member.byte + 1 : member.byte + 1 + width]
    return (first >> np.uint8(member.bit)) | (behind << np.uint8(8 - member.bit))
