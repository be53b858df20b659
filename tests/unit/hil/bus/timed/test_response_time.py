"""Worst-case response times: the published examples, and the simulated bus beside the bound."""

from random import Random

import pytest

from hil.bus.timed.bus import Sent, TimedBus
from hil.bus.timed.frame_length import Length, exact_bits, most_bits
from hil.bus.timed.response_time import Stream, utilisation, worst_case
from hil.bus.timed.wire import WireFrame

MS = 1_000_000
BIT_NS = 8_000  # at 125 kbit/s, where the paper's frames of seven bytes (125 bits) take 1 ms
PERIODS_MS = {0x100: 2.5, 0x200: 3.5, 0x300: 3.5}
"""Davis et al. 2007, 2.2 and table 2: three messages for which the earlier analysis is wrong."""


def simulated(
    streams: dict[WireFrame, tuple[int, int]],
    length: Length,
    until_ns: int,
    bit_rate: int,
    data: Random | None = None,
) -> dict[int, int]:
    """Longest response of each identifier; ``streams`` gives phase and period of each, every one on its own node."""
    worst: dict[int, int] = {}

    def note(sent: Sent) -> None:
        can_id = sent.frame.can_id
        worst[can_id] = max(worst.get(can_id, 0), sent.free_ns - sent.queued_ns)

    bus = TimedBus(bit_rate, length=length, on_sent=note)
    bus.join("ear")
    nodes = {frame: bus.join(hex(frame.can_id)) for frame in streams}
    due = sorted((k, frame) for frame, (phase, period) in streams.items() for k in range(phase, until_ns, period))
    for now_ns, frame in due:
        payload = frame.data if data is None else bytes(data.choice((0, 0xFF, 0x1F, 0x78)) for _ in frame.data)
        nodes[frame].send(frame._replace(data=payload), now_ns)
    bus.advance(2 * until_ns)
    return worst


def test_the_counter_example_is_reached_with_lengths_fixed() -> None:
    frames = [WireFrame(can_id, bytes(7)) for can_id in PERIODS_MS]
    assert {most_bits(frame).nominal for frame in frames} == {125}
    streams = [Stream(MS, round(period * MS)) for period in PERIODS_MS.values()]
    bounds = [worst_case(streams, k, BIT_NS) for k in range(3)]
    assert [bound.response_ns for bound in bounds] == [2 * MS, 3 * MS, 3.5 * MS]
    assert (bounds[2].instance, bounds[2].instances) == (1, 2)  # the second instance: 3.0 ms for the first
    together = {frame: (0, round(PERIODS_MS[frame.can_id] * MS)) for frame in frames}
    worst = simulated(together, most_bits, 100 * MS, 125_000)
    assert worst[0x300] == bounds[2].response_ns
    stuffed = simulated(together, exact_bits, 100 * MS, 125_000)
    assert all(stuffed[can_id] <= bound.response_ns for can_id, bound in zip(PERIODS_MS, bounds, strict=True))


def test_blocking_is_reached_when_a_frame_has_just_begun() -> None:
    """The most urgent message waits for one that started a nanosecond before."""
    streams = [Stream(MS, 10 * MS), Stream(MS, 10 * MS)]
    bound = worst_case(streams, 0, BIT_NS)
    assert (bound.response_ns, bound.blocking_ns) == (2 * MS, MS)
    frames = {WireFrame(1, bytes(7)): (1, 10 * MS), WireFrame(2, bytes(7)): (0, 10 * MS)}
    assert simulated(frames, most_bits, 50 * MS, 125_000)[1] == 2 * MS - 1


def drawn(random: Random) -> tuple[dict[WireFrame, tuple[int, int]], int]:
    """A random set of messages of a load from 0.3 to 0.98, and its bit rate."""
    bit_rate = random.choice((125_000, 250_000, 500_000, 1_000_000))
    ids = sorted(random.sample(range(1 << 11), random.randint(2, 8)))
    frames = [
        WireFrame(can_id << 18 | 5 if extended else can_id, bytes(random.randint(0, 8)), extended)
        for can_id, extended in ((can_id, random.random() < 0.3) for can_id in ids)
    ]
    load = random.uniform(0.3, 0.98)
    shares = [random.random() + 0.1 for _ in frames]
    periods = [
        round(most_bits(frame).duration_ns(bit_rate) * sum(shares) / (share * load))
        for frame, share in zip(frames, shares, strict=True)
    ]
    return {f: (random.randrange(t), t) for f, t in zip(frames, periods, strict=True)}, bit_rate


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("length", [most_bits, exact_bits], ids=["fixed", "stuffed"])
def test_no_simulated_response_exceeds_its_bound(seed: int, length: Length) -> None:
    random = Random(seed)
    frames, bit_rate = drawn(random)
    streams = [Stream(most_bits(frame).duration_ns(bit_rate), period) for frame, (_, period) in frames.items()]
    bounds = [worst_case(streams, k, 1_000_000_000 // bit_rate) for k in range(len(streams))]
    longest = max(period for _, period in frames.values())
    for together in (False, True):
        phased = {frame: (0 if together else phase, period) for frame, (phase, period) in frames.items()}
        worst = simulated(phased, length, 8 * longest, bit_rate, data=None if length is most_bits else random)
        for frame, bound in zip(frames, bounds, strict=True):
            assert bound.response_ns is not None
            assert worst[frame.can_id] <= bound.response_ns


def test_without_a_bound() -> None:
    streams = [Stream(MS, 2 * MS), Stream(MS, 2 * MS), Stream(MS, 50 * MS)]
    assert worst_case(streams, 0, BIT_NS).response_ns == 2 * MS
    assert worst_case(streams, 1, BIT_NS).response_ns is None
    assert worst_case(streams, 2, BIT_NS).response_ns is None
    with pytest.raises(ValueError, match="no period"):
        worst_case([Stream(MS, None)], 0, BIT_NS)


def test_a_message_without_a_period_blocks() -> None:
    streams = [Stream(MS, 10 * MS), Stream(3 * MS, None)]
    assert worst_case(streams, 0, BIT_NS).response_ns == 4 * MS
    assert utilisation(streams) == pytest.approx(0.1)


def test_jitter_lets_two_instances_come_together() -> None:
    """An urgent message with jitter interferes twice within a time in which it would come once."""
    without = [Stream(MS, 5 * MS), Stream(MS, 20 * MS)]
    jittering = [Stream(MS, 5 * MS, 4 * MS + 1), Stream(MS, 20 * MS)]
    assert worst_case(without, 1, BIT_NS).response_ns == 2 * MS
    assert worst_case(jittering, 1, BIT_NS).response_ns == 3 * MS
    assert worst_case(jittering, 0, BIT_NS).response_ns == 4 * MS + 1 + 2 * MS
