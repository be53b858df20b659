"""A plant that somebody starts by hand drives what its scenario says, or waits for the bench that plays its part."""

from collections.abc import Iterator

from dbc.contract import contract
from dbc.frame import BusName, Frame, Node, Received
from hil.errors import BrakebenchError
from hil.scenario.scenario import Scenario

_STIMULUS = frozenset(spec.can_id for spec in contract(BusName.BENCH).sent_by("BENCH"))


class NeedsBenchError(BrakebenchError):
    """A scenario that no plant can drive without a bench."""


def parts_of_the_bench(scenario: Scenario) -> Iterator[str]:
    """What of a scenario the bench plays, not the plant nor the ECU."""
    if scenario.blending:
        yield "the blending factor"
    if scenario.faults:
        yield "faults (" + ", ".join(dict.fromkeys(fault.kind.name for fault in scenario.faults)) + ")"


class HoldsForBench:
    """A plant node that hears no demand, and so holds its initial state, until a bench speaks on the bench bus."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._held = True

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; without the ECU's frames as long as no bench has spoken."""
        if self._held:
            frames = [item for item in inbox if isinstance(item, Frame)]
            self._held = not any(frame.bus is BusName.BENCH and frame.can_id in _STIMULUS for frame in frames)
        if self._held:
            inbox = [item for item in inbox if item.bus is BusName.BENCH]
        return self._node.step(now_ns, inbox)


def awaiting_bench(node: Node, scenario: Scenario) -> Node:
    """The plant of a scenario as somebody starts it by hand.

    Raises
    ------
    NeedsBenchError : the scenario starts without an ECU, so that nothing can be held.
    """
    parts = list(parts_of_the_bench(scenario))
    if not parts:
        return node
    if not scenario.manoeuvre.wait_for_demands:
        raise NeedsBenchError(
            f"{scenario.name}: its {' and '.join(parts)} are played by the bench, and it starts without waiting for "
            f"anybody: use `brakebench run {scenario.name}`"
        )
    return HoldsForBench(node)


def notice(scenario: Scenario, without: str, bus: str) -> str:
    """What somebody who starts one node by hand has to know; empty where it drives the scenario alone."""
    parts = list(parts_of_the_bench(scenario))
    if not parts:
        return ""
    start = f"brakebench run {scenario.name} --without {without} --bus {bus}"
    return f"the bench plays this scenario's {' and '.join(parts)}; the manoeuvre waits for `{start}`"
