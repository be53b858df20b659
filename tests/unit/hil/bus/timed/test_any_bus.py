"""Any bus, whatever is wrong with it: nothing raised, every frame accounted for, one frame at a time on the wire."""

from itertools import pairwise
from random import Random

import pytest

from dbc.frame import LinkEvent, LinkState
from hil.bus.timed.bus import Sent, TimedBus
from hil.bus.timed.controller import Reception
from hil.bus.timed.wire import WireFrame

RATES = (125_000, 250_000, 500_000)


def drawn(random: Random) -> WireFrame:
    extended, fd = random.random() < 0.3, random.random() < 0.2
    data = random.randbytes(random.choice((0, 1, 8, 64) if fd else (0, 1, 8)))
    can_id = random.choice((0x10, 0x20, 0x30)) << 18 * extended  # so few that senders meet
    return WireFrame(can_id, data, extended, not fd and random.random() < 0.1, fd, fd and random.random() < 0.5)


@pytest.mark.parametrize("seed", range(10))
def test_every_frame_is_accounted_for(seed: int) -> None:
    random = Random(seed)
    sent: list[Sent] = []
    bus = TimedBus(500_000, 2_000_000, bit_error_rate=random.choice((0.0, 1e-4, 1e-2)), seed=seed, on_sent=sent.append)
    nodes = [
        bus.join(
            f"node {k}",
            fifo=random.random() < 0.5,
            queue_length=random.choice((1, 5, 64)),
            bit_rate=random.choice((*RATES, 500_000, 500_000, 500_000)),
            bit_error_rate=random.choice((0.0, 0.0, 1e-3)),
            restart_after_ns=random.choice((None, 0, 10_000_000)),
        )
        for k in range(random.randint(1, 5))
    ]
    ear = bus.join("ear", listen_only=True)
    asked, now_ns, last_ns = 0, 0, 0
    heard: list[Reception] = []
    for _ in range(400):
        now_ns += random.choice((0, 1, 100_000, 1_000_000))
        node = random.choice(nodes)
        change = random.random()
        if change < 0.01:
            node.unplugged = not node.unplugged
        elif change < 0.02:
            node.bit_rate = random.choice(RATES)
        elif change < 0.03:
            node.restart(now_ns)
        else:
            node.send(drawn(random), now_ns)
            asked += 1
        for one in nodes:
            assert 0 <= one.counters.transmit <= 256
            assert 0 <= one.counters.receive <= 255
            assert (one.state is LinkState.BUS_OFF) == (one.counters.transmit == 256)
            for item in one.receive():
                assert item.time_ns <= now_ns
                if isinstance(item, LinkEvent):
                    assert item.state in LinkState
        for item in ear.receive():
            assert last_ns <= item.time_ns <= now_ns
            last_ns = item.time_ns
            if isinstance(item, Reception):
                heard.append(item)
    bus.advance(now_ns)
    waiting = sum(len(one.queue.waiting) for one in nodes)
    assert asked == len(sent) + waiting + sum(one.dropped for one in nodes)
    for one, other in pairwise(sent):
        assert one.free_ns <= other.start_ns or one.start_ns == other.start_ns  # equal frames of two senders
    assert bus.busy_ns <= now_ns + 1_000_000
