"""A node that is stopped, overruns, or dies: what the other side does, counted in its own frames of the recording."""

import itertools
import os
import signal
import time

import numpy as np
import pytest
from processes import alive, children_of, result_of, wait_until
from started import BRAKING_NM, blended

from dbc.contract import contract
from dbc.frame import BusName
from dbc.messages import BrakeMode, EhbState
from hil.bench.result import Signals
from hil.bus.rendezvous import base_directory

CYCLE_S = 0.01
SAFE_FRAMES = 5  # of 10 ms: the other side is safe within 50 ms
STOPPED_S = (0.02, 0.05, 0.2)
RECOVERY_S = 1.0
BURST_S = 0.05


class Drive:
    """A run whose motors brake."""

    def __init__(self, bench, folder):
        self.bench = bench
        self.log = folder / "out" / "recording.log"
        self.nodes = wait_until(self._nodes, "recorder, plant and ECU")
        wait_until(self._braking, "the motors to brake")

    def _nodes(self):
        assert self.bench.poll() is None, self.bench.communicate()
        found = children_of(self.bench.pid)
        return found if {"record", "plant", "ecu"} <= set(found) else None

    def _braking(self):
        assert self.bench.poll() is None, self.bench.communicate()
        if not self.log.exists() or self.log.read_bytes().count(b" 020#") < 150:
            return False
        _, torque = Signals(self.log).get("MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL")
        return len(torque) > 20 and np.all(torque[-20:] < BRAKING_NM)

    def stop(self, node, for_s):
        """Stop a process, and let it go on."""
        os.kill(self.nodes[node], signal.SIGSTOP)
        time.sleep(for_s)
        os.kill(self.nodes[node], signal.SIGCONT)

    def kill(self, node):
        """Kill a node; the signals of the run that ends by it."""
        os.kill(self.nodes[node], signal.SIGKILL)
        result = result_of(self.bench, expected=3)
        assert f"{node} (process {self.nodes[node]}) was killed by SIGKILL" in result["reason"]
        assert not any(alive(pid) for pid in self.nodes.values())
        return Signals(self.log)


@pytest.fixture
def drive(start, channel, tmp_path):
    (tmp_path / "blended.toml").write_text(blended(60.0))
    yield Drive(start("run", "blended.toml", "--json", "--bus", channel, "--out", "out"), tmp_path)
    name, base = channel.removeprefix("loopback:"), base_directory()
    assert not (base.exists() and list(base.glob(f"{name}*"))), "a socket is left"


def in_silences(signals, spoken, watched):
    """Values of a signal that fell into each pause between frames of a message, also into the one at its end."""
    said_s = np.sort(signals.decoded.series(f"{spoken}.ALIVE_COUNTER")[0]) - signals.start_s
    t_s, values = signals.get(watched)
    edges = np.searchsorted(t_s, np.append(said_s, np.inf), "right")
    return [values[a:b] for a, b in itertools.pairwise(edges)]


def no_burst(signals, sender):
    """Nobody ever catches up: more frames of an id in a short time than its cycle gives are none."""
    worst = 0
    for message in contract(BusName.VEHICLE).sent_by(sender):
        t_s = np.sort(signals.decoded.series(f"{message.name}.ALIVE_COUNTER")[0])
        in_time = np.searchsorted(t_s, t_s + BURST_S) - np.arange(len(t_s))
        most = BURST_S / (message.cycle_ns * 1e-9) + 2  # one is late, the next is not
        assert in_time.max() <= most, message.name
        worst = max(worst, int(in_time.max()))
    return worst


@pytest.mark.slow
def test_an_ecu_that_is_stopped_overruns_or_dies_leaves_the_brake_to_its_own_map_in_time(drive, capsys):
    for for_s in STOPPED_S:
        drive.stop("ecu", for_s)
        time.sleep(RECOVERY_S)
    for _ in range(10):  # overruns: a tick in five is late
        drive.stop("ecu", 1.5 * CYCLE_S)
        time.sleep(3.5 * CYCLE_S)
    time.sleep(RECOVERY_S)
    signals = drive.kill("ecu")
    silences = in_silences(signals, "EHB_DEMAND_FRONT", "EHB_PRESSURE_FRONT.EHB_STATE_FRONT")
    silences = [states for states in silences[20:] if len(states)]
    own_map = [np.argmax(states == EhbState.OWN_PEDAL_MAP) for states in silences if len(states) > SAFE_FRAMES]
    assert len(own_map) >= 2  # 200 ms, and the death
    assert max(own_map) <= SAFE_FRAMES
    for states in silences:
        assert np.all(states[SAFE_FRAMES:] == EhbState.OWN_PEDAL_MAP)
    assert len(silences[-1]) > 20
    worst = no_burst(signals, "ECU")
    overruns = signals.get("ECU_TIMING.OVERRUNS")[1]
    assert np.all(np.diff(overruns) >= 0)
    assert overruns[-1] >= 15  # 20 ms: 1 at least, 50 ms: 4, 200 ms: 19
    with capsys.disabled():
        print(f"\nECU stopped and killed: own map after {max(own_map)} frames; {worst} frames of an id in {BURST_S} s")


@pytest.mark.slow
def test_a_plant_that_is_stopped_or_dies_takes_the_motor_demand_to_zero_in_time(drive, capsys):
    for for_s in STOPPED_S:
        drive.stop("plant", for_s)
        time.sleep(RECOVERY_S)
    signals = drive.kill("plant")
    demands = in_silences(signals, "MOTOR_STATUS_FRONT", "MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL")
    long = [torque for torque in demands[20:] if len(torque) > SAFE_FRAMES]
    assert len(long) >= 2
    for torque in long:
        assert np.all(torque[SAFE_FRAMES:] == 0.0)
    mode = in_silences(signals, "MOTOR_STATUS_FRONT", "BRAKE_STATUS.MODE")[-1]
    assert np.all(mode[3:] >= BrakeMode.FRICTION_ONLY)  # of 20 ms
    worst = max(no_burst(signals, sender) for sender in ("IWM", "EHB", "SENSORS"))
    carrying = max(int(np.argmax(torque == 0.0)) for torque in long)
    with capsys.disabled():
        print(f"\nplant stopped and killed: {carrying} demands with torque; {worst} frames of an id in {BURST_S} s")
