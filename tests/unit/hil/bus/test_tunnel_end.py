"""A tunnel's two ends over a line of any delay, with clocks that have nothing in common: no socket, virtual time."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus.tunnel_end import HEARTBEAT_NS, TunnelCounts, TunnelEnd
from hil.bus.tunnel_wire import HELLO, GarbledError, Packet, PacketReader, pack

MS = 1_000_000
LIFETIME_NS = 20 * MS
ITEMS = [
    Frame(BusName.VEHICLE, 0x123, b"\x01\x02", 7),
    Frame(BusName.BENCH, 0x1ABCDEF0, b"", 8, True),
    LinkEvent(BusName.BENCH, LinkState.DISCONNECTED, 9),
    LinkEvent(BusName.VEHICLE, LinkState.RX_OVERFLOW, 10, 70_000),
]
STREAM = HELLO + pack(Packet(11, -5, 1, 2, ITEMS)) + pack(Packet(12, -(1 << 63), 0, 0, []))


def essence(packets):
    return [
        (packet[:4], [item._replace(detail="") if isinstance(item, LinkEvent) else item for item in packet.items])
        for packet in packets
    ]


@pytest.mark.parametrize("size", [1, 3, 29, 1000])
def test_packets_survive_any_way_of_cutting_the_stream(size):
    reader = PacketReader()
    packets = [packet for at in range(0, len(STREAM), size) for packet in reader.feed(STREAM[at : at + size])]
    assert essence(packets) == [((11, -5, 1, 2), ITEMS), ((12, -(1 << 63), 0, 0), [])]


@given(at=st.integers(0, len(STREAM) - 1), byte=st.integers(0, 255), tail=st.binary(max_size=80))
def test_garbled_bytes_are_packets_or_an_error_in_words(at, byte, tail):
    garbled = STREAM[:at] + bytes([byte]) + STREAM[at + 1 :] + tail
    end = TunnelEnd(LIFETIME_NS, TunnelCounts())
    try:
        passed = end.feed(garbled, 1000)
    except GarbledError:
        return
    for item in passed:
        assert item.bus in BusName
        assert 0 <= item.time_ns <= 1000
    end.packets(2000)


def test_somebody_else_is_told_from_the_first_bytes():
    with pytest.raises(GarbledError, match=r"expected a tunnel that begins with b'BBTUNL1.*got b'GET / HTTP"):
        PacketReader().feed(b"GET / HTTP/1.1\r\n")


class Line:
    """Two ends in virtual time; ``delays`` gives each packet's time on its way, ns, never overtaking."""

    def __init__(self, ahead_ns, delay_ns):
        self.now_ns = 10**12
        self.ahead_ns = ahead_ns
        self.delay_ns = delay_ns
        self.counts = TunnelCounts(), TunnelCounts()
        self.ends = [TunnelEnd(LIFETIME_NS, counts) for counts in self.counts]
        self.ways = [[(self.now_ns, HELLO)], [(self.now_ns, HELLO)]]
        self.stalled = [False, False]
        self.passed = [[], []]  # (true time, item) that came out of each end

    def clock_ns(self, end):
        return self.now_ns + (self.ahead_ns if end == 0 else 0)

    def advance(self, by_ns, step_ns=MS):
        for _ in range(by_ns // step_ns):
            self.now_ns += step_ns
            for end in (0, 1):
                if self.stalled[end]:
                    continue
                way = self.ways[end]
                while way and way[0][0] <= self.now_ns:
                    items = self.ends[end].feed(way.pop(0)[1], self.clock_ns(end))
                    self.passed[end] += [(self.now_ns, item) for item in items]
                out = self.ends[end].packets(self.clock_ns(end))
                if out:
                    other = self.ways[1 - end]
                    due_ns = self.now_ns + self.delay_ns(end)
                    other.append((max(due_ns, other[-1][0]) if other else due_ns, out))

    def send(self, end, can_id):
        self.ends[end].offer([Frame(BusName.VEHICLE, can_id, b"", self.clock_ns(end))])

    def frames(self, end):
        return [(at_ns, item) for at_ns, item in self.passed[end] if isinstance(item, Frame)]


@pytest.mark.parametrize("ahead_ns", [0, 5 * 10**11, -5 * 10**11])
def test_frames_pass_with_this_machines_time_whatever_the_other_clock_says(ahead_ns):
    line = Line(ahead_ns, lambda end: 2 * MS if end == 0 else 4 * MS)
    line.advance(50 * MS)
    assert all(end.joined for end in line.ends)
    for end in (0, 1):
        line.send(end, 0x10 + end)
    sent_ns = line.now_ns
    line.advance(20 * MS)
    for end, back_ns in ((1, 4 * MS), (0, 2 * MS)):
        (at_ns, frame) = line.frames(end)[0]
        assert frame.can_id == 0x10 + 1 - end
        true_ns = sent_ns + line.ahead_ns * (end == 0)
        assert true_ns - back_ns - MS <= frame.time_ns <= true_ns  # never younger than it is; older by the way back
        assert at_ns - sent_ns <= 6 * MS
        assert line.ends[end].round_trip_ns <= 8 * MS
    assert line.counts[0].too_old == line.counts[1].too_old == 0


def test_no_frame_passes_older_than_its_lifetime_on_a_line_of_wild_delays():
    rng = random.Random(1)
    line = Line(12345 * MS, lambda end: rng.choice([MS, 2 * MS, 5 * MS, 40 * MS]))
    line.advance(100 * MS)
    sent = {}
    for number in range(600):
        sent[number] = line.now_ns
        line.send(number % 2, number)
        line.advance(3 * MS)
    line.advance(100 * MS)
    for end in (0, 1):
        arrived = line.frames(end)
        assert all(at_ns - sent[frame.can_id] <= LIFETIME_NS for at_ns, frame in arrived)
        assert len(arrived) > 50
        assert line.counts[end].too_old_on_arrival > 50
        assert len(arrived) + line.counts[end].too_old_on_arrival == 300
        lost = [item for _, item in line.passed[end] if isinstance(item, LinkEvent)]
        assert {item.state for item in lost} == {LinkState.RX_OVERFLOW}
        assert sum(item.number for item in lost) == line.counts[end].too_old_on_arrival
        assert line.counts[1 - end].too_old_there == line.counts[end].too_old_on_arrival  # both ends know


def test_an_end_that_was_stopped_delivers_nothing_old_in_either_direction():
    line = Line(0, lambda end: MS)
    line.advance(50 * MS)
    line.stalled[1] = True
    for number in range(60):
        line.send(0, number)
        line.ends[1].offer([Frame(BusName.BENCH, number, b"", line.now_ns)])
        line.advance(5 * MS)
    line.stalled[1] = False
    line.advance(50 * MS)
    for end in (0, 1):
        numbers = [frame.can_id for _, frame in line.frames(end)]
        assert numbers == list(range(numbers[0], 60))
        assert numbers[0] >= 56  # of 5 ms
    assert line.counts[1].too_old_to_send == 60 - len(line.frames(0))
    assert line.counts[1].too_old_on_arrival == 60 - len(line.frames(1))
    assert line.counts[0].too_old_there == line.counts[1].too_old
    line.send(0, 0x7FF)
    line.advance(HEARTBEAT_NS)
    assert line.frames(1)[-1][1].can_id == 0x7FF


def test_a_line_slower_than_the_lifetime_passes_nothing_and_counts_all():
    line = Line(0, lambda end: 15 * MS)
    line.advance(100 * MS)
    for number in range(20):
        line.send(0, number)
        line.advance(10 * MS)
    line.advance(100 * MS)
    assert not line.frames(1)
    assert line.counts[1].too_old_on_arrival == 20  # 15 ms there, and 15 ms that it may have been longer
