import pytest

from dbc.frame import BusName, Frame
from hil.faults.frames import FaultyNode, FrameFaults, FrameLine

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


def test_a_node_whose_frames_are_lost():
    class Talker:
        def step(self, now_ns, inbox):
            return frames(7)

    assert FaultyNode(Talker(), FrameFaults(drop=1.0), 1).step(0, []) == []


@pytest.mark.parametrize("wrong", [{"drop": 1.2}, {"late": -0.1}, {"longest_ticks": 0}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        FrameFaults(**wrong)
