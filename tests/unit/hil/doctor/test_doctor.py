"""The doctor on machines of every kind: real ones, bare ones, and ones made of a few files."""

import argparse
import json
import os
import platform
import re
import sys

import pytest

from hil.cli import doctor as command
from hil.doctor import links, machine, software
from hil.doctor.buses import loopback_line
from hil.doctor.line import Line, Status, guarded
from hil.rt.process import output_of

OK, WARNING, MISSING = Status
TOPICS = {
    "loopback", "SocketCAN", "vcan0", "adapters", "real time", "locked memory", "processors", "governor",
    "clock source", "packages", "MF4 logs", "compiled code",
}  # fmt: skip
UP, DOWN = "0x40081", "0x40080"
# as iproute2 prints them: the kernel's slcan driver, and a controller with a bit timing of its own
SLCAN = {
    "ctrlmode_supported": ["LISTEN-ONLY"], "state": "ERROR-ACTIVE", "restart_ms": 0, "bittiming_bitrate": 500000,
    "bitrate_const": [10000, 500000, 1000000], "clock": 0,
}  # fmt: skip
KVASER = {
    "state": "ERROR-ACTIVE", "restart_ms": 100, "bittiming": {"bitrate": 500000, "sample_point": "0.875"},
    "bittiming_const": {"name": "kvaser_usb"}, "clock": 80000000,
}  # fmt: skip


@pytest.fixture(autouse=True)
def _as_a_user(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)


@pytest.fixture
def files(tmp_path):
    """A machine's files by path below its root."""

    def write(texts):
        for path, text in texts.items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_text(text + "\n")
        return tmp_path

    return write


@pytest.fixture
def net(files):
    def write(name, flags=UP, queue=1000, kind=280):
        folder = f"sys/class/net/{name}"
        return files({f"{folder}/type": f"{kind}", f"{folder}/flags": flags, f"{folder}/tx_queue_len": f"{queue}"})

    return write


def link(net, data, flags=UP, queue=1000, kind="can"):
    details = {"linkinfo": {"info_kind": kind, "info_data": data}} if data is not None else {}
    return links.link_line("can0", details, net("can0", flags, queue), 500_000)


def test_a_sound_link(net):
    line = link(net, KVASER)
    assert (line.status, line.fix) == (OK, "")
    assert line.finding == "up, 500000 bit/s, error-active, listen-only off, restart-ms 100, txqueuelen 1000"


@pytest.mark.parametrize(
    ("change", "flags", "queue", "said", "fix"),
    [
        ({"restart_ms": 0}, UP, 1000, "after bus-off it would stay off",
         "sudo ip link set can0 down && sudo ip link set can0 type can restart-ms 100 && sudo ip link set can0 up"),
        ({}, UP, 10, "a queue of 10 refuses frames of a tick", "sudo ip link set can0 txqueuelen 100"),
        ({}, DOWN, 1000, "it is down", "sudo ip link set can0 up"),
        ({"bittiming": {"bitrate": 250000}}, UP, 1000, "brake.dbc says 500000 bit/s",
         "sudo ip link set can0 down && sudo ip link set can0 type can bitrate 500000 && sudo ip link set can0 up"),
        ({"ctrlmode": ["LISTEN-ONLY"]}, UP, 1000, "listen-only: it records, but nothing can be sent",
         "sudo ip link set can0 down && sudo ip link set can0 type can listen-only off && sudo ip link set can0 up"),
        ({"bittiming": {}, "state": "STOPPED", "restart_ms": 0}, DOWN, 10, "no bit rate",
         "sudo ip link set can0 txqueuelen 100 && sudo ip link set can0 type can bitrate 500000 restart-ms 100 && "
         "sudo ip link set can0 up"),
    ],
)  # fmt: skip
def test_an_unwise_link_gets_one_command(net, change, flags, queue, said, fix):
    line = link(net, KVASER | change, flags, queue)
    assert line.status is WARNING
    assert said in line.finding
    assert line.fix == fix


def test_slcan_is_not_told_to_restart(net):
    line = link(net, SLCAN)
    assert (line.status, line.fix) == (OK, "")
    assert "this driver has no automatic restart" in line.finding


def test_a_link_that_cannot_be_asked(net):
    line = link(net, None, queue=10)
    assert line.status is WARNING
    assert line.finding == "up, txqueuelen 10; its bit rate could not be read; a queue of 10 refuses frames of a tick"


@pytest.mark.parametrize(("flags", "status", "fix"), [(UP, OK, ""), (DOWN, WARNING, "sudo ip link set can0 up")])
def test_other_virtual_links(net, flags, status, fix):
    line = link(net, {}, flags, kind="vxcan")
    assert (line.status, line.fix) == (status, fix)


def test_interfaces_are_those_of_type_can(net):
    for name, kind in (("vcan0", 280), ("eth0", 1), ("can3", 280)):
        root = net(name, kind=kind)
    assert links.interfaces(root) == ["can3", "vcan0"]
    assert links.interfaces(root / "nowhere") == []


def test_vcan0(net, tmp_path):
    assert links.vcan_line(False, tmp_path) == Line("vcan0", MISSING, "needs SocketCAN")
    absent = links.vcan_line(True, tmp_path)
    assert absent.status is MISSING
    assert absent.fix == ("sudo modprobe vcan && sudo ip link add dev vcan0 type vcan && sudo ip link set vcan0 up")
    assert links.vcan_line(True, net("vcan0", DOWN)).fix == "sudo ip link set vcan0 up"
    assert links.vcan_line(True, net("vcan0")).status is OK


@pytest.mark.parametrize(
    ("texts", "fix"),
    [
        ({}, ""),
        ({"lib/modules/{r}/modules.dep": "kernel/net/can/can-raw.ko: kernel/net/can/can.ko"}, "sudo modprobe can-raw"),
        ({"lib/modules/{r}/modules.dep": "", "etc/os-release": "NAME=Ubuntu\nID=ubuntu"},
         "sudo apt-get install linux-modules-extra-{r}"),
        ({"lib/modules/{r}/modules.dep": "", "etc/os-release": "ID=fedora"}, ""),
    ],
)  # fmt: skip
def test_socketcan_missing(files, texts, fix):
    release = platform.release()
    root = files({path.format(r=release): text for path, text in texts.items()})
    line = links.socketcan_line(False, root)
    assert (line.status, line.fix) == (MISSING, fix.format(r=release))
    assert links.socketcan_line(True, root).status is OK


def test_without_ip_a_link_is_still_named(net, monkeypatch):
    root = net("can0", queue=10)
    monkeypatch.setenv("PATH", str(root))
    lines = {line.topic: line for line in links.kernel_lines(root)}
    assert lines["iproute2"].fix == "sudo apt-get install iproute2"
    assert lines["can0"].status is WARNING
    assert "could not be read" in lines["can0"].finding


@pytest.mark.parametrize("answer", [None, "", "no json", '[{"x": 1}]'])
def test_any_answer_of_ip_will_do(monkeypatch, answer):
    monkeypatch.setattr(links, "output_of", lambda command, timeout_s: answer)
    assert links.link_details() == {}


@pytest.mark.parametrize(
    ("governors", "status", "finding"),
    [
        ([], OK, "none"),
        (["performance", "performance"], OK, "performance"),
        (["powersave", "performance"], WARNING, "performance, powersave: slower"),
    ],
)
def test_governor(files, governors, status, finding):
    root = files({f"sys/devices/system/cpu/cpu{i}/cpufreq/scaling_governor": g for i, g in enumerate(governors)})
    line = machine.governor_line(root)
    assert line.status is status
    assert line.finding.startswith(finding)
    assert bool(line.fix) == (status is WARNING)


@pytest.mark.parametrize(
    ("current", "available", "status", "fix"),
    [
        ("tsc", "tsc hpet", OK, ""),
        ("hpet", "tsc hpet", WARNING,
         "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"),
        ("timer", "timer", WARNING, ""),
    ],
)  # fmt: skip
def test_clock_source(files, current, available, status, fix):
    folder = "sys/devices/system/clocksource/clocksource0"
    root = files({f"{folder}/current_clocksource": current, f"{folder}/available_clocksource": available})
    assert machine.clock_line(root)[1::2] == (status, fix)


def test_a_bare_machine_has_an_unknown_clock(tmp_path):
    assert machine.clock_line(tmp_path).finding.startswith("unknown")


@pytest.mark.parametrize(
    ("processors", "load", "quota", "said"),
    [
        ({0, 1, 2, 3}, 0.5, "max 100000", None),
        ({0}, 0.5, "max 100000", "share one"),
        ({0, 1}, 3.0, "max 100000", "others keep them busy"),
        ({0, 1}, 0.5, "150000 100000", "may use 1.5 of them"),
    ],
)
def test_processors(files, monkeypatch, processors, load, quota, said):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: processors)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    line = machine.processors_line(files({"sys/fs/cgroup/cpu.max": quota}))
    assert line.status is (OK if said is None else WARNING)
    assert said is None or said in line.finding


@pytest.mark.parametrize(
    ("soft", "hard", "capabilities", "status", "fix"),
    [
        (-1, -1, "0", OK, ""),
        (8 << 20, 8 << 20, "4000", OK, ""),  # CAP_IPC_LOCK
        (8 << 20, -1, "0", WARNING, "ulimit -l unlimited"),
        (8 << 20, 8 << 20, "3fff", WARNING,
         'echo "$USER - memlock unlimited" | sudo tee -a /etc/security/limits.d/brakebench.conf  # then log in again'),
    ],
)  # fmt: skip
def test_locked_memory(files, monkeypatch, soft, hard, capabilities, status, fix):
    monkeypatch.setattr(machine.resource, "getrlimit", lambda what: (soft, hard))
    line = machine.memory_line(files({"proc/self/status": f"Name:\tx\nCapEff:\t{capabilities}"}))
    assert line[1::2] == (status, fix)


@pytest.mark.parametrize(
    ("hard", "fix"),
    [
        (99, "ulimit -r 50"),
        (0, 'echo "$USER - rtprio 50" | sudo tee -a /etc/security/limits.d/brakebench.conf  # then log in again'),
    ],
)
def test_scheduling_refused(tmp_path, monkeypatch, hard, fix):
    def refuse(*arguments):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(machine.resource, "getrlimit", lambda what: (0, hard))
    line = machine.scheduling_line(tmp_path)
    assert line[1::2] == (WARNING, fix)
    assert "Operation not permitted" in line.finding


def test_scheduling_is_given_back(tmp_path):
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    machine.scheduling_line(tmp_path)
    assert (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority) == before


def test_packages():
    assert software.packages_line(["numpy>=1", "no-such-thing>=2", 'neither; extra == "x"']) == Line(
        "packages",
        MISSING,
        software.packages_line([]).finding + "; not installed: no-such-thing",
        f"{sys.executable} -m pip install no-such-thing",
    )
    assert software.packages_line(["numpy>=1"]).status is OK
    assert platform.python_version() in software.packages_line([]).finding
    assert re.search(r"-m pip install .*(asammdf|\[mdf\])", software.mdf_line(False).fix)
    assert software.mdf_line(True).status is OK


def test_numba_switched_off(monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert software.compiled_line()[1::2] == (WARNING, "unset NUMBA_DISABLE_JIT")


def test_loopback(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    line = loopback_line()
    assert line.status is OK
    assert str(tmp_path) in line.finding
    assert list(tmp_path.iterdir()) == []
    (tmp_path / f"brakebench-{os.getuid()}").write_text("in the way")
    broken = loopback_line()
    assert broken.status is MISSING
    assert str(tmp_path) in broken.finding


def test_whatever_goes_wrong_becomes_a_line():
    def fail():
        raise KeyError("x")

    assert guarded("thing", fail) == [Line("thing", WARNING, "could not look: KeyError: 'x'")]


def test_the_whole_examination_without_any_command(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert command.run(argparse.Namespace(json=True)) == 0
    lines = json.loads(capsys.readouterr().out)["lines"]
    assert {line["topic"] for line in lines} >= TOPICS
    assert all(set(line) == {"topic", "status", "finding", "fix"} for line in lines)
    assert {line["status"] for line in lines} <= {"ok", "warning", "missing"}
    assert not [line for line in lines if "could not look" in line["finding"]]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_text(width):
    fix = "sudo ip link set can0 down && sudo ip link set can0 type can bitrate 500000 && sudo ip link set can0 up"
    lines = [Line("a", OK, "fine"), Line("long topic", WARNING, "word " * 60), Line("b", MISSING, "gone", fix)]
    text = command.render(lines, width)
    shown = text.splitlines()
    assert all(len(line) <= width for line in shown if "$" not in line)
    assert f"         $ {fix}" in shown
    assert shown[0] == "ok       a           fine"
    assert shown[-1] == "1 ok, 1 warning, 1 missing"
    coloured = command.render(lines, width, colour=True)
    assert "\x1b[31mmissing\x1b[0m" in coloured
    for sgr in ("\x1b[31m", "\x1b[32m", "\x1b[33m", "\x1b[0m"):
        coloured = coloured.replace(sgr, "")
    assert coloured == text


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((sys.executable, "-c", "print('x')"), "x\n"),
        ((sys.executable, "-c", "raise SystemExit(3)"), None),
        ((sys.executable, "-c", "input(); print('x')"), None),  # nothing on standard input
        (("/no/such/command",), None),
    ],
)
def test_output_of(arguments, text):
    assert output_of(arguments, 60.0) == text


def test_output_of_what_hangs():
    assert output_of((sys.executable, "-c", "import time; time.sleep(60)"), 0.2) is None
