"""Gateway, rest-bus and partial plant as processes, as their pages say."""

import re
import shlex
import signal
import sys
from pathlib import Path

import cantools
import pytest
from processes import RUN_LIMIT_S, result_of, wait_until

ROOT = Path(__file__).parents[2]
RAV4 = cantools.database.load_file(ROOT / "examples" / "rav4_brake.dbc", database_format="dbc")


def lines_of(page):
    """Commands of a page's first shell block, each as words."""
    block = re.search(r"```sh\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL)[1]
    return [shlex.split(line.removesuffix("&")) for line in block.splitlines()]


def follow(page, start, channel, short):
    """Start every command of a page's first block as it stands there, but on channels and with a scenario of ours."""
    name = channel.removeprefix("loopback:")
    started = []
    for program, *words in lines_of(page):
        words = [word.replace("demo", name).replace("rav4", f"{name}-r") if "/" not in word else word for word in words]
        words = [str(ROOT / word) if word.startswith("examples/") else word for word in words]
        if words[0] in ("run", "plant"):
            words.insert(1, short)
        if words[0] == "run":
            words += ["--json", "--out", "out"]
        started.append(start(*words) if program == "brakebench" else start(*words, program=[sys.executable]))
    return started


@pytest.mark.slow
@pytest.mark.parametrize("page", ["gateway.md", "partial-plant.md"])
def test_the_page_followed_literally(page, start, channel, short):
    bench, ours, theirs = follow(page, start, channel, short)
    result = result_of(bench, (0, 4))
    assert theirs.poll() is None, theirs.communicate()
    ours.send_signal(signal.SIGINT)
    words = ours.communicate(timeout=RUN_LIMIT_S)[1]
    print(page, result["stop_distance_m"], words.splitlines()[-1])
    assert ours.returncode == 0, words
    assert 3.0 < result["stop_distance_m"] < 20.0
    assert (result["processes"], result["frames_corrupt"]) == (1, 0)
    if page == "gateway.md":
        assert "EHB_DEMAND_FRONT: sent" in words
        assert " 0 of theirs rejected" in words
    else:
        assert "plays BATTERY, DRIVER, IWM, SENSORS; reads EHB_PRESSURE_FRONT, EHB_PRESSURE_REAR of EHB" in words


@pytest.mark.slow
def test_a_restbus_is_edited_by_lines(start, channel, tmp_path):
    log = tmp_path / "log"
    recorder = start("record", str(log), "--bus", channel)
    example = ROOT / "examples"
    settings = ["--settings", str(example / "rav4_restbus.toml"), "--bus", channel]
    restbus = start("restbus", str(example / "rav4_brake.dbc"), "--node", "CAR", *settings, stdin=True)

    def last(name):
        message = RAV4.get_message_by_name(name)
        found = re.findall(rf" {message.frame_id:03X}#([0-9A-F]+)\n", log.read_text() if log.exists() else "")
        return message.decode(bytes.fromhex(found[-1])) if found else None

    def say(line):
        restbus.stdin.write(line + "\n")
        restbus.stdin.flush()

    assert wait_until(lambda: last("SPEED"), "SPEED")["SPEED"] == 50.0
    assert last("WHEEL_SPEEDS")["WHEEL_SPEED_RL"] == pytest.approx(50.0)
    assert last("BRAKE_2") is None
    say("SPEED.SPEED=30.5")
    say("nonsense")
    say("BRAKE_2.BRAKE_PRESSED=1")
    wait_until(lambda: last("SPEED")["SPEED"] == 30.5, "the edit")
    wait_until(lambda: last("BRAKE_2"), "the event")
    refused = start("restbus", str(example / "rav4_brake.dbc"), "--node", "CAR", *settings)
    assert "SPEED, which this rest-bus would send" in refused.communicate(timeout=RUN_LIMIT_S)[1]
    assert refused.returncode == 2
    other = start("restbus", str(example / "rav4_brake.dbc"), "--node", "CAR", *settings, "--force")
    wait_until(lambda: last("SPEED")["SPEED"] == 50.0, "the other one's frames")
    other.send_signal(signal.SIGINT)
    other.communicate(timeout=RUN_LIMIT_S)
    restbus.send_signal(signal.SIGINT)
    words = restbus.communicate(timeout=RUN_LIMIT_S)[1]
    assert restbus.returncode == 0, words
    assert "'nonsense': expected MESSAGE.SIGNAL=VALUE" in words
    assert "SPEED: somebody else sends it, too" in words
    assert "BRAKE_2 only when it is edited" in words
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=RUN_LIMIT_S)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gateway", "none.toml", "--to", "loopback:b"], "none.toml: cannot be read as TOML"),
        (
            ["gateway", str(ROOT / "examples" / "rav4_gateway.toml"), "--bus", "loopback:b", "--to", "loopback:b"],
            "our bus and theirs are both loopback:b; expected two",
        ),
        (["restbus", str(ROOT / "examples" / "rav4_brake.dbc"), "--node", "RADIO"], "no messages of a node RADIO"),
        (["plant", "--play", "radio", "--bus", "loopback:b"], "--play: RADIO: no node of the car"),
    ],
)
def test_wrong_use_is_said_in_one_line(capsys, arguments, message):
    from hil.cli.main import main

    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.startswith("brakebench: ")
    assert err.count("\n") == 1
