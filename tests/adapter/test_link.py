"""What the nodes do when an adapter is lost: car on can0 and controller on can1, in step, every frame awaited.

Budgets are ticks of 10 ms. What is right is `link_down` of docs/trouble-codes.md and the time-outs of the contract.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from processes import wait_until
from started import BRAKING_NM, blended

from dbc.contract import spec_of
from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from dbc.messages import BrakeMode, EhbPressureFront, EhbState, Fault, MotorStatusFront
from ecu.node import EcuNode
from hil.bus import Bus, open_bus
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Adapter

    Cards = tuple[Adapter, Adapter]
    Figure = Callable[[str], None]

TICK_NS = 10_000_000
PATIENCE_S = 10.0
TIMEOUT_TICKS = 5  # the brake waits 40 ms for a demand
FREE_TICKS = 20  # motors have followed
NO_CURRENT_A = 5.0  # above the noise of the sensor
TORQUE_TICKS = 5  # motor demand zero 50 ms after the last frame
LINK_DOWN = 0x3041  # docs/trouble-codes.md
LOST = {0x1001, 0x1011, 0x1021, 0x1031}  # pedal, wheel speeds and body motion do not come
QUEUE, READY = 3, 1  # txqueuelen; one that the kernel holds ready for the card, whose own frame QEMU sends at once
DEFAULT_QUEUE = "10"
PRESSURE, MOTORS = spec_of(EhbPressureFront), spec_of(MotorStatusFront)


class Side:
    """A node on its own adapter.

    Attributes
    ----------
    sent, heard, states : frames of the last tick, frames that came in it, and all states of the link.
    """

    def __init__(self, node: EcuNode | PlantNode, bus: Bus) -> None:
        self.bus = bus
        self.sent: list[Frame] = []
        self.heard: list[Frame] = []
        self.states: list[LinkState] = []
        self.refused = 0
        self._node = node
        self._inbox: list[Received] = []

    def listen(self, count: int, timeout_s: float = 0.05) -> None:
        """Take what comes, at least so many frames; none: what is there."""

        def enough() -> bool:
            self._inbox += self.bus.receive(timeout_s)
            return sum(isinstance(item, Frame) for item in self._inbox) >= count

        wait_until(enough, f"{count} frames on {self.bus.name}", PATIENCE_S)

    def step(self, now_ns: int) -> None:
        """Step the node with what came, and send what it gives."""
        inbox, self._inbox = self._inbox, []
        self.heard = [item for item in inbox if isinstance(item, Frame)]
        events = [item for item in inbox if isinstance(item, LinkEvent)]
        self.states += [event.state for event in events]
        self.refused += sum(event.number for event in events if event.state is LinkState.TX_OVERFLOW)
        self.sent = [frame for frame in self._node.step(now_ns, inbox) if frame.bus is BusName.VEHICLE]
        self.bus.send(self.sent)


class Rig:
    """Car and controller in step over both adapters."""

    def __init__(self, car_bus: Bus, ecu_bus: Bus, scenario: Path) -> None:
        loaded = load_scenario(str(scenario))
        self.node = EcuNode(loaded.ecu)
        self.car = Side(PlantNode(loaded.plant, loaded.manoeuvre, seed=1), car_bus)
        self.ecu = Side(self.node, ecu_bus)
        self.brake_states: list[EhbState] = []
        self.currents_a: list[float] = []
        self._now_ns = 0

    def tick(self, cut: bool = False) -> None:
        """Step the car, then the controller; ``cut``: nothing is awaited."""
        self.car.listen(0 if cut else len(self.ecu.sent))
        self.car.step(self._now_ns)
        for frame in self.car.sent:
            if frame.can_id == PRESSURE.can_id:
                self.brake_states.append(PRESSURE.decode(frame.data)[2])
            if frame.can_id == MOTORS.can_id:
                status = MOTORS.decode(frame.data)
                self.currents_a.append(max(abs(status[0]), abs(status[3])))
        self.ecu.listen(0 if cut else len(self.car.sent))
        self.ecu.step(self._now_ns)
        self._now_ns += TICK_NS

    def until(self, condition: Callable[[], bool], ticks: int, cut: bool = False) -> int:
        """Tick until a condition holds, at most so often; how often."""
        for count in range(ticks):
            if condition():
                return count
            self.tick(cut)
        raise AssertionError(f"not within {ticks} ticks: mode {self.mode.name}, faults {self.faults!r}")

    @property
    def mode(self) -> BrakeMode:
        """The controller's mode."""
        return BrakeMode.INIT if self.node.outputs is None else self.node.outputs.mode

    @property
    def faults(self) -> Fault:
        """Faults that the controller reports."""
        return Fault.NONE if self.node.outputs is None else self.node.outputs.faults

    @property
    def torque_nm(self) -> float:
        """Smallest motor demand in magnitude, negative when all motors brake."""
        return 0.0 if self.node.outputs is None else max(self.node.outputs.motor_demand_nm)

    @property
    def codes(self) -> set[int]:
        """Trouble codes since the start."""
        return {trouble.code.number for trouble in self.node.trouble_codes}

    def lose(self) -> None:
        """Tick without a link until the brake follows its own pedal map and the motors are free; within the budgets."""
        began, running = len(self.brake_states), len(self.currents_a)
        for _ in range(FREE_TICKS + 10):
            self.tick(cut=True)
        states, currents = self.brake_states[began:], self.currents_a[running:]
        own_map = states.index(EhbState.OWN_PEDAL_MAP)
        assert own_map <= TIMEOUT_TICKS
        assert set(states[own_map:]) == {EhbState.OWN_PEDAL_MAP}
        assert max(currents[FREE_TICKS:]) < NO_CURRENT_A
        self.lost_ticks = own_map

    def come_back(self) -> int:
        """Tick until all is normal again; how many ticks that took."""
        ticks = self.until(lambda: self.mode is BrakeMode.NORMAL, 500)
        assert self.faults == Fault.NONE
        assert self.torque_nm < BRAKING_NM
        return ticks


@pytest.fixture
def rig(cards: Cards, tmp_path: Path) -> Iterator[Rig]:
    scenario = tmp_path / "blended.toml"
    scenario.write_text(blended(40.0))
    with open_bus(cards[0].spec, BusName.VEHICLE) as car, open_bus(cards[1].spec, BusName.VEHICLE) as ecu:
        rig = Rig(car, ecu, scenario)
        rig.until(lambda: rig.mode is BrakeMode.NORMAL and rig.torque_nm < BRAKING_NM, 300)
        for _ in range(30):
            rig.tick()
        assert (rig.mode, rig.faults, rig.codes) == (BrakeMode.NORMAL, Fault.NONE, set())
        assert (rig.car.states, rig.ecu.states) == ([], [])
        yield rig


@pytest.mark.parametrize("loss", ["interface down", "driver unbound"])
def test_the_controllers_adapter_is_lost_and_comes_back(rig: Rig, cards: Cards, loss: str, figure: Figure) -> None:
    card = cards[1]
    card.down() if loss == "interface down" else card.unbind()
    rig.tick(cut=True)
    assert rig.ecu.states == [LinkState.DISCONNECTED]
    assert Fault.LINK in rig.faults
    assert LINK_DOWN in rig.codes
    assert rig.mode >= BrakeMode.FRICTION_ONLY
    assert rig.torque_nm == 0.0
    rig.lose()
    assert rig.mode is BrakeMode.SAFE_STOP  # no pedal any more
    assert rig.car.states == []  # its own adapter is well

    if loss == "driver unbound":
        card.bind()
    card.up()
    rig.until(lambda: LinkState.RESTARTED in rig.ecu.states, 100, cut=True)
    told = [state for state in rig.ecu.states if state is not LinkState.TX_OVERFLOW]  # of frames sent meanwhile
    assert told == [LinkState.DISCONNECTED, LinkState.RESTARTED]
    fresh = {(frame.can_id, frame.data) for frame in rig.ecu.sent}
    rig.tick()
    assert {(frame.can_id, frame.data) for frame in rig.car.heard} == fresh  # nothing of before, when it was down
    ticks = rig.come_back()
    assert 200 <= ticks <= 400  # one upgrade a second: friction only, degraded, normal
    figure(
        f"controller's adapter, {loss}: FRICTION_ONLY or worse in the first tick, brake on its own pedal map after "
        f"{rig.lost_ticks} ticks; NORMAL {ticks} ticks after the link is back"
    )


def test_the_cars_adapter_is_lost_and_comes_back(rig: Rig, cards: Cards, figure: Figure) -> None:
    cards[0].down()
    before = len(rig.node.trouble_codes)
    free = rig.until(lambda: rig.torque_nm == 0.0, TORQUE_TICKS, cut=True)
    rig.lose()
    assert set(rig.car.states) == {LinkState.DISCONNECTED, LinkState.TX_OVERFLOW}  # and what it could not send
    assert rig.car.states.count(LinkState.DISCONNECTED) == 1
    assert rig.ecu.states == []  # its own adapter is well: it misses the frames
    assert LINK_DOWN not in rig.codes
    assert rig.codes >= LOST
    assert len(rig.node.trouble_codes) > before
    assert rig.mode is BrakeMode.SAFE_STOP

    cards[0].up()
    rig.until(lambda: LinkState.RESTARTED in rig.car.states, 100, cut=True)
    ticks = rig.come_back()
    figure(
        f"car's adapter, interface down: motor demand zero after {free} ticks; "
        f"NORMAL {ticks} ticks after the link is back"
    )


def test_nobody_acknowledges_the_controller_and_its_queue_is_full(rig: Rig, cards: Cards, figure: Figure) -> None:
    """The card's interrupts are held back: what it was given stays in it, and it hears nothing, as on a torn wire."""
    card = cards[1]
    card.set("txqueuelen", str(QUEUE))
    card.interrupts(False)
    began = len(rig.ecu.states)
    free = rig.until(lambda: rig.torque_nm == 0.0, TORQUE_TICKS, cut=True)
    rig.lose()
    assert set(rig.ecu.states[began:]) == {LinkState.TX_OVERFLOW}
    assert LINK_DOWN not in rig.codes  # the driver tells of no state: the missing frames do
    assert rig.codes >= LOST
    assert rig.mode is BrakeMode.SAFE_STOP
    refused = rig.ecu.refused

    card.interrupts(True)
    card.set("txqueuelen", DEFAULT_QUEUE)
    rig.car.listen(QUEUE + READY)
    rig.ecu.sent = []  # awaited already
    rig.tick()
    old = len(rig.car.heard)
    assert old == QUEUE + READY  # what the queue had taken, and nothing of all that was refused
    ticks = rig.come_back()
    assert 200 <= ticks <= 400
    figure(
        f"controller's queue full (txqueuelen {QUEUE}): motor demand zero after {free} ticks, brake on its own pedal "
        f"map after {rig.lost_ticks}; {refused} frames refused and counted, {old} old ones sent when it runs again; "
        f"NORMAL {ticks} ticks later"
    )
