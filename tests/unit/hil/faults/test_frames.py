import pytest

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame
from hil.faults.frames import FaultyNode, FrameFaults, FrameLine, on_faulty_line

TICKS = 4000


def frames(tick, ids=(0x10, 0x20)):
    return [Frame(BusName.VEHICLE, can_id, tick.to_bytes(2, "little")) for can_id in ids]


def driven(faults, seed=1, ids=(0x10, 0x20)):
    line = FrameLine(faults, seed)
    return [line.pass_on(frames(tick, ids)) for tick in range(TICKS)]


def number(frame):
    return int.from_bytes(frame.data, "little")


def test_without_faults_nothing_changes():
    assert driven(FrameFaults()) == [frames(tick) for tick in range(TICKS)]


def test_shares_are_met():
    dropped = sum(len(sent) for sent in driven(FrameFaults(drop=0.05)))
    assert dropped == pytest.approx(2 * TICKS * 0.95, rel=0.01)
    doubled = sum(len(sent) for sent in driven(FrameFaults(duplicate=0.05)))
    assert doubled == pytest.approx(2 * TICKS * 1.05, rel=0.01)
    stale = [number(f) != tick for tick, sent in enumerate(driven(FrameFaults(stale=0.05))) for f in sent]
    assert sum(stale) == pytest.approx(2 * TICKS * 0.05, rel=0.2)


def test_late_frames_keep_their_order_and_are_never_early():
    sent = driven(FrameFaults(late=0.3, longest_ticks=3))
    for can_id in (0x10, 0x20):
        numbers = [(tick, number(f)) for tick, out in enumerate(sent) for f in out if f.can_id == can_id]
        assert [n for _, n in numbers] == sorted(n for _, n in numbers)
        assert {tick - n for tick, n in numbers} == {0, 1, 2, 3}


def test_the_same_seed_gives_the_same_and_messages_do_not_meddle():
    faults = FrameFaults(drop=0.1, late=0.2)
    assert driven(faults, 5) == driven(faults, 5)
    assert driven(faults, 5) != driven(faults, 6)
    alone = [[f for f in out if f.can_id == 0x10] for out in driven(faults, 5)]
    assert alone == driven(faults, 5, ids=(0x10,))


def test_only_the_messages_named():
    sent = driven(FrameFaults(drop=1.0, can_ids=frozenset({0x20})))
    assert all([f.can_id for f in out] == [0x10] for out in sent)


def test_within_their_times_only_and_the_same_frames_whenever_they_begin():
    always, later = FrameLine(FrameFaults(drop=0.3), 1), FrameLine(FrameFaults(drop=0.3, from_s=10.0, until_s=20.0), 1)
    for tick in range(TICKS):
        time_s = tick * 0.01
        sent, some = later.pass_on(frames(tick), time_s), always.pass_on(frames(tick), time_s)
        assert sent == (some if 10.0 <= time_s < 20.0 else frames(tick))


def test_frames_held_back_do_not_get_overtaken_when_the_fault_ends():
    line = FrameLine(FrameFaults(late=1.0, longest_ticks=5, until_s=0.5), 1)
    sent = [number(f) for tick in range(100) for f in line.pass_on(frames(tick, (0x10,)), tick * 0.01)]
    assert sent == list(range(100))


def test_the_bench_bus_is_never_touched():
    truth = [Frame(BusName.BENCH, 0x10, b"x")]
    assert FrameLine(FrameFaults(drop=1.0), 1).pass_on(truth) == truth


class Talker:
    """Sends frames, and the truth about the manoeuvre that begins after 50 ms."""

    def __init__(self):
        self._transmitter = Transmitter()

    def step(self, now_ns, inbox):
        state = ManoeuvreState.HOLDING if now_ns < 50_000_000 else ManoeuvreState.RUNNING
        return frames(7) + self._transmitter.frames(now_ns, [TruthMotion(20.0, 0.0, 0.0, state)])


def lost_at(node, inboxes):
    ticks = [k * 10_000_000 for k in range(20)]
    return [now // 1_000_000 for now in ticks if not any(f.can_id == 0x10 for f in node.step(now, inboxes(now)))]


def test_a_node_whose_frames_are_lost():
    assert lost_at(FaultyNode(Talker(), [FrameFaults(drop=1.0)], 1), lambda now: []) == list(range(0, 200, 10))


def test_times_are_of_the_manoeuvre_for_the_plant_and_for_who_hears_it():
    faults = [FrameFaults(drop=1.0, from_s=0.03, until_s=0.06)]
    assert lost_at(FaultyNode(Talker(), faults, 1), lambda now: []) == [80, 90, 100]

    class Listener:
        def step(self, now_ns, inbox):
            return frames(7)

    plant = Talker()
    assert lost_at(FaultyNode(Listener(), faults, 1), lambda now: plant.step(now, [])) == [80, 90, 100]


def test_without_faults_a_node_is_left_alone():
    node = Talker()
    assert on_faulty_line(node, (), 1) is node


@pytest.mark.parametrize("wrong", [{"drop": 1.2}, {"late": -0.1}, {"longest_ticks": 0}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        FrameFaults(**wrong)
