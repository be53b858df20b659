"""``brakebench replay`` against a live ECU and against a live plant."""

import json
import signal
from itertools import takewhile

import numpy as np
import pytest
from processes import RUN_LIMIT_S, wait_until

from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakeMode, BrakePedal, BrakeStatus, EhbDemandFront
from ecu.node import EcuNode
from hil.bench.node_process import ECU, NODE_PERIOD_NS, PLANT
from hil.bus.open import open_bus
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

LOG_NS = 2_500_000_000
EPOCH_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def recorded():
    """Frames of both nodes over the begin of a stop, in virtual time."""
    scenario = load_scenario("stop72")
    plant = PlantNode(scenario.plant, scenario.manoeuvre, 1, NODE_PERIOD_NS)
    ecu = EcuNode(scenario.ecu, NODE_PERIOD_NS)
    members = [Member(plant, NODE_PERIOD_NS, PLANT.phase_ns), Member(ecu, NODE_PERIOD_NS, ECU.phase_ns)]
    steps = takewhile(lambda step: step.now_ns <= LOG_NS, lockstep(members))
    return [frame for step in steps for frame in step.stamped()]


@pytest.fixture
def log(recorded, tmp_path):
    path = tmp_path / "recording.log"
    with path.open("w") as file:
        for frame in recorded:
            seconds, rest = divmod(EPOCH_NS + frame.time_ns, 1_000_000_000)
            file.write(f"({seconds}.{rest // 1000:06d}) {frame.bus} {frame.can_id:03X}#{frame.data.hex().upper()}\n")
    return path


def decoded(frames, kind):
    spec = spec_of(kind)
    return [
        spec.decode(f.data) for f in frames if isinstance(f, Frame) and (f.bus, f.can_id) == (spec.bus, spec.can_id)
    ]


def front_left_pa(frames):
    return np.array([message.pressure_demand_fl_pa or 0.0 for message in decoded(frames, EhbDemandFront)])


def test_the_ecu_alone_brakes_as_recorded(brakebench, start, channel, log, recorded):
    with open_bus(channel, BusName.VEHICLE) as bus:
        start("ecu", "--bus", channel)
        seen = []
        wait_until(lambda: seen.extend(bus.receive(0.1)) or decoded(seen, BrakeStatus), "frames of the ECU")
        seen.clear()
        done = brakebench("replay", str(log), "--role", "plant", "--bus", channel, "--json", check=(0, 4))
        seen += bus.receive(0.0)
    result = json.loads(done.stdout)
    print("replay", {key: result[key] for key in ("sent", "late", "lateness_ms", "duration_s", "log_duration_s")})
    played = {spec.can_id for spec in (spec_of(kind) for kind in (EhbDemandFront, BrakeStatus))}
    assert result["sent"] + result["superseded"] == result["selected"]
    few = result["superseded"] <= 0.01 * result["selected"]  # a busy machine may leave out more
    assert (result["verdict"], done.returncode) == (("passed", 0) if few else ("inconclusive", 4))
    assert (result["refused"], result["stopped"]) == ([], False)
    assert played <= {frame.can_id for frame in seen}
    assert BrakeMode.NORMAL in {status.mode for status in decoded(seen, BrakeStatus)}
    then, now = front_left_pa(recorded), front_left_pa(seen)
    peak = then.max()
    assert peak > 20e5
    assert now.max() > peak / 2
    # aligned where the demand passes half its peak; with the log's end the ECU is alone and goes its own way
    ahead = int(np.argmax(then > peak / 2)) - 20
    behind = int(np.argmax(now > peak / 2)) - 20
    length = min(len(then) - ahead, len(now) - behind)
    assert length > 50  # half a second of braking; a busy machine supersedes some frames
    late = 1 + round(result["lateness_ms"]["max"] / 10.0)  # ticks of the ECU
    near = np.lib.stride_tricks.sliding_window_view(np.pad(then, late, mode="edge"), 2 * late + 1)[ahead:]
    beyond = now[behind:][:length] - np.clip(
        now[behind:][:length], near.min(axis=1)[:length], near.max(axis=1)[:length]
    )
    print(f"pressure demand beyond what was recorded within {late} ticks: at most {np.abs(beyond).max() / 1e5:.3f} bar")
    assert np.median(np.abs(beyond)) < 0.01 * peak


def test_a_live_plant_is_not_talked_over(brakebench, start, channel, log):
    with open_bus(channel, BusName.VEHICLE) as bus:
        start("plant", "--bus", channel)
        wait_until(lambda: bus.receive(0.1), "frames of the plant")
        done = brakebench("replay", str(log), "--role", "plant", "--bus", channel, check=2)
        assert "somebody already sends 0x" in done.stderr
        assert "stop that one, or replay another role" in done.stderr
        brakebench("replay", str(log), "--role", "ecu", "--speed", "10", "--bus", channel, check=(0, 4))


def test_who_comes_in_during_the_replay_is_left_alone(start, channel, log):
    pedal = spec_of(BrakePedal)
    with open_bus(channel, BusName.VEHICLE) as bus:
        process = start("replay", str(log), "--role", "plant", "--bus", channel, "--json")
        wait_until(lambda: bus.receive(0.1), "replayed frames")
        bus.send([Frame(BusName.VEHICLE, pedal.can_id, bytes(pedal.length))])
        out, err = process.communicate(timeout=RUN_LIMIT_S)
    result = json.loads(out)
    assert process.returncode == 5, err
    assert result["live"] == ["0xA0 (BRAKE_PEDAL of DRIVER) on the vehicle bus"]
    assert {row["message"] for row in result["refused"]} == {"BRAKE_PEDAL", "STEERING"}
    assert result["sent"] > 0


def test_ctrl_c_ends_it_with_a_result(start, channel, log):
    with open_bus(channel, BusName.VEHICLE) as bus:
        process = start("replay", str(log), "--speed", "0.1", "--bus", channel, "--json")
        wait_until(lambda: bus.receive(0.1), "replayed frames")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=RUN_LIMIT_S)
    result = json.loads(out)
    assert process.returncode == 130, err
    assert result["stopped"]
    assert 0 < result["sent"] < result["selected"]
    assert "Traceback" not in err


def test_nodes_of_a_map_start_at_a_frame_and_go_round_until_ctrl_c(start, channel, log):
    other = f"{channel}-other"
    with open_bus(other, BusName.VEHICLE) as bus:
        process = start(
            *("replay", str(log), "--role", "DRIVER", "--map", f"vehicle={other}", "--bus", channel),
            *("--from", "0.5", "--to", "0.6", "--loop", "--wait-for", "BRAKE_STATUS", "--json"),
        )
        wait_until(lambda: "waiting for 0x130" in process.stderr.readline(), "that it waits")
        assert not bus.receive(0.1)
        bus.send([Frame(BusName.VEHICLE, spec_of(BrakeStatus).can_id, bytes(8))])
        seen = []
        wait_until(lambda: seen.extend(bus.receive(0.1)) or len(seen) > 60, "three rounds")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=RUN_LIMIT_S)
    result = json.loads(out)
    assert process.returncode in (0, 4), err
    assert {frame.can_id for frame in seen} == {0xA0, 0xE0}
    assert (result["bus"], result["stopped"], result["selected"]) == (other, False, 22)
    assert result["rounds"] >= 2
