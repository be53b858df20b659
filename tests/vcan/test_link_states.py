"""Error states of a real driver in a run: from the adapter's word to the controller's mode and the run's result."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import slcan_device as adapter
from processes import RUN_LIMIT_S, alive, children_of, result_of, wait_until
from slcan_device import SlcanFrame
from started import BRAKING_NM, blended, brakes, latest

from dbc.contract import spec_of
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakeMode, BrakeStatus, Fault, MotorDemandFront
from ecu.node import EcuNode
from hil.bench.result import Signals
from hil.bench.result import link_events as recorded_link_events
from hil.bus import Bus, claim_channel, open_bus
from hil.bus.error_frame import CAN_ERR_BUSOFF, link_events
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

if TYPE_CHECKING:
    from candump import Candump
    from conftest import SlcanInterface
    from started import Started

TICK_NS = 10_000_000
PATIENCE_S = 10.0
STEADY_FRAMES = 20
UNDER_WAY_S = 0.5
"""What may still come of before: frames in the driver's queue, and a controller that a busy host runs late."""
BRAKE_STATUS, MOTOR_DEMAND = spec_of(BrakeStatus), spec_of(MotorDemandFront)


class TwoSides:
    """The controller on the interface, the car behind the adapter, in step: one tick of each, every frame awaited.

    Attributes
    ----------
    ecu, states, answers : the controller, the link states it was told, and what it sent in each tick.
    """

    def __init__(self, slcan: SlcanInterface, bus: Bus, scenario: Path) -> None:
        loaded = load_scenario(str(scenario))
        self.ecu = EcuNode(loaded.ecu)
        self.states: list[LinkState] = []
        self.answers: list[list[Frame]] = []
        self._slcan = slcan
        self._bus = bus
        self._car = PlantNode(loaded.plant, loaded.manoeuvre, seed=1)
        self._now_ns = 0
        self._heard: list[Frame] = []

    def tick(self, cut: bool = False) -> None:
        """Step the car, then the controller; ``cut``: nothing passes between them."""
        sent = [f for f in self._car.step(self._now_ns, self._heard) if f.bus is BusName.VEHICLE]
        self._heard = []
        inbox: list[Frame | LinkEvent] = []
        if cut:
            inbox += self._bus.receive(0.05)
        else:
            for frame in sent:
                self._slcan.device.send(SlcanFrame(frame.can_id, frame.data))
            wait_until(lambda: self._arrived(inbox, len(sent)), f"{len(sent)} frames from the adapter", PATIENCE_S)
        self.states += [item.state for item in inbox if isinstance(item, LinkEvent)]
        answer = [f for f in self.ecu.step(self._now_ns, inbox) if f.bus is BusName.VEHICLE]
        self._bus.send(answer)
        self.answers.append(answer)
        if not cut:
            taken = [self._slcan.device.receive() for _ in answer]
            assert [(f.can_id, f.data) for f in taken] == [(f.can_id, f.data) for f in answer]
            self._heard = [Frame(BusName.VEHICLE, f.can_id, f.data) for f in taken]
        self._now_ns += TICK_NS

    def _arrived(self, inbox: list[Frame | LinkEvent], count: int) -> bool:
        inbox += self._bus.receive(0.2)
        return sum(isinstance(item, Frame) for item in inbox) >= count

    def until(self, condition: Callable[[], bool], ticks: int) -> int:
        """Tick until a condition holds, at most so often; how often."""
        for count in range(ticks):
            if condition():
                return count
            self.tick()
        raise AssertionError(f"not within {ticks} ticks: mode {self.mode.name}, faults {self.faults!r}")

    @property
    def mode(self) -> BrakeMode:
        """The controller's mode."""
        return BrakeMode.INIT if self.ecu.outputs is None else self.ecu.outputs.mode

    @property
    def faults(self) -> Fault:
        """Faults that the controller reports."""
        return Fault.NONE if self.ecu.outputs is None else self.ecu.outputs.faults

    @property
    def torque_nm(self) -> float:
        """Smallest motor demand in magnitude, negative when all motors brake."""
        return 0.0 if self.ecu.outputs is None else max(self.ecu.outputs.motor_demand_nm)

    @property
    def pressure_pa(self) -> tuple[float, ...]:
        """The controller's pressure demand."""
        assert self.ecu.outputs is not None
        return tuple(self.ecu.outputs.pressure_demand_pa)


@pytest.fixture
def sides(slcan: SlcanInterface, tmp_path: Path) -> Iterator[TwoSides]:
    scenario = tmp_path / "blended.toml"
    scenario.write_text(blended(20.0))
    with open_bus(f"socketcan:{slcan.name}", BusName.VEHICLE) as bus:
        sides = TwoSides(slcan, bus, scenario)
        sides.until(lambda: sides.mode is BrakeMode.NORMAL and sides.torque_nm < BRAKING_NM, 300)
        for _ in range(50):
            sides.tick()
        assert (sides.mode, sides.faults, sides.states) == (BrakeMode.NORMAL, Fault.NONE, [])
        yield sides


def test_warning_passive_and_no_acknowledge_reach_the_node_and_change_nothing(
    slcan: SlcanInterface, sides: TwoSides
) -> None:
    for line, state in (
        (adapter.NO_ACK, LinkState.NO_ACK),
        (adapter.ERROR_WARNING, LinkState.ERROR_WARNING),
        (adapter.ERROR_PASSIVE, LinkState.ERROR_PASSIVE),
        (adapter.ERROR_ACTIVE, LinkState.ERROR_ACTIVE),
    ):
        sides.states.clear()
        slcan.device.send_line(line)
        sides.tick()
        assert sides.states == [state]
        assert (sides.mode, sides.faults) == (BrakeMode.NORMAL, Fault.NONE)
        assert sides.torque_nm < BRAKING_NM


def test_bus_off_ends_blending_at_once_and_the_link_comes_back_without_a_stale_frame(
    slcan: SlcanInterface, sides: TwoSides
) -> None:
    before_pa = sides.pressure_pa
    slcan.device.send_line(adapter.BUS_OFF)
    sides.tick(cut=True)
    assert sides.states == [LinkState.BUS_OFF]
    assert sides.faults == Fault.LINK
    assert sides.mode is BrakeMode.FRICTION_ONLY
    assert sides.torque_nm == 0.0
    assert all(now > before for now, before in zip(sides.pressure_pa, before_pa, strict=True))
    for _ in range(10):
        sides.tick(cut=True)
    assert sides.mode is BrakeMode.SAFE_STOP  # no pedal any more

    slcan.down()
    slcan.up()

    def restarted() -> bool:
        sides.tick(cut=True)
        return LinkState.RESTARTED in sides.states

    wait_until(restarted, "the bus to be joined again", PATIENCE_S)
    told = [state for state in sides.states if state is not LinkState.TX_OVERFLOW]  # of frames sent meanwhile
    assert told == [LinkState.BUS_OFF, LinkState.DISCONNECTED, LinkState.RESTARTED]
    arrived = 0  # what was sent while the link was down never comes: only frames of the tick that found it up
    with contextlib.suppress(TimeoutError):
        while True:
            frame = slcan.device.receive(0.3)
            arrived += 1
            assert (frame.can_id, frame.data) in [(f.can_id, f.data) for f in sides.answers[-2] + sides.answers[-1]]
    assert 0 < arrived <= len(sides.answers[-2]) + len(sides.answers[-1])
    ticks = sides.until(lambda: sides.mode is BrakeMode.NORMAL, 400)
    assert 200 <= ticks <= 320  # one upgrade a second: friction only, degraded, normal
    assert sides.faults == Fault.NONE


def test_an_interface_that_was_bus_off_before_it_was_opened_says_so(slcan: SlcanInterface) -> None:
    slcan.device.send_line(adapter.BUS_OFF)
    wait_until(lambda: slcan.state() == "BUS-OFF", "the driver to take it in", PATIENCE_S)
    with open_bus(f"socketcan:{slcan.name}", BusName.VEHICLE) as bus:
        (event,) = bus.receive()
        assert isinstance(event, LinkEvent)
        assert event.state is LinkState.BUS_OFF
        assert f"{slcan.name} was bus-off before it was opened" in event.detail
        node = EcuNode(load_scenario("stop72").ecu)
        node.step(0, [event])
        assert node.outputs is not None
        assert Fault.LINK in node.outputs.faults
        slcan.down()
        slcan.up()
        states: list[LinkState] = []

        def again() -> bool:
            states.extend(item.state for item in bus.receive(0.1) if isinstance(item, LinkEvent))
            return LinkState.RESTARTED in states

        wait_until(again, "the bus to be joined again", PATIENCE_S)
        assert states == [LinkState.DISCONNECTED, LinkState.RESTARTED]


def test_an_unplugged_adapter_is_a_lost_link(slcan: SlcanInterface, sides: TwoSides) -> None:
    slcan.unplug()
    sides.tick(cut=True)
    assert sides.states == [LinkState.DISCONNECTED]
    assert Fault.LINK in sides.faults
    assert sides.mode is BrakeMode.FRICTION_ONLY
    assert sides.torque_nm == 0.0
    for _ in range(30):  # and the node lives
        sides.tick(cut=True)
    assert sides.mode is BrakeMode.SAFE_STOP


def test_a_run_tells_the_states_of_its_link_and_that_bus_off_spoilt_it(
    slcan: SlcanInterface,
    folder: Path,
    begin: Callable[..., Started],
    candump: Callable[[str], Candump],
    figure: Callable[[str], None],
) -> None:
    (folder / "blended.toml").write_text(blended(20.0))
    slcan.set("txqueuelen", "1000")  # the default of 10 is shorter than what the car says in one tick
    witness = candump(slcan.name)
    spec = f"socketcan:{slcan.name}"
    bench = begin("run", "blended.toml", "--json", "--bus", spec, "--transmit", "--out", "link")
    log = folder / "link" / "recording.log"

    def blending() -> bool:
        time.sleep(0.2)  # this thread goes before the nodes
        assert bench.process.poll() is None, bench.words.read_text()
        demands = latest(log, MotorDemandFront, STEADY_FRAMES)
        return len(demands) == STEADY_FRAMES and all(brakes(demand) for demand in demands)

    with slcan.device.punctual():
        wait_until(blending, "the motors to brake", RUN_LIMIT_S)
        nodes = children_of(bench.process.pid)
        slcan.device.send(SlcanFrame(0x7A5, b"\x01\x02"))  # a neighbour on the wire
        lines = (adapter.NO_ACK, adapter.NO_ACK, adapter.ERROR_WARNING, adapter.ERROR_PASSIVE, adapter.BUS_OFF)
        for line in lines:
            slcan.device.send_line(line)
        result = result_of(bench.process, expected=5)
    seen = witness.stop()

    assert result["verdict"] == "incomplete"
    assert "the vehicle bus went bus-off and did not come back" in result["reason"]
    assert result["link_states"] == {"no_ack": 2, "error_warning": 1, "error_passive": 1, "bus_off": 1}
    assert not any(alive(pid) for pid in nodes.values())
    claim_channel(spec).close()
    assert " vehicle 7A5#0102\n" in log.read_text()

    theirs = [event for line in seen if line.error for event in link_events(line.can_id, line.data, BusName.VEHICLE, 0)]
    ours = recorded_link_events(Signals(log))
    assert [(e.state, e.detail) for e in ours] == [(e.state, e.detail) for e in theirs]

    off = next(i for i, line in enumerate(seen) if line.error and line.can_id == CAN_ERR_BUSOFF)
    status = [BRAKE_STATUS.decode(line.data) for line in seen[off:] if line.can_id == BRAKE_STATUS.can_id]
    told = next(i for i, one in enumerate(status) if Fault.LINK & one.active_faults)
    assert told * 0.02 < UNDER_WAY_S  # that it is told in the same tick is held in step, above
    assert all(Fault.LINK & one.active_faults and one.mode >= BrakeMode.FRICTION_ONLY for one in status[told:])
    torques = [MOTOR_DEMAND.decode(line.data) for line in seen[off:] if line.can_id == MOTOR_DEMAND.can_id]
    carrying = next(i for i, one in enumerate(torques) if not any(one))
    assert carrying * 0.01 < UNDER_WAY_S
    assert not any(any(one) for one in torques[carrying:])
    figure(
        f"bus-off told by the slcan driver of {slcan.name}: {carrying} motor demands with torque after it, "
        f"told by status {told + 1}; "
        f"{result['frames_lost']} of {result['frames_sent']} frames lost in the run; it says: {result['reason']}"
    )


def test_a_stalled_adapter_costs_what_its_queue_does_not_take_and_no_more(slcan: SlcanInterface) -> None:
    with open_bus(f"socketcan:{slcan.name}", BusName.VEHICLE) as bus:
        sent = 0
        refused: list[LinkEvent] = []
        with slcan.device.stalled():
            for _ in range(200):
                bus.send([Frame(BusName.VEHICLE, 0x123, (sent + n).to_bytes(4, "big")) for n in range(10)])
                sent += 10
                refused += [item for item in bus.receive() if isinstance(item, LinkEvent)]
        assert {event.state for event in refused} == {LinkState.TX_OVERFLOW}
        taken = sent - sum(event.number for event in refused)
        arrived = [int.from_bytes(slcan.device.receive().data, "big") for _ in range(taken)]
        assert arrived == sorted(arrived)
        assert taken < sent / 2
        bus.send([Frame(BusName.VEHICLE, 0x124, b"")])
        assert slcan.device.receive().can_id == 0x124  # next, and nothing of before after it
        assert bus.receive() == []
