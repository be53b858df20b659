"""The timed bus: order, times, acknowledge, error counters, bus-off and the way back."""

import pytest

from dbc.frame import LinkEvent, LinkState
from hil.bus.timed.bus import Sent, TimedBus
from hil.bus.timed.controller import Controller, Reception
from hil.bus.timed.frame_length import exact_bits, most_bits
from hil.bus.timed.wire import WireFrame

BIT_NS = 2_000  # at 500 kbit/s
S = 1_000_000_000
A, B, C = WireFrame(0x0A0, b"a" * 8), WireFrame(0x0B0, b"b" * 8), WireFrame(0x0C0, b"c" * 8)


def frames(controller: Controller) -> list[tuple[int, int]]:
    return [(one.time_ns, one.frame.can_id) for one in controller.receive() if isinstance(one, Reception)]


def events(controller: Controller) -> list[LinkState]:
    return [one.state for one in controller.receive() if isinstance(one, LinkEvent)]


def bits(frame: WireFrame) -> int:
    return exact_bits(frame).nominal


def test_a_frame_arrives_at_its_end() -> None:
    bus = TimedBus(500_000)
    left, right = bus.join("left"), bus.join("right")
    assert left.send(A, 1_000_000)
    end_ns = 1_000_000 + (bits(A) - 3) * BIT_NS
    bus.advance(end_ns - 1)
    assert not right.receive()
    bus.advance(end_ns)
    assert right.receive() == [Reception(A, end_ns)]
    assert not left.receive()
    assert bus.busy_ns == bits(A) * BIT_NS


def test_the_least_identifier_goes_first_and_none_is_interrupted() -> None:
    bus = TimedBus(500_000)
    left, right, ear = bus.join("left"), bus.join("right"), bus.join("ear", listen_only=True)
    left.send(C, 0)
    bus.advance(1)
    left.send(B, 1)
    right.send(A, 2)
    bus.advance(S)
    assert [can_id for _, can_id in frames(ear)] == [0xC0, 0xA0, 0xB0]


def test_a_fifo_queue_holds_its_urgent_frame_back() -> None:
    """The urgent frame waits behind its own node's others, which lose to everybody (priority inversion)."""
    order = {}
    for fifo in (False, True):
        bus = TimedBus(500_000)
        left, right, ear = bus.join("left", fifo=fifo), bus.join("right"), bus.join("ear")
        for frame in (C, A):
            left.send(frame, 0)
        for _ in range(2):
            right.send(B, 0)
        bus.advance(S)
        order[fifo] = [can_id for _, can_id in frames(ear)]
    assert order == {False: [0xA0, 0xB0, 0xB0, 0xC0], True: [0xB0, 0xB0, 0xC0, 0xA0]}


def test_a_full_queue_takes_no_more_and_says_so() -> None:
    bus = TimedBus(500_000)
    left, _ = bus.join("left", queue_length=2), bus.join("right")
    assert [left.send(A, 0) for _ in range(4)] == [True, True, False, False]
    assert left.receive() == [LinkEvent(bus.name, LinkState.TX_OVERFLOW, 0, 2, "transmit queue full")]
    assert left.dropped == 2


def test_a_lone_node_goes_passive_and_stays_there() -> None:
    """Sixteen errors of eight, then the exception of the acknowledge: never bus-off."""
    bus = TimedBus(500_000)
    lone = bus.join("lone")
    lone.send(A, 0)
    bus.advance(S)
    assert (lone.counters.transmit, lone.state) == (128, LinkState.ERROR_PASSIVE)
    assert bus.errors > 1000
    assert bus.sent == 0
    assert events(lone) == [LinkState.NO_ACK, LinkState.ERROR_WARNING, LinkState.ERROR_PASSIVE]
    other = bus.join("other")
    bus.advance(2 * S)
    assert frames(other)[0][1] == 0xA0
    assert (lone.counters.transmit, lone.state) == (127, LinkState.ERROR_WARNING)


def test_one_who_only_listens_acknowledges_nothing() -> None:
    bus = TimedBus(500_000)
    lone, ear = bus.join("lone"), bus.join("ear", listen_only=True)
    lone.send(A, 0)
    bus.advance(S)
    assert lone.state is LinkState.ERROR_PASSIVE
    assert not frames(ear)
    with pytest.raises(ValueError, match="only listens"):
        ear.send(A, S)


def test_errors_take_the_time_of_the_standard() -> None:
    """A lone node: up to the ACK slot, flag 6, delimiter 8, pause 3; once passive, 8 bits of suspension more."""
    bus = TimedBus(500_000)
    lone = bus.join("lone")
    lone.send(A, 0)
    up_to_acknowledge = bits(A) - 3 - 8
    active = up_to_acknowledge + 6 + 8 + 3
    bus.advance((16 * active - 11) * BIT_NS - 1)
    assert bus.errors == 15
    bus.advance((16 * active - 11) * BIT_NS)
    assert lone.state is LinkState.ERROR_PASSIVE
    bus.advance((16 * active + 8 + up_to_acknowledge + 6) * BIT_NS - 1)
    assert bus.errors == 16
    bus.advance((16 * active + 8 + up_to_acknowledge + 6) * BIT_NS)
    assert bus.errors == 17


def busy_bus_off(gap_bits: int) -> tuple[int, int]:
    """Time from bus-off to the return, and between two frames of others, with ``gap_bits`` behind each."""
    bus = TimedBus(500_000)
    left, right, off = bus.join("left", queue_length=10_000), bus.join("right"), bus.join("off")
    off.counters.transmit = 255
    off.counters.transmit_error()
    off.follow(0)
    assert events(off) == [LinkState.BUS_OFF]
    period_ns = (bits(A) + gap_bits) * BIT_NS
    assert not off.send(B, 0)
    for k in range(400):
        left.send(A, k * period_ns)
    bus.advance(S)
    (back,) = [one for one in off.receive() if isinstance(one, LinkEvent)]
    assert back.state is LinkState.RESTARTED
    assert (off.counters.transmit, off.state) == (0, LinkState.ERROR_ACTIVE)
    assert len(frames(right)) == 400
    return back.time_ns, period_ns


def test_recovery_takes_one_sequence_a_frame_on_a_busy_bus() -> None:
    """ACK delimiter, end of frame and pause are 11 recessive bits; the pause between frames is counted in whole 11."""
    for gap_bits, in_frames in ((0, 128), (10, 128), (11, 64)):
        back_ns, period_ns = busy_bus_off(gap_bits)
        assert -(-back_ns // period_ns) == in_frames


def test_recovery_on_an_idle_bus_takes_128_times_11_bits() -> None:
    bus = TimedBus(500_000)
    off = bus.join("off", restart_after_ns=100_000_000)
    off.counters.transmit = 256
    off.follow(0)
    bus.advance(100_000_000 + 128 * 11 * BIT_NS - 1)
    assert off.state is LinkState.BUS_OFF
    bus.advance(100_000_000 + 128 * 11 * BIT_NS)
    assert off.state is LinkState.ERROR_ACTIVE


def test_without_a_restart_it_stays_off_until_its_host_asks() -> None:
    bus = TimedBus(500_000)
    off = bus.join("off", restart_after_ns=None)
    off.counters.transmit = 256
    off.follow(0)
    bus.advance(100 * S)
    assert off.state is LinkState.BUS_OFF
    off.restart(100 * S)
    bus.advance(101 * S)
    assert off.state is LinkState.ERROR_ACTIVE


def test_a_node_at_another_bit_rate_ruins_the_bus_until_it_is_passive() -> None:
    bus = TimedBus(500_000)
    left, right, wrong = bus.join("left"), bus.join("right"), bus.join("wrong", bit_rate=250_000)
    left.send(A, 0)
    bus.advance(S)
    assert wrong.state is LinkState.ERROR_PASSIVE
    assert bus.errors == 15  # nine a frame: 1, and 8 as it sees the others' flags behind its own
    assert [can_id for _, can_id in frames(right)] == [0xA0]
    assert not frames(wrong)
    assert left.counters.transmit == 15 * 8 - 1


def test_a_sender_at_another_bit_rate_goes_off_while_others_talk() -> None:
    bus = TimedBus(500_000)
    left, right, wrong = bus.join("left"), bus.join("right"), bus.join("wrong", bit_rate=250_000, restart_after_ns=None)
    for k in range(500):
        left.send(A, k * 10_000_000)
        wrong.send(B, k * 10_000_000)
    bus.advance(6 * S)
    assert wrong.state is LinkState.BUS_OFF
    assert {can_id for _, can_id in frames(right)} == {0xA0}
    assert left.state in (LinkState.ERROR_ACTIVE, LinkState.ERROR_WARNING)


def test_bit_errors_cost_time_and_lose_nothing() -> None:
    sent: list[Sent] = []
    bus = TimedBus(500_000, bit_error_rate=5e-4, seed=3, on_sent=sent.append)
    left, right = bus.join("left"), bus.join("right")
    for k in range(1000):
        left.send(WireFrame(0x100, k.to_bytes(8, "big")), k * 1_000_000)
    bus.advance(2 * S)
    expected = 1000 * (1.0 - (1 - 5e-4) ** 111)
    assert 0.7 * expected < bus.errors < 1.5 * expected
    numbers = [int.from_bytes(one.frame.data, "big") for one in right.receive() if isinstance(one, Reception)]
    assert sorted(set(numbers)) == [*range(1000)]  # one read wrong in its very last bit comes twice
    assert len(sent) == 1000
    assert left.state is LinkState.ERROR_ACTIVE


def test_the_same_seed_gives_the_same_errors() -> None:
    def run(seed: int) -> list[tuple[int, int]]:
        bus = TimedBus(500_000, bit_error_rate=3e-3, seed=seed)
        left, right = bus.join("left"), bus.join("right", bit_error_rate=1e-3)
        for k in range(200):
            left.send(A, k * 1_000_000)
        bus.advance(S)
        return frames(right)

    assert run(1) == run(1) != run(2)


def test_a_poor_receiver_spoils_frames_while_active_and_misses_them_alone_while_passive() -> None:
    """Its flags cost the sender 8 each, up to bus-off, although nothing is wrong with that one."""
    bus = TimedBus(500_000, seed=5)
    left, right, poor = bus.join("left"), bus.join("right"), bus.join("poor", bit_error_rate=0.01)
    for k in range(1000):
        left.send(A, k * 1_000_000)
    bus.advance(2 * S)
    said, heard = events(left), [len(frames(one)) for one in (right, poor)]
    assert heard[0] + left.dropped == 1000
    assert 0 < heard[1] < heard[0]
    assert LinkState.BUS_OFF in said
    assert LinkState.RESTARTED in said
    assert right.state is LinkState.ERROR_ACTIVE


def test_at_a_wrong_bit_of_the_last_the_frame_comes_twice() -> None:
    from hil.bus.timed.disturbance import Seen, wrong_bit

    length = bits(A) - 3
    assert wrong_bit(A, length - 1, length).seen is Seen.LAST_BIT
    assert wrong_bit(A, length - 9, length).seen is Seen.ACKNOWLEDGE


def test_exceptions_in_the_arbitration_field() -> None:
    """A recessive stuff bit read as dominant is not counted; another recessive bit makes the sender a receiver."""
    from hil.bus.timed.disturbance import Disturbance, Seen, wrong_bit

    frame = WireFrame(0x00F)  # SOF and four dominant bits: a recessive stuff bit at index 5
    length = bits(frame) - 3
    assert wrong_bit(frame, 5, length) == Disturbance(5, Seen.BY_SENDER, counts=False)
    assert wrong_bit(frame, 4, length) == Disturbance(4, Seen.BY_SENDER)
    lost = wrong_bit(WireFrame(0x700), 1, bits(WireFrame(0x700)) - 3)
    assert lost == Disturbance(7, Seen.BY_SENDER, counts=False, senders_receive=True)


def test_two_senders_of_one_identifier_collide_until_one_is_passive() -> None:
    bus = TimedBus(500_000)
    one, two, ear = bus.join("one"), bus.join("two"), bus.join("ear")
    one.send(WireFrame(0xA0, b"\x01"), 0)
    two.send(WireFrame(0xA0, b"\x02"), 0)
    bus.advance(S)
    heard = [reception.frame.data for reception in ear.receive() if isinstance(reception, Reception)]
    assert heard == [b"\x01", b"\x02"]  # the one that is dominant where they differ
    assert bus.errors == 16
    one.send(A, S)
    two.send(A, S)
    bus.advance(2 * S)
    assert len(frames(ear)) == 1  # equal bits: one frame, acknowledged to both


def test_flexible_frames_send_their_data_faster() -> None:
    frame = WireFrame(0x100, bytes(range(64)), fd=True, bit_rate_switch=True)
    bus = TimedBus(500_000, 2_000_000)
    left, right = bus.join("left"), bus.join("right")
    left.send(frame, 0)
    bus.advance(S)
    nominal, data = exact_bits(frame)
    assert frames(right)[0][0] == (nominal - 3) * 2_000 + data * 500
    assert nominal + data <= sum(most_bits(frame))


def test_time_does_not_run_back() -> None:
    bus = TimedBus(500_000)
    bus.advance(10)
    with pytest.raises(ValueError, match="in order"):
        bus.advance(9)
    with pytest.raises(ValueError, match="above 0"):
        TimedBus(0)


def test_what_is_unplugged_waits() -> None:
    bus = TimedBus(500_000)
    left, right = bus.join("left"), bus.join("right")
    left.unplugged = True
    left.send(A, 0)
    bus.advance(S)
    assert not frames(right)
    left.unplugged = False
    bus.advance(2 * S)
    assert len(frames(right)) == 1
