"""Inputs of one megabyte that no tool wrote: harmless, and each the worst we know for some reader of ours."""

import gzip
import random
import struct
import zlib
from collections.abc import Callable, Iterator

MEGABYTE = 1_000_000
LINE = b"(1700000000.000001) can0 123#1122334455667788\n"


def _filled(piece: bytes, head: bytes = b"") -> bytes:
    return (head + piece * (MEGABYTE // len(piece) + 1))[:MEGABYTE]


def _counted(form: str, head: str = "") -> bytes:
    lines, size, i = [head.encode()], len(head), 0
    while size < MEGABYTE:
        lines.append(form.format(i=i, x=i % 0x1FFFFFFF).encode())
        size += len(lines[-1])
        i += 1
    return b"".join(lines)[:MEGABYTE]


def _object(kind: int, body: bytes, size: int | None = None) -> bytes:
    return struct.pack("<4sHHII", b"LOBJ", 16, 1, 16 + len(body) if size is None else size, kind) + body


def _blf(content: bytes) -> bytes:
    return b"LOGG" + struct.pack("<I", 144) + bytes(136) + content


def _container(inner: bytes, stated: int | None = None) -> bytes:
    packed = zlib.compress(inner, 9)
    return _object(10, struct.pack("<H6xI4x", 2, len(inner) if stated is None else stated) + packed)


def _noise(n: int, seed: int = 1) -> bytes:
    return random.Random(seed).randbytes(n)


ASC = "date Wed Jan 15 12:00:00.000 2025\nbase hex  timestamps absolute\n"
TRC = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n"
OURS = "time_s,channel,id,extended,flags,length,data\n"
GVRET = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
PCAP = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
_FRAME = struct.pack(">IB3x8x", 0x123, 8)
_SECTION = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)


def _record(packet: bytes) -> bytes:
    return struct.pack("<IIII", 1, 1, len(packet), len(packet)) + packet


LOGS: dict[str, Callable[[], bytes]] = {
    "one line of letters": lambda: LINE + _filled(b"A"),
    "one line of digits": lambda: LINE + b"(" + _filled(b"9"),
    "one line of blanks": lambda: LINE + _filled(b" "),
    "one line of brackets": lambda: LINE + _filled(b"(1.0) can0 1"),
    "line ends": lambda: LINE + _filled(b"\n"),
    "carriage returns": lambda: LINE + _filled(b"\r"),
    "zero bytes": lambda: LINE + _filled(b"\0"),
    "noise": lambda: LINE + _noise(MEGABYTE),
    "lines that are no frames": lambda: LINE + _filled(b"x\n"),
    "another channel every line": lambda: _counted("(1.0) c{i:x} 123#11\n"),
    "another identifier every line": lambda: _counted("(1.0) can0 {x:08X}#11\n"),
    "frames without data": lambda: _filled(b"(1.0) can0 123#\n"),
    "CAN FD frames without data": lambda: _filled(b"(1.0) can0 123##0\n"),
    "stamps of many digits": lambda: LINE + _filled(b"(1." + b"1" * 4000 + b") can0 123#11\n"),
    "asc: one number": lambda: ASC.encode() + _filled(b"1"),
    "asc: blanks between": lambda: ASC.encode() + _filled(b"1.0 1 123 Rx d 8" + b" " * 3000 + b"\n"),
    "asc: channels": lambda: _counted("0.1 {i} 123 Rx d 1 11\n", ASC),
    "asc: dates": lambda: _filled(b"date Wed Jan 15 12:00:00.000 2025\n"),
    "trc: columns": lambda: b";$FILEVERSION=2.1\n;$COLUMNS=" + _filled(b"N,O,T,"),
    "trc: buses": lambda: _counted("{i} 1.0 DT {i} 0123 Rx - 1 11\n", TRC),
    "trc: start times": lambda: _filled(b";$STARTTIME=9e99999\n", TRC.encode()),
    "csv: one cell": lambda: OURS.encode() + b'1.0,"' + _filled(b"c"),
    "csv: quotes": lambda: OURS.encode() + _filled(b'"'),
    "csv: commas": lambda: OURS.encode() + _filled(b","),
    "csv: names": lambda: _counted('1.0,"c,{i}",1,0,,1,11\n', OURS),
    "gvret: numbers": lambda: GVRET.encode() + _filled(b"9"),
    "gvret: buses": lambda: _counted("{i},00000123,false,Rx,{i},1,11,\n", GVRET),
    "busmaster: header": lambda: (
        b"***BUSMASTER Ver 3.2.2***\n" + _filled(b"***START DATE AND TIME 1:1:2020 1:1:1:1***\n")
    ),
    "blf: signatures": lambda: _blf(_filled(b"LOBJ")),
    "blf: objects of no size": lambda: _blf(_filled(_object(1, b"", 0))),
    "blf: objects of every size": lambda: _blf(_filled(_object(1, b"", 0xFFFFFFFF))),
    "blf: container of zeros": lambda: _blf(_container(bytes(60_000_000))),
    "blf: containers of objects": lambda: _blf(_container(_filled(_object(1, b"", 16)) * 30) * 3),
    "blf: containers that state little": lambda: _blf(_container(bytes(10_000_000), 16) * 50),
    "blf: noise": lambda: _blf(_noise(MEGABYTE)),
    "mf4: noise": lambda: b"MDF     4.10    TGT 15.0" + _noise(MEGABYTE),
    "mf4: signatures": lambda: b"MDF     4.10    TGT 15.0".ljust(64, b"\0") + _filled(b"##HD" + bytes(20)),
    "pcap: records of no length": lambda: PCAP + _filled(bytes(16)),
    "pcap: records of every length": lambda: PCAP + _filled(struct.pack("<IIII", 1, 1, 0xFFFFFFFF, 0xFFFFFFFF)),
    "pcap: frames and damages by turns": lambda: (
        PCAP + _filled(_record(_FRAME) + struct.pack("<IIII", 1, 1, 0xFFFF, 0xFFFF) + _FRAME)
    ),
    "pcap: records of one byte": lambda: PCAP + _filled(_record(b"x")),
    "pcapng: interfaces": lambda: _SECTION + _filled(struct.pack("<IIHHII", 1, 20, 227, 0, 0, 20)),
    "pcapng: blocks that do not end": lambda: _SECTION + _filled(struct.pack("<II", 6, 1 << 19)),
    "pcapng: sections": lambda: _filled(_SECTION),
    "pcapng: noise": lambda: _SECTION + _noise(MEGABYTE),
    "parquet: noise": lambda: b"PAR1" + _noise(MEGABYTE) + b"PAR1",
    "gzip: zeros": lambda: gzip.compress(bytes(900_000_000), 9),
    "gzip: frames": lambda: gzip.compress(LINE * 6_000_000, 9),
    "gzip: in gzip": lambda: gzip.compress(gzip.compress(LINE * 100_000)),
    "gzip: noise": lambda: b"\x1f\x8b\x08\0" + _noise(MEGABYTE),
}

HEAD = 'VERSION ""\nBU_: A\n'
ONE = HEAD + 'BO_ 1 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'

DATABASES: dict[str, Callable[[], bytes]] = {
    "messages": lambda: _counted('BO_ {i} M{i}: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n', HEAD),
    "one message, many signals": lambda: _counted(' SG_ S{i} : 0|64@1+ (1,0) [0|0] "" A\n', HEAD + "BO_ 1 M: 8 A\n"),
    "one signal, many names": lambda: _counted(' SG_ S : 0|8@1+ (1,0) [0|0] "" A\n', HEAD + "BO_ 1 M: 8 A\n"),
    "one identifier": lambda: _counted("BO_ 1 M{i}: 8 A\n", HEAD),
    "one name": lambda: _counted("BO_ {i} M: 8 A\n", HEAD),
    "value table": lambda: ONE.encode() + b"VAL_ 1 S " + _counted('{i} "v{i}" '),
    "value tables": lambda: _counted('VAL_ 1 S {i} "v" ;\n', ONE),
    "multiplexer ranges": lambda: _counted("SG_MUL_VAL_ 1 S S 0-{i};\n", ONE),
    "wide multiplexer ranges": lambda: _counted("SG_MUL_VAL_ 1 S S 0-18446744073709551615;\n", ONE),
    "attributes": lambda: _counted('BA_ "A{i}" BO_ 1 {i};\n', ONE),
    "comments": lambda: _counted('CM_ SG_ 1 S "c{i}";\n', ONE),
    "open string": lambda: ONE.encode() + b'CM_ "' + _filled(b"c"),
    "quotes": lambda: ONE.encode() + _filled(b'"'),
    "backslashes": lambda: ONE.encode() + b'CM_ "' + _filled(b"\\"),
    "semicolons": lambda: ONE.encode() + _filled(b";"),
    "blanks": lambda: ONE.encode() + b"BO_" + _filled(b" "),
    "digits": lambda: ONE.encode() + b"BO_ " + _filled(b"9"),
    "nodes": lambda: _counted("N{i} ", 'VERSION ""\nBU_: ') + b'\nBO_ 1 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n',
    "noise": lambda: ONE.encode() + _noise(MEGABYTE),
    "xml": lambda: b'<?xml version="1.0"?>' + _filled(b"<a>"),
    "kcd: deep": lambda: (
        b'<?xml version="1.0"?><NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">' + _filled(b"<Bus>")
    ),
    "sym": lambda: b"FormatVersion=6.0\n" + _filled(b"[a]\n"),
}


def inputs() -> Iterator[tuple[str, bytes]]:
    """All of them, logs and databases, by name."""
    for name, make in LOGS.items():
        yield f"log: {name}", make()
    for name, make in DATABASES.items():
        yield f"database: {name}", make()
