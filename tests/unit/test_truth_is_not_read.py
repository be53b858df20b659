"""The controller's frames do not depend on truth: they are byte-identical when truth is replaced by noise."""

import random

from dbc.contract import contract
from dbc.frame import BusName
from ecu.node import EcuNode
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

TRUTH = {spec.can_id for spec in contract(BusName.BENCH).by_id.values() if spec.sender == "PLANT"}
PERIOD_NS = 10_000_000
END_NS = 6_000_000_000


class Blurred:
    """A node whose inbox holds noise wherever the plant told the truth."""

    def __init__(self, node, seed):
        self._node = node
        self._random = random.Random(seed)
        self.replaced = 0

    def step(self, now_ns, inbox):
        blurred = []
        for frame in inbox:
            truth = frame.bus is BusName.BENCH and frame.can_id in TRUTH
            self.replaced += truth
            blurred.append(frame._replace(data=self._random.randbytes(8)) if truth else frame)
        return self._node.step(now_ns, blurred)


def ecu_frames(wrap):
    scenario = load_scenario("stop72")
    plant = PlantNode(scenario.plant, scenario.manoeuvre, 1, PERIOD_NS)
    ecu = wrap(EcuNode(scenario.ecu, PERIOD_NS))
    sent = []
    for step in lockstep([Member(plant, PERIOD_NS), Member(ecu, PERIOD_NS, PERIOD_NS // 2)]):
        if step.now_ns > END_NS:
            return ecu, sent
        if step.member == 1:
            sent += step.frames
    raise AssertionError("lock-step ended by itself")


def test_ecu_frames_are_the_same_when_truth_is_noise():
    _, plain = ecu_frames(lambda node: node)
    blurred_node, blurred = ecu_frames(lambda node: Blurred(node, 7))
    assert blurred_node.replaced > 3000
    assert len(plain) > 3000
    assert plain == blurred
    pressures = {frame.data for frame in plain if frame.can_id == 0xA8}
    assert len(pressures) > 100  # it did brake
