"""Two loopbacks as if on two machines: a tunnel over TCP on 127.0.0.1, both ends as processes."""

import itertools
import json
import re
import shlex
import signal
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from processes import result_of, wait_until
from started import COMMAND, Started, blended, brakes, latest

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import EhbState, MotorDemandFront
from hil.bench.result import Signals
from hil.bench.tunnel import TunnelError, serve_tunnel
from hil.bench.tunnel_line import PlaceError, parse_place
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus
from hil.bus.tunnel_wire import HELLO

VEHICLE, BENCH = BusName.VEHICLE, BusName.BENCH
PAGE = (Path(__file__).parents[2] / "docs" / "adapters.md").read_text()
SAFE_FRAMES = 7  # of 10 ms since the last frame was sent: it may be 20 ms on its way, the receiver is safe 50 ms later


@pytest.fixture
def tunnel(tmp_path):
    """Start ends of a tunnel; they are killed at the end."""
    started = []

    def begin(bus, *place):
        words = tmp_path / f"tunnel-{len(started)}.txt"
        with words.open("wb") as out:
            process = subprocess.Popen([*COMMAND, "tunnel", "--bus", bus, *place, "--realtime"], stdout=out, stderr=out)
        started.append(Started(process, words))
        return started[-1]

    yield begin
    for one in started:
        one.process.kill()
        one.process.wait()


@pytest.fixture
def ends(tunnel, channel):
    """Both ends, connected: listener, seeker, the two channels and the port."""
    here, there = f"{channel}-a", f"{channel}-b"
    listener = tunnel(here, "--listen", "0")
    port = re.search(r"listens on 127\.0\.0\.1:(\d+)$", listener.says("listens on"))[1]
    seeker = tunnel(there, "--connect", f"127.0.0.1:{port}")
    listener.says("connected with 127.0.0.1:")
    seeker.says(f"connected with 127.0.0.1:{port}")
    return listener, seeker, here, there, port


def heard(bus, wanted, what, told=None):
    """Receive until ``wanted`` is true of an item; all items until then."""
    found = [] if told is None else told

    def one():
        found.extend(bus.receive(0.05))
        return any(wanted(item) for item in found)

    wait_until(one, what, 60)
    return found


def is_event(state):
    return lambda item: isinstance(item, LinkEvent) and item.state is state


@pytest.mark.slow
def test_both_buses_pass_old_frames_do_not_and_a_lost_end_is_told_and_found_again(ends, tunnel, brakebench):
    listener, seeker, here, there, port = ends
    with open_bus(here, VEHICLE) as a, open_bus(there, VEHICLE) as b, open_bus(bench_channel(there), BENCH) as b_bench:
        with open_bus(bench_channel(here), BENCH) as a_bench:
            a_bench.send([Frame(BENCH, 0x1ABCDEF0, b"\x01", extended=True)])
            (frame,) = heard(b_bench, bool, "a bench frame")
            assert frame[:3] == (BENCH, 0x1ABCDEF0, b"\x01")
        b.send([Frame(VEHICLE, 0x123, b"\x02\x03")])
        (frame,) = heard(a, bool, "a vehicle frame")
        assert frame[:3] == (VEHICLE, 0x123, b"\x02\x03")

        # one end stopped: what is sent meanwhile is old when it goes on
        seeker.process.send_signal(signal.SIGSTOP)
        for number in range(20):
            a.send([Frame(VEHICLE, number, b"")])
            b.send([Frame(VEHICLE, number, b"")])
        time.sleep(0.3)
        seeker.process.send_signal(signal.SIGCONT)
        for bus in (b, a):
            items = heard(bus, is_event(LinkState.RX_OVERFLOW), "that frames were lost")
            assert sum(item.number for item in items if is_event(LinkState.RX_OVERFLOW)(item)) == 20
            assert not [item for item in items if isinstance(item, Frame)]
        seeker.says("20 before sending, 20 on arrival")
        listener.says("40 at the other end")

        # stopped for longer: the other end gives up, what was on its way is old, and both find each other again
        seeker.process.send_signal(signal.SIGSTOP)
        a.send([Frame(VEHICLE, 0x55, b"")])
        heard(a, is_event(LinkState.DISCONNECTED), "the end that gives up")
        seeker.process.send_signal(signal.SIGCONT)
        items = heard(b, is_event(LinkState.RESTARTED), "the link that is back")
        assert [item.state for item in items if item.state is not LinkState.RX_OVERFLOW] == [
            LinkState.DISCONNECTED,
            LinkState.RESTARTED,
        ]
        heard(a, is_event(LinkState.RESTARTED), "the link that is back")

        # who else comes is turned away, and one loopback has one end
        with socket.create_connection(("127.0.0.1", int(port))) as other:
            assert other.recv(1) == b""
        listener.says("turned away")
        assert "has an end of a tunnel there" in brakebench("tunnel", "--bus", here, "--listen", "0", check=2).stderr

        # one end killed: told at the other; somebody who garbles meanwhile: words; a new end: as before
        seeker.process.kill()
        heard(a, is_event(LinkState.DISCONNECTED), "the lost link")
        for garbage, words in (
            (b"GET / HTTP/1.1\r\n", "expected a tunnel"),
            (HELLO + b"\xff" * 99, "expected a packet"),
        ):
            with socket.create_connection(("127.0.0.1", int(port))) as other:
                other.sendall(garbage)
                listener.says(words)
        with socket.create_connection(("127.0.0.1", int(port))):
            listener.says("ended: nothing heard for 1 s")
        seeker = tunnel(there, "--connect", f"localhost:{port}")
        seeker.says("connected with")
        heard(a, is_event(LinkState.RESTARTED), "the link that is back")
        a.send([Frame(VEHICLE, 0x42, b"")])
        heard(b, lambda item: isinstance(item, Frame) and item.can_id == 0x42, "a frame after all that")

        # the listening end ends well: the other is told, and seeks on
        listener.process.send_signal(signal.SIGINT)
        listener.process.wait(60)
        assert listener.process.returncode == 0
        heard(b, is_event(LinkState.DISCONNECTED), "the lost link")
        seeker.says("Connection refused; tried again every 0.5 s")
        assert "dropped for their age" in listener.words.read_text().splitlines()[-1]


@pytest.mark.slow
def test_with_the_ecu_beyond_a_stalled_tunnel_both_sides_are_safe_meanwhile_and_go_on_after(
    ends, start, tmp_path, capsys
):
    _, seeker, here, there, _ = ends
    (tmp_path / "blended.toml").write_text(blended(6.0))
    ecu = start("ecu", "blended.toml", "--bus", there, "--realtime")
    wait_until(lambda: "every 10 ms" in ecu.stderr.readline(), "the ECU")
    record = start("record", "there.log", "--bus", there)
    bench = start("run", "blended.toml", "--without", "ecu", "--json", "--bus", here, "--out", "out", "--realtime")
    log = tmp_path / "out" / "recording.log"

    def braking():
        assert bench.poll() is None, bench.communicate()
        demands = latest(log, MotorDemandFront, 20)
        return len(demands) == 20 and all(map(brakes, demands))

    wait_until(braking, "the motors to brake")
    seeker.process.send_signal(signal.SIGSTOP)
    time.sleep(0.4)
    seeker.process.send_signal(signal.SIGCONT)
    result = result_of(bench, (0, 1, 4))
    record.send_signal(signal.SIGINT)
    record.communicate(timeout=60)
    assert result["link_states"]["rx_overflow"] >= 1
    assert set(result["link_states"]) <= {"rx_overflow", "tx_overflow"}  # no connection was lost

    for file, spoken, watched, safe in (
        (log, "EHB_DEMAND_FRONT", "EHB_PRESSURE_FRONT.EHB_STATE_FRONT", EhbState.OWN_PEDAL_MAP),
        (tmp_path / "there.log", "MOTOR_STATUS_FRONT", "MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL", 0.0),
    ):
        signals = Signals(file)
        said_s = np.sort(signals.decoded.series(f"{spoken}.ALIVE_COUNTER")[0]) - signals.start_s
        t_s, values = signals.get(watched)
        edges = np.searchsorted(t_s, said_s[said_s > 0.0], "right")
        silences = [values[a:b] for a, b in itertools.pairwise(edges)]
        assert max(map(len, silences)) > 20
        for silence in silences:
            assert np.all(silence[SAFE_FRAMES:] == safe)
        longest = max(silences, key=len)
        assert np.any(longest[:SAFE_FRAMES] != safe)
        assert np.any(values[np.searchsorted(t_s, said_s[-1]) - 100 :] != safe)  # it goes on
        with capsys.disabled():
            print(f"\n{watched}: safe after {int(np.argmax(longest == safe))} of {len(longest)} frames of the silence")


@pytest.mark.slow
def test_the_page_followed_on_one_machine(start, brakebench, channel):
    section = PAGE.split("## An ECU on another machine")[1].split("\n## ")[0]
    text = "\n".join(re.findall(r"```sh\n(.*?)```", section, re.DOTALL))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    text = text.replace("loopback:", f"{channel}-").replace("7400", port)
    lines = [shlex.split(line.removesuffix("&"), comments=True) for line in text.splitlines()]
    listen, run, ssh, connect, ecu = [line for line in lines if line]
    assert ssh == ["ssh", "-N", "-L", f"{port}:127.0.0.1:{port}", "rig"]  # one machine needs none
    started = [start(*words[1:]) for words in (listen, connect, ecu)]
    result = json.loads(brakebench(*run[1:], "--json").stdout)
    assert result["verdict"] == "passed"
    assert result["processes"] == 1
    for process in started:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        assert process.returncode == 0


@pytest.mark.parametrize("place", ["7400", "host:", ":x", "host:70000", "host:²"])
def test_what_is_no_place_is_said(place):
    with pytest.raises(PlaceError, match=r"expected HOST:PORT, such as 127\.0\.0\.1:7400"):
        parse_place(place)


def test_a_place_may_leave_out_the_own_host_only():
    assert parse_place("7400", "127.0.0.1") == ("127.0.0.1", 7400)
    assert parse_place("[::1]:7400") == ("::1", 7400)


def test_a_tunnel_joins_loopbacks_only():
    with pytest.raises(TunnelError, match="expected a loopback"):
        serve_tunnel("socketcan:vcan0", ("127.0.0.1", 0), listen=True)
