import gzip
import io
import shutil
import struct
import subprocess
from datetime import UTC
from pathlib import Path

import numpy as np
import pytest
from log_mutants import COLUMNS, assert_alike, mutant, read_both, rows, varied

from hil.log import builder as builder_module
from hil.log.capture import packets
from hil.log.capture.pcap import write_pcapng
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts

DATA = Path(__file__).parents[4] / "data" / "logs"
REMOTE, ERROR, FD, SENT = FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.FD, FrameFlag.SENT
BRS, ESI = FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE


def can(word, data=b"", length=None, bits=0, order=">", size=None):
    frame = struct.pack(order + "IBBBB", word, len(data) if length is None else length, bits, 0, 0) + data
    return frame.ljust(size or (72 if len(data) > 8 else 16), b"\0")


def cooked(frame, protocol=0x0C, kind=0):
    return struct.pack(">HHH8sH", kind, 280, 0, b"", protocol) + frame


def cooked_2(frame, protocol=0x0C, kind=0, interface=3):
    return struct.pack(">HHIHBB8s", protocol, 0, interface, 280, kind, 0, b"") + frame


def pcap(*packets, link=227, order="<", magic=0xA1B2C3D4, snapped=65535):
    content = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, snapped, link)
    for k, packet in enumerate(packets):
        kept = packet[:snapped]
        content += struct.pack(order + "4I", 1_700_000_000, k + 1, len(kept), len(packet)) + kept
    return content


def block(kind, body, order="<"):
    body += bytes(-len(body) % 4)
    length = struct.pack(order + "I", len(body) + 12)
    return struct.pack(order + "I", kind) + length + body + length


def option(code, value, order="<"):
    return struct.pack(order + "2H", code, len(value)) + value + bytes(-len(value) % 4)


def section(order="<"):
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(link=227, options=b"", order="<", snapped=0):
    return block(1, struct.pack(order + "HHI", link, 0, snapped) + options, order)


def packet(number, ticks, data, options=b"", order="<", size=None):
    head = struct.pack(order + "5I", number, ticks >> 32, ticks & 0xFFFFFFFF, len(data), size or len(data))
    return block(6, head + data + bytes(-len(data) % 4) + options, order)


@pytest.fixture
def read(tmp_path):
    def read(content):
        path = tmp_path / "a.cap"
        path.write_bytes(content)
        careful, compiled = read_both(path, None)
        assert_alike(careful, compiled)
        if isinstance(careful, str):
            raise LogError(path, careful)
        return careful

    return read


def test_a_public_capture():
    careful, compiled = read_both(DATA / "can.pcap", None)
    assert_alike(careful, compiled)
    frames, account = careful
    assert len(frames) == 300
    assert set(frames.can_id.tolist()) == {0x123}
    assert frames.time_ns[1] == 1_700_000_001_000_001_000
    assert account.whole


@pytest.mark.parametrize(
    ("frame", "row"),
    [
        (can(0x123, b"\x01\x02"), (0x123, False, 0, 2, "0102")),
        (can(0x9FFFFFFF, bytes(8)), (0x1FFFFFFF, True, 0, 8, "00" * 8)),
        (can(0x40000123, length=4), (0x123, False, REMOTE, 4, "")),
        (can(0x20000004, b"\x00\x11" + bytes(6)), (4, False, ERROR, 8, "0011000000000000")),
        (can(0xA0000004, bytes(8)), (4, False, ERROR, 8, "00" * 8)),
        (can(0x123, bytes(range(64)), bits=4), (0x123, False, FD, 64, bytes(range(64)).hex())),
        (can(0x123, bytes(5), bits=7, size=72), (0x123, False, FD | BRS | ESI, 5, "00" * 5)),
        (can(0x123, bytes(5), bits=1, size=72), (0x123, False, FD | BRS, 5, "00" * 5)),
        (can(0x123, bytes(5), bits=0, size=13), (0x123, False, 0, 5, "00" * 5)),
        (can(0x123, bytes(8)).replace(b"\0\0\0\0", b"\0\0\x0f\0", 1), (0x123, False, 0, 8, "00" * 8)),
    ],
    ids=[
        "data",
        "extended",
        "remote",
        "error",
        "extended error",
        "fd",
        "fd bits",
        "fd by size",
        "no padding",
        "dlc 15",
    ],
)
def test_each_kind_of_frame(read, frame, row):
    frames, account = read(pcap(*[frame] * 3))
    assert [r[2:] for r in rows(frames)] == [row] * 3
    assert frames.channels == ("can0",)
    assert account.whole


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize(("magic", "unit"), [(0xA1B2C3D4, 1000), (0xA1B23C4D, 1)])
def test_byte_orders_and_units(read, order, magic, unit):
    frames, _ = read(pcap(can(0x123), can(0x124), order=order, magic=magic))
    assert frames.time_ns.tolist() == [1_700_000_000 * 10**9 + k * unit for k in (1, 2)]
    assert frames.can_id.tolist() == [0x123, 0x124]


@pytest.mark.parametrize("order", "<>")
def test_cooked_captures_have_identifiers_in_the_order_of_the_file(read, order):
    frames, account = read(
        pcap(
            cooked(can(0x80000123, b"\x05", order=order)),
            cooked(can(0x123, bytes(12), order=order), 0x0D, kind=4),
            cooked(bytes(80), 0x0E),
            cooked(bytes(60), 0x0800),
            link=113,
            order=order,
        )
    )
    assert [r[1:] for r in rows(frames)] == [
        ("can0", 0x123, True, 0, 1, "05"),
        ("can0", 0x123, False, FD | SENT, 12, "00" * 12),
    ]
    assert account.passed_over == {"CAN XL": 1, "protocol 0x0800": 1}
    frames, account = read(
        pcap(
            cooked_2(can(0x123, b"\x05", order=order)),
            cooked_2(can(0x124, order=order), kind=4, interface=7),
            cooked_2(can(0x125, order=order), kind=4, interface=70_000),
            link=276,
            order=order,
        )
    )
    assert [r[1:5] for r in rows(frames)] == [
        ("if3", 0x123, False, 0),
        ("if7", 0x124, False, SENT),
        ("if70000", 0x125, False, SENT),
    ]


def test_other_packets_are_passed_over(read):
    with pytest.raises(LogError, match=r"no CAN frame in it \(2 of link type 1\)"):
        read(pcap(bytes(60), bytes(1500), link=1))
    assert read(pcap())[1].whole
    frames, account = read(pcap(can(1, length=0x80, size=100), can(2)))
    assert (frames.can_id.tolist(), account.passed_over) == ([2], {"CAN XL": 1})


def test_what_the_capture_cut_short_is_rejected(read):
    frames, account = read(pcap(can(1), can(2, bytes(64), bits=4), can(3), snapped=40))
    assert frames.can_id.tolist() == [1, 3]
    assert account.rejected == 1
    assert account.truncated_at is None


@pytest.mark.parametrize(
    "frame", [can(0x800), can(0x123, bytes(9), bits=4, size=72), can(0x123, bytes(20), length=65, size=72)]
)
def test_a_packet_that_is_no_frame_is_rejected(read, frame):
    frames, account = read(pcap(can(1), frame, can(2)))
    assert frames.can_id.tolist() == [1, 2]
    assert account.first_rejected[0].offset == 24 + 32


@pytest.mark.parametrize("size", [1, 15, 16, 20, 31])
def test_a_file_that_ends_within_a_record(read, size):
    frames, account = read(pcap(can(1), can(2), can(3))[: 24 + 64 + size])
    assert frames.can_id.tolist() == [1, 2]
    assert (account.rejected, account.truncated_at) == (1, 24 + 64)


@pytest.mark.parametrize("length", [0, 7, 15, 17, 90, 1000, 60_000, 0xFFFFFFFF])
def test_a_damaged_length_costs_few_frames(read, length):
    content = bytearray(pcap(*[can(k + 1, bytes([k] * 8)) for k in range(40)]))
    struct.pack_into("<I", content, 24 + 5 * 32 + 8, length)
    frames, account = read(bytes(content))
    assert frames.can_id.tolist()[:5] == [1, 2, 3, 4, 5]
    assert frames.can_id.tolist()[-33:] == list(range(8, 41))
    assert account.rejected >= 1
    assert account.truncated_at is None


def test_rubbish_between_records(read):
    part = pcap(can(1), can(2))
    frames, account = read(part + b"\xff" * 300 + pcap(can(3), can(4))[24:])
    assert frames.can_id.tolist() == [1, 2, 3, 4]
    assert account.rejected == 1
    assert account.first_rejected[0].offset == len(part)


def test_good_frames_between_damaged_ones(read):
    head, good = pcap(), pcap(can(1, b"1234"))[24:]
    frames, account = read(head + (good.replace(b"\x10", b"\xff", 1) + good) * 50)
    assert (len(frames), account.rejected) == (50, 50)


def test_no_capture(tmp_path, read):
    with pytest.raises(LogError, match="no pcap file"):
        read(b"\xd4\xc3\xb2\xa1rubbish")
    with pytest.raises(LogError, match="no pcapng file"):
        read(b"\x0a\x0d\x0d\x0arubbish")


@pytest.mark.parametrize("order", "<>")
def test_interfaces_have_names_and_resolutions(read, order):
    ticks = 1_700_000_000
    options = [
        option(2, b"vehicle bus", order),
        option(2, b"ns", order) + option(9, b"\x09", order),
        option(2, b"power", order) + option(9, b"\x94", order) + option(14, struct.pack(order + "q", -5), order),
        option(9, b"\x0c", order),
        option(2, b"big", order) + option(9, b"\xc0", order),
    ]
    per_second = [10**6, 10**9, 1 << 20, 10**12, 1 << 64]
    content = section(order) + b"".join(interface(options=o + bytes(4), order=order) for o in options)
    for k, scale in enumerate(per_second):
        content += packet(k, min(ticks * scale + scale // 4, 2**64 - 1), can(k), order=order) * 2
    frames, account = read(content)
    assert frames.channels == ("vehicle bus", "ns", "power", "can3", "big")
    quarter = ticks * 10**9 + 250_000_000
    assert frames.time_ns[::2].tolist() == [quarter, quarter, quarter - 5 * 10**9, (2**64 - 1) // 1000, 999_999_999]
    assert account.whole


@pytest.mark.parametrize("order", "<>")
def test_blocks_of_all_kinds(read, order):
    flags = option(2, struct.pack(order + "I", 2), order) + bytes(4)
    comment = option(1, b"ten letters", order)
    content = (
        section(order)
        + interface(order=order)
        + interface(1, order=order)
        + interface(113, option(2, b"any", order), order=order)
        + block(4, bytes(8), order)
        + packet(0, 1, can(1), comment + flags, order)
        + packet(1, 2, bytes(60), order=order)
        + packet(2, 3, cooked(can(2, order=order)), order=order)
        + block(0x0BAD, bytes(20), order)
        + block(3, struct.pack(order + "I", 16) + can(3), order)
        + block(2, struct.pack(order + "2H4I", 0, 0, 0, 5, 16, 16) + can(4), order)
        + packet(9, 6, can(5), order=order)
    )
    other = "<" if order == ">" else ">"
    content += section(other) + interface(options=option(2, b"second", other), order=other)
    content += packet(0, 7, can(6), order=other)
    frames, account = read(content)
    assert [r[:5] for r in rows(frames)] == [
        (1000, "can0", 1, False, SENT),
        (3000, "any", 2, False, 0),
        (3000, "can0", 3, False, 0),
        (5000, "can0", 4, False, 0),
        (7000, "second", 6, False, 0),
    ]
    assert account.rejected == 1
    assert account.passed_over == {"link type 1": 1}
    assert "no stamp" in account.notes[0]


@pytest.mark.parametrize("length", [0, 13, 44, 52, 400, 0xFFFFFFFC])
def test_a_damaged_block_costs_itself(read, length):
    begin = section() + interface()
    blocks = [packet(0, k, can(k + 1, bytes([k] * 8))) for k in range(30)]
    broken = bytearray(blocks[5])
    struct.pack_into("<I", broken, 4, length)
    frames, account = read(begin + b"".join(blocks[:5]) + bytes(broken) + b"".join(blocks[6:]))
    assert frames.can_id.tolist() == [*range(1, 6), *range(7, 31)]
    assert account.first_rejected[0].offset == len(begin) + 5 * len(blocks[0])
    assert account.truncated_at is None


@pytest.mark.parametrize("size", [1, 11, 12, 30, 47])
def test_a_file_that_ends_within_a_block(read, size):
    begin = section() + interface() + packet(0, 1, can(1))
    frames, account = read(begin + packet(0, 2, can(2))[:size])
    assert frames.can_id.tolist() == [1]
    assert (account.rejected, account.truncated_at) == (1, len(begin))


def test_packed(tmp_path):
    path = tmp_path / "can.pcap.gz"
    path.write_bytes(gzip.compress((DATA / "can.pcap").read_bytes()))
    careful, compiled = read_both(path, None)
    assert_alike(careful, compiled)
    assert len(careful[0]) == 300


def written(tables, facts=None):
    file = io.BytesIO()
    write_pcapng(file, tables, facts or LogFacts.of(tables), UTC)
    return file.getvalue()


@pytest.mark.parametrize("directed", [False, True])
def test_what_is_written_reads_back_exactly(read, directed):
    table = varied(500)
    if not directed:
        table.flags[:] &= np.uint8(~SENT & 0xFF)
    frames, account = read(written([table.take(slice(0, 300)), table.take(slice(300, 500))]))
    assert account.whole
    assert (table.time_ns < 0).any()
    for column in COLUMNS:
        if column != "channel":
            assert np.array_equal(getattr(frames, column), getattr(table, column)), column
    assert [row[1] for row in rows(frames)] == [row[1] for row in rows(table)]


def test_extreme_stamps_and_no_frame_at_all(read):
    table = FrameTable.empty(2, channels=("a",))
    table.time_ns[:] = (-(2**63), 2**63 - 10**9)
    assert read(written([table]))[0].time_ns.tolist() == [-(2**63), 2**63 - 10**9]
    assert len(read(written([], LogFacts()))[0]) == 0
    assert len(read(written([FrameTable.empty()]))[0]) == 0
    only_fd = table.take(slice(0, 1))
    only_fd.flags[:] = FD
    assert read(written([only_fd]))[0].flags.tolist() == [FD]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_what_is_written(tmp_path):
    table = varied(200, names=("vehicle", "bench"))
    table.time_ns[:] = np.abs(table.time_ns)
    path = tmp_path / "a.pcapng"
    path.write_bytes(written([table]))
    fields = ["frame.time_epoch", "frame.interface_name", "can.id", "can.flags.xtd", "can.flags.rtr", "can.flags.err",
              "can.len", "frame.packet_flags_direction", "canfd.flags.brs", "canfd.flags.esi"]  # fmt: skip
    command = ["tshark", "-r", str(path), "-T", "fields", *(f"-e{field}" for field in fields)]
    out = subprocess.run(command, capture_output=True, check=True, text=True).stdout.splitlines()
    assert len(out) == len(table)
    for line, (time_ns, channel, can_id, extended, flags, length, _) in zip(out, rows(table), strict=True):
        stamp, name, number, wide, remote, error, size, direction, brs, esi = line.split("\t")
        assert int(stamp.replace(".", "")) == time_ns
        assert name == channel
        assert int(size) == length
        assert int(direction, 0) == (2 if flags & SENT else 1)
        if not flags & ERROR:
            assert int(number, 0) == can_id
            assert [bool(int(bit or "0")) for bit in (wide, remote, brs, esi)] == [
                extended, bool(flags & REMOTE), bool(flags & BRS), bool(flags & ESI)
            ]  # fmt: skip
        else:
            assert error == "1"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["pcap", "pcapng", "cooked"])
def test_mutants(tmp_path, monkeypatch, form):
    monkeypatch.setattr(packets, "BLOCK_BYTES", 500)
    monkeypatch.setattr(builder_module.FrameBuilder.__init__, "__defaults__", (None, 7))

    def frames(order):
        return [can(k, bytes([k] * (k % 9 if k % 4 else 24)), None, 0 if k % 4 else 5, order) for k in range(24)]

    wrapped = [cooked_2(frame, 0x0C if k % 4 else 0x0D, k % 5, k % 3) for k, frame in enumerate(frames("<"))]
    content = {
        "pcap": pcap(*frames(">")),
        "pcapng": written([varied(24, names=("a", "b"))]),
        "cooked": section() + interface(276) + b"".join(packet(0, k, frame) for k, frame in enumerate(wrapped)),
    }[form]
    path = tmp_path / "mutant"
    path.write_bytes(content)
    careful, compiled = read_both(path, None)
    assert_alike(careful, compiled)
    assert len(careful[0]) == 24
    for seed in range(2000):
        path.write_bytes(mutant(seed, content))
        assert_alike(*read_both(path, form.replace("cooked", "pcapng")))
