import os
import subprocess
import sys

import pytest

from dbc.frame import BusName
from hil.bus import BusError, bench_channel, claim_channel, open_bus
from hil.bus import channel as module
from hil.bus.bus import parse_spec


@pytest.fixture(autouse=True)
def own_place(tmp_path, monkeypatch):
    """A place for channels that no other test nor a bench of the user's shares."""
    place = tmp_path / "r"
    place.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(place))
    monkeypatch.setattr(module, "vcan_refusal", lambda: "there is no vcan0")
    return place


@pytest.mark.parametrize(
    ("spec", "kind", "channel", "options"),
    [
        ("loopback:demo", "loopback", "demo", {}),
        ("slcan:/dev/ttyACM0@115200", "slcan", "/dev/ttyACM0@115200", {}),
        (
            "kvaser:0,bitrate=250000,listen_only=true,sample=0.8,x=y",
            "kvaser",
            "0",
            {"bitrate": 250000, "listen_only": True, "sample": 0.8, "x": "y"},
        ),
        ("socketcand:a:b", "socketcand", "a:b", {}),
    ],
)
def test_a_bus_is_named_by_kind_channel_and_options(spec, kind, channel, options):
    assert parse_spec(spec) == (kind, channel, options)


@pytest.mark.parametrize(
    "spec", ["", "demo", ":", "loopback:", ":demo", "a b:c", "kvaser:0,bitrate", "kvaser:0,=1", "x:y,"]
)
def test_anything_else_is_refused_with_an_example(spec):
    with pytest.raises(BusError, match="such as"):
        parse_spec(spec)


@pytest.mark.parametrize("name", ["..", ".hidden", "a/b", "ä", "a b", "x" * 49, "-x", "a\n"])
def test_a_loopback_name_is_no_path(name, own_place):
    with pytest.raises(BusError, match="not a path"):
        open_bus(f"loopback:{name}", BusName.VEHICLE)
    assert not list(own_place.iterdir())


def test_a_loopback_has_no_options():
    with pytest.raises(BusError, match="has no options, got bitrate"):
        open_bus("loopback:demo,bitrate=500000", BusName.VEHICLE)


def test_an_unknown_kind_is_refused_with_the_known_ones():
    with pytest.raises(BusError, match=r"no kind 'kvasar', only .*kvaser.*loopback.*socketcan"):
        open_bus("kvasar:0", BusName.VEHICLE)


def test_an_adapter_that_is_not_there_is_refused():
    with pytest.raises(BusError, match="the driver of kvaser is not here"):
        open_bus("kvaser:0", BusName.VEHICLE)


def test_auto_joins_the_loopback_where_there_is_no_vcan():
    with open_bus("auto", BusName.VEHICLE) as bus:
        assert bus.name == "loopback:brakebench"


def test_auto_takes_vcan_where_there_is_one(monkeypatch):
    monkeypatch.setattr(module, "vcan_refusal", lambda: "")
    assert module.resolve("auto") == "socketcan:vcan0"
    monkeypatch.setattr(module, "_VCAN", "socketcan:claim-test")  # vcan0 itself may be in use
    with claim_channel("auto") as first, claim_channel("auto") as second:
        assert (first.spec, first.note) == ("socketcan:claim-test", "vcan0 is there")
        assert second.spec == "loopback:brakebench"
        assert second.note == f"another bench, process {os.getpid()}, has vcan0"


def test_the_bench_channel_follows_from_the_vehicle_channel():
    assert bench_channel("loopback:demo") == "loopback:demo-bench"
    assert bench_channel("socketcan:vcan0") == "loopback:socketcan-vcan0-bench"
    assert bench_channel("auto") == "loopback:brakebench-bench"
    assert bench_channel("kvaser:0,bitrate=250000") == bench_channel("kvaser:0") == "loopback:kvaser-0-bench"
    names = [bench_channel(f"{kind}:/dev/serial/by-id/{'x' * 60}{n}") for kind in ("slcan", "robotell") for n in (1, 2)]
    assert len(set(names)) == 4
    for name in (*names, bench_channel("loopback:" + "x" * 48)):
        open_bus(name, BusName.BENCH).close()


def test_a_channel_is_claimed_once():
    with claim_channel("loopback:demo") as claim:
        assert (claim.spec, claim.note) == ("loopback:demo", "")
        with pytest.raises(BusError, match=f"in use by another bench, process {os.getpid()}"):
            claim_channel("loopback:demo")
        claim_channel("loopback:other").close()
    claim_channel("loopback:demo").close()


def test_options_do_not_make_it_another_channel():
    with claim_channel("kvaser:0"), pytest.raises(BusError, match="in use"):
        claim_channel("kvaser:0,bitrate=250000")


def test_auto_takes_a_fresh_loopback_when_the_first_is_taken():
    with claim_channel("auto") as first, claim_channel("auto") as second, claim_channel("auto") as third:
        assert [claim.spec for claim in (first, second, third)] == [
            "loopback:brakebench",
            "loopback:brakebench-2",
            "loopback:brakebench-3",
        ]
        assert first.note == "there is no vcan0"
    with claim_channel("auto") as again:
        assert again.spec == "loopback:brakebench"


def test_a_claim_ends_with_its_process():
    program = """
from hil.bus import claim_channel
claim = claim_channel("loopback:demo")
print("has it", flush=True)
import time; time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "has it\n"
        with pytest.raises(BusError, match=f"process {other.pid}"):
            claim_channel("loopback:demo")
        other.kill()
    claim_channel("loopback:demo").close()


def test_asking_who_has_it_never_wears_out():
    with claim_channel("loopback:demo"):
        for _ in range(20):
            with pytest.raises(BusError, match=f"process {os.getpid()};"):
                claim_channel("loopback:demo")
