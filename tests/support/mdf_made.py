"""MDF 4 files made block by block, in layouts that our writer does not write."""

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np

FRAME = (  # name, byte, bit, bits: packed as loggers do
    ("BusChannel", 8, 0, 4),
    ("ID", 8, 4, 29),
    ("IDE", 12, 1, 1),
    ("Dir", 12, 2, 1),
    ("EDL", 12, 3, 1),
    ("BRS", 12, 4, 1),
    ("ESI", 12, 5, 1),
    ("DLC", 13, 0, 4),
    ("DataLength", 14, 0, 7),
)


@dataclass
class Cn:
    """One channel."""

    name: str
    byte: int = 0
    bit: int = 0
    bits: int = 64
    data_type: int = 0
    kind: int = 0
    sync: int = 0
    linear: tuple[float, float] | None = None
    members: list["Cn"] = field(default_factory=list)
    data: int = 0
    flags: int = 0
    invalid: int = 0


@dataclass
class Cg:
    """One channel group; ``vlsd_of``: (group, channel name) whose values its records are."""

    channels: list[Cn]
    data_bytes: int
    cycles: int
    record_id: int = 0
    flags: int = 6
    inval_bytes: int = 0
    master: int = 0


class Made:
    """Grows block by block; ``raw`` is the file."""

    def __init__(self, version=410, start_ns=0, time_flags=2, unfinalised=None):
        self.raw = bytearray(64)
        sign = b"MDF     " if unfinalised is None else b"UnFinMF "
        text = f"{version // 100}.{version % 100:02d}    ".encode()
        struct.pack_into("<8s8s8s4xH30xHH", self.raw, 0, sign, text, b"made", version, unfinalised or 0, 0)
        self.block(b"HD", [0] * 6, struct.pack("<QhhBBBxdd", start_ns, 0, 0, time_flags, 0, 0, 0, 0))
        self.link_at = 64 + 24  # where the link to the next data group stands

    def block(self, ident, links=(), data=b"", length=None):
        self.raw += bytes(-len(self.raw) % 8)
        at = len(self.raw)
        size = 24 + 8 * len(links) + len(data)
        self.raw += struct.pack("<4s4xQQ", b"##" + ident, size if length is None else length, len(links))
        self.raw += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def patch(self, at, value):
        struct.pack_into("<Q", self.raw, at, value)

    def text(self, text):
        return self.block(b"TX", (), text.encode() + b"\0") if text else 0

    def channels(self, channels, addresses):
        following = 0
        for c in reversed(channels):
            inner = self.channels(c.members, addresses) if c.members else 0
            conversion = 0
            if c.linear:
                conversion = self.block(b"CC", [0] * 4, struct.pack("<BBHHH4d", 1, 0, 0, 0, 2, 0, 0, *c.linear))
            facts = struct.pack("<4B4I52x", c.kind, c.sync, c.data_type, c.bit, c.byte, c.bits, c.flags, c.invalid)
            following = self.block(b"CN", [following, inner, self.text(c.name), 0, conversion, c.data, 0, 0], facts)
            addresses[c.name] = following
        return following

    def group(self, groups, data=0, id_bytes=0):
        """Data group; returns (its address, addresses of the groups, addresses of channels by group)."""
        following, places, names = 0, [], []
        for g in reversed(groups):
            addresses = {}
            first = self.channels(g.channels, addresses)
            facts = struct.pack("<QQHH4xII", g.record_id, g.cycles, g.flags, 46, g.data_bytes, g.inval_bytes)
            links = [following, first, 0, 0, 0, 0] + ([g.master] if g.master else [])
            following = self.block(b"CG", links, facts)
            places.insert(0, following)
            names.insert(0, addresses)
        dg = self.block(b"DG", [0, following, data, 0], struct.pack("<B7x", id_bytes))
        self.patch(self.link_at, dg)
        self.link_at = dg + 24
        return dg, places, names

    def packed(self, content, columns=0, ident=b"DT"):
        """Deflated block; transposed where ``columns`` is given."""
        raw = content
        if columns:
            lines = len(content) // columns
            square = np.frombuffer(content[: lines * columns], np.uint8).reshape(lines, columns)
            raw = square.T.tobytes() + content[lines * columns :]
        z = zlib.compress(raw)
        head = struct.pack("<2sBxIQQ", ident, 1 if columns else 0, columns, len(content), len(z))
        return self.block(b"DZ", (), head + z)

    def data(self, content, piece=None, way="plain", columns=0, equal=False, ident=b"DT", per_list=3):
        """Data in one block, or in lists of blocks of ``piece`` bytes."""
        parts = [content] if piece is None else [content[i : i + piece] for i in range(0, len(content), piece)]

        def one(part):
            if way == "plain":
                return self.block(ident, (), part)
            return self.packed(part, columns if way == "transposed" else 0, ident)

        blocks = [one(part) for part in parts]
        if piece is None:
            return blocks[0] if blocks else 0
        following = 0
        starts = list(range(0, len(blocks), per_list))
        for begin in reversed(starts):
            links = blocks[begin : begin + per_list]
            n = len(links)
            if equal:
                facts = struct.pack("<B3xIQ", 1, n, piece)
            else:
                facts = struct.pack(f"<B3xI{n}Q", 0, n, *[piece * (begin + k) for k in range(n)])
            following = self.block(b"DL", [following, *links], facts)
        if way == "plain":
            return following
        return self.block(b"HL", [following], struct.pack("<HB5x", int(equal), int(way == "transposed")))

    def __bytes__(self):
        return bytes(self.raw)


def time(bits=64, data_type=4, linear=None, byte=0):
    return Cn("t", byte, 0, bits, data_type, kind=2, sync=1, linear=linear)


def frame(kind="CAN_DataFrame", members=FRAME, width=8, payload="fixed", prefix=True, data=0, data_byte=15):
    """Channel of a whole frame, its members packed; ``payload``: fixed, vlsd, mlsd or none."""
    lead = f"{kind}." if prefix else ""
    inner = [Cn(lead + name, byte, bit, bits) for name, byte, bit, bits in members]
    if payload == "vlsd":
        inner.append(Cn(lead + "DataBytes", data_byte, 0, 64, 10, kind=1, data=data))
    elif payload != "none":
        inner.append(Cn(lead + "DataBytes", data_byte, 0, 8 * width, 10, kind=5 if payload == "mlsd" else 0))
    return Cn(kind, 8, 0, 8 * 7, 10, members=inner)


def record(t, channel, can_id, data, width=8, extended=False, sent=False, fd=0, dlc=None, length=None, stamp="<d"):
    """Record of the layout `FRAME`, packed by plain arithmetic; ``width`` None: ``data`` is an offset."""
    word = channel | can_id << 4 | extended << 33 | sent << 34
    word |= (fd & 1) << 35 | (fd >> 1 & 1) << 36 | (fd >> 2 & 1) << 37
    size = len(data) if width is not None else length
    code = next(i for i, n in enumerate((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)) if n >= size)
    head = struct.pack(stamp, t) + word.to_bytes(5, "little")
    head += bytes([code if dlc is None else dlc, size if length is None else length])
    return head + (struct.pack("<Q", data) if width is None else data.ljust(width, b"\0"))
