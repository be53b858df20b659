"""Which identifiers carry diagnostic messages, and which answers which.

Known without being told (ISO 15765-4, ISO 15765-2 normal fixed addressing): 0x7DF to all, 0x7E0 to 0x7E7 answered by
0x7E8 to 0x7EF, 0x18DBxxyy to all, 0x18DAxxyy (to xx from yy) answered by 0x18DAyyxx.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hil.errors import BrakebenchError
from hil.log.frames import MAX_EXTENDED_ID, MAX_STANDARD_ID

_OBD_ALL, _OBD_FIRST, _OBD_LAST = 0x7DF, 0x7E0, 0x7EF
_FIXED_PHYSICAL, _FIXED_FUNCTIONAL = 0x18DA, 0x18DB
_WRITTEN = re.compile(r"(?:0x)?([0-9A-Fa-f]{1,8})")
KEY_EXTENDED = 1 << 29
"""Bit of a key that tells a 29-bit identifier."""


class Identifier(NamedTuple):
    """An identifier and its kind."""

    can_id: int
    extended: bool

    def __str__(self) -> str:
        return f"{self.can_id:08X}" if self.extended else f"{self.can_id:03X}"

    @property
    def key(self) -> int:
        """Both in one number."""
        return self.can_id | KEY_EXTENDED if self.extended else self.can_id

    @classmethod
    def of_key(cls, key: int) -> "Identifier":
        """Identifier of `key`."""
        return cls(key & ~KEY_EXTENDED, bool(key & KEY_EXTENDED))

    @classmethod
    def parse(cls, text: str) -> "Identifier":
        """Read ``7E0``, ``0x7E0`` or ``18DA01F1``; more than three digits, or a value above 0x7FF, has 29 bits.

        Raises
        ------
        BrakebenchError : no identifier.
        """
        match = _WRITTEN.fullmatch(text.strip())
        if match is None or int(match[1], 16) > MAX_EXTENDED_ID:
            raise BrakebenchError(f"{text!r} is no identifier; give hexadecimal digits such as 7E0 or 18DA01F1")
        return cls(int(match[1], 16), len(match[1]) > 3 or int(match[1], 16) > MAX_STANDARD_ID)


def standard_partner(identifier: Identifier) -> Identifier | None:
    """Identifier at the other end of a standard connection; None for one to all, and for any other."""
    can_id, extended = identifier
    if extended and can_id >> 16 == _FIXED_PHYSICAL:
        return Identifier(_FIXED_PHYSICAL << 16 | (can_id & 0xFF) << 8 | can_id >> 8 & 0xFF, True)
    if not extended and _OBD_FIRST <= can_id <= _OBD_LAST:
        return Identifier(can_id ^ 8, False)
    return None


def is_standard_functional(identifier: Identifier) -> bool:
    """Whether it is a standard identifier of requests to all ECUs."""
    can_id, extended = identifier
    return can_id >> 16 == _FIXED_FUNCTIONAL if extended else can_id == _OBD_ALL


def keys_of(can_id: npt.NDArray[np.uint32], extended: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """`Identifier.key` of every row."""
    return can_id.astype(np.int64) | np.where(extended, KEY_EXTENDED, 0)


def standard_keys(keys: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Whether each key is that of a standard diagnostic identifier."""
    high = keys >> 16
    fixed = (high == (KEY_EXTENDED >> 16 | _FIXED_PHYSICAL)) | (high == (KEY_EXTENDED >> 16 | _FIXED_FUNCTIONAL))
    mask: npt.NDArray[np.bool_] = fixed | ((keys >= _OBD_ALL) & (keys <= _OBD_LAST))
    return mask


@dataclass(frozen=True, slots=True)
class Addresses:
    """Identifiers of diagnostic messages.

    Attributes
    ----------
    partners : request and answer of connections beside the standard ones, in both directions.
    functional : identifiers of requests to all, beside the standard ones.
    standard : standard identifiers are taken as well.
    periodic : identifiers of periodic data, one value a frame, without ISO-TP.
    """

    partners: dict[Identifier, Identifier]
    functional: frozenset[Identifier]
    standard: bool
    periodic: frozenset[Identifier] = frozenset()

    @classmethod
    def of(
        cls,
        pairs: Iterable[tuple[Identifier, Identifier]],
        functional: Iterable[Identifier] = (),
        standard: bool = True,
        periodic: Iterable[Identifier] = (),
    ) -> "Addresses":
        """Addresses of connections (request, answer)."""
        partners: dict[Identifier, Identifier] = {}
        for request, answer in pairs:
            partners[answer] = request
            partners.setdefault(request, answer)
        return cls(partners, frozenset(functional), standard, frozenset(periodic))

    @classmethod
    def parse(cls, words: Iterable[str]) -> "Addresses":
        """Read ``REQUEST:ANSWER``, or one identifier alone for requests to all; nothing else is taken then.

        Raises
        ------
        BrakebenchError : no identifier, or both are the same.
        """
        pairs: list[tuple[Identifier, Identifier]] = []
        functional: list[Identifier] = []
        for word in words:
            request, colon, answer = word.partition(":")
            if not colon:
                functional.append(Identifier.parse(request))
                continue
            pairs.append((Identifier.parse(request), Identifier.parse(answer)))
            if pairs[-1][0] == pairs[-1][1]:
                raise BrakebenchError(f"--uds-ids {word}: request and answer have the same identifier")
        return cls.of(pairs, functional, standard=False)

    def partner(self, identifier: Identifier) -> Identifier | None:
        """Other end of its connection; None for requests to all, and where it has none."""
        found = self.partners.get(identifier)
        return found or (standard_partner(identifier) if self.standard else None)

    def is_functional(self, identifier: Identifier) -> bool:
        """Whether its requests go to all."""
        return identifier in self.functional or (self.standard and is_standard_functional(identifier))

    def among(self, keys: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """Whether each key is one of these identifiers."""
        told = np.array([one.key for one in (*self.partners, *self.functional, *self.periodic)], np.int64)
        mask = np.isin(keys, told)
        return mask | standard_keys(keys) if self.standard else mask
