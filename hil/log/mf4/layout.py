"""What an MDF 4 file describes: data groups, channel groups, and the channels in their records."""

from dataclasses import dataclass, field
from fractions import Fraction

MAX_RECORD_BYTES = 65_536

KINDS = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame")
OTHER_BUSES = {"CAN_OverloadFrame": "CAN overload", "LIN": "LIN", "FLX": "FlexRay", "MOST": "MOST", "ETH": "Ethernet"}

# Flags of an unfinalised file
CYCLES_OPEN, LENGTH_OPEN, LIST_OPEN, VLSD_OFFSETS_OPEN = 0x1, 0x4, 0x10, 0x40
# Types of channels
VLSD, MASTER, VIRTUAL_MASTER, MLSD, VIRTUAL = 1, 2, 3, 5, 6
# Flags of channel groups
CG_VLSD, CG_REMOTE_MASTER = 0x1, 0x8


@dataclass(slots=True)
class Member:
    """One channel as it stands in a record.

    Attributes
    ----------
    kind : 0 fixed length, `VLSD`, `MASTER`, `VIRTUAL_MASTER`, `MLSD`, `VIRTUAL`.
    data_type : 0, 1 unsigned, 2, 3 signed, 4, 5 floating point (little, big endian); others are bytes.
    byte, bit, bits : first byte in the record (behind its id), first bit in that byte, number of bits.
    invalid_bit : number of its bit in the invalidation bytes; None where all samples are valid.
    data : link to its signal data, of a channel of variable length.
    factor, offset : of a linear conversion.
    linear : False where its conversion is of another kind.
    """

    kind: int
    data_type: int
    byte: int
    bit: int
    bits: int
    invalid_bit: int | None = None
    data: int = 0
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    linear: bool = True

    @property
    def floating(self) -> bool:
        """Raw values are floating-point numbers."""
        return self.data_type in (4, 5)


@dataclass(slots=True)
class Group:
    """One channel group: records of one layout.

    Attributes
    ----------
    kind : one of `KINDS`, or "" where it holds no CAN frames.
    members : channels of the frame by their bare name ("ID", "DataBytes", ...).
    frame : the channel that is the whole frame.
    holds : what it is a group of, where it holds no CAN frames.
    channel : number of its bus channel, for frames that name none: that of its name ("CAN2").
    """

    address: int
    record_id: int
    cycles: int
    flags: int
    data_bytes: int
    inval_bytes: int
    master_link: int = 0
    master: Member | None = None
    kind: str = ""
    frame: Member | None = None
    members: dict[str, Member] = field(default_factory=dict)
    holds: str = "signal"
    channel: int = 1

    @property
    def vlsd(self) -> bool:
        """Its records are values of a channel of another group."""
        return bool(self.flags & CG_VLSD)


@dataclass(slots=True)
class DataGroup:
    """One data group: channel groups whose records stand in one stream of data."""

    address: int
    data: int
    id_bytes: int
    groups: list[Group] = field(default_factory=list)
