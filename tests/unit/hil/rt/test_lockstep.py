"""Virtual time: order of ticks, delivery, determinism."""

from itertools import islice

from dbc.frame import BusName, Frame
from hil.rt.lockstep import Member, lockstep


class Echo:
    """Sends its name and counts what it hears."""

    def __init__(self, name):
        self.name, self.heard = name, []

    def step(self, now_ns, inbox):
        self.heard.append((now_ns, [frame.data.decode() for frame in inbox]))
        return [Frame(BusName.VEHICLE, 1, f"{self.name}{now_ns}".encode())]


def test_each_hears_the_other_one_tick_later_and_never_itself():
    plant, ecu = Echo("p"), Echo("e")
    list(islice(lockstep([Member(plant, 10), Member(ecu, 10, 5)]), 6))
    assert plant.heard == [(0, []), (10, ["e5"]), (20, ["e15"])]
    assert ecu.heard == [(5, ["p0"]), (15, ["p10"]), (25, ["p20"])]


def test_same_instant_is_not_seen():
    a, b = Echo("a"), Echo("b")
    list(islice(lockstep([Member(a, 10), Member(b, 10)]), 4))
    assert a.heard == [(0, []), (10, ["b0"])]
    assert b.heard == [(0, []), (10, ["a0"])]


def test_different_rates_and_stamps():
    fast, slow = Echo("f"), Echo("s")
    steps = list(islice(lockstep([Member(fast, 1), Member(slow, 4, 2)]), 12))
    assert [(s.now_ns, s.member) for s in steps] == [
        (0, 0), (1, 0), (2, 0), (2, 1), (3, 0), (4, 0), (5, 0), (6, 0), (6, 1), (7, 0), (8, 0), (9, 0),
    ]  # fmt: skip
    assert all(frame.time_ns == step.now_ns for step in steps for frame in step.stamped())
    assert slow.heard[1] == (6, ["f2", "f3", "f4", "f5"])
