"""docs/diagnose-it.md followed literally: bench, faults, tester and log reader as the processes a reader starts."""

import json
import re
import shlex
import signal
from pathlib import Path

import pytest
from processes import RUN_LIMIT_S, wait_until
from uds_ecu import ForeignEcu

from hil.errors import INTERRUPTED_EXIT_CODE

PAGE = (Path(__file__).parents[2] / "docs" / "diagnose-it.md").read_text()
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", PAGE.split("## Reference")[0], re.DOTALL)
NUMBER = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?|nan|[0-9A-F]{2}(?= |\])")


def steps():
    """Commands of the page with what it shows behind them, "" where that is nothing."""
    for k, (kind, text) in enumerate(BLOCKS):
        if kind == "sh":
            shown = BLOCKS[k + 1][1] if k + 1 < len(BLOCKS) and not BLOCKS[k + 1][0] else ""
            yield shlex.split(text)[1:], shown


def masked(text):
    """Lines without what differs from run to run."""
    return [" ".join(NUMBER.sub("#", line).split()) for line in text.strip().splitlines()]


def listed(shown, printed):
    """Whether the codes that the page shows are among those printed: a busy machine has more, of lost messages."""
    (_, *codes), lines = masked(shown), masked(printed)
    return set(codes) <= set(lines) if codes else lines == masked(shown)


@pytest.mark.slow
@pytest.mark.long  # of thirty commands one may be refused where a busy machine stalls the bench
def test_the_page_does_what_it_says(start, brakebench, channel, tmp_path):
    (tmp_path / "standing.toml").write_text(next(text for kind, text in BLOCKS if kind == "toml"))
    (first, _), *rest = [([channel if word == "loopback:demo" else word for word in words], s) for words, s in steps()]
    assert first[0] == "run"
    run = start(*first, "--json")
    log = tmp_path / "bench" / "recording.log"
    wait_until(lambda: run.poll() is not None or (log.exists() and log.read_text().count(" 020#") > 300), "a bench")
    brakebench("diag", "clear", "--bus", channel)  # what a busy machine has left
    *session, (reading, said) = rest
    assert len(session) == 13
    for words, shown in session:
        if words[0] == "diag" and words[3] == "read-dtc":  # the fault is injected for half a second
            wait_until(lambda w=words, s=shown: listed(s, brakebench(*w).stdout), shown, 20.0)
            continue
        done = brakebench(*words)
        if words[0] == "diag" and shown:
            assert masked(done.stdout) == masked(shown), words
    measured = (tmp_path / "measured.csv").read_text().splitlines()
    assert measured[0] == "time_s,pressure_fl,wheel_speed_fl"
    assert len(measured) > 100  # fewer than 200 on a machine that skips ticks
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=RUN_LIMIT_S)
    done = brakebench(*reading)
    head, *lines = masked(said)
    assert masked(done.stdout)[0] == head
    assert set(lines) <= set(masked(done.stdout))
    facts = json.loads(brakebench(*reading, "--json").stdout)
    assert facts["messages"]["request"] >= 20
    assert facts["messages"]["refusal"] == facts["unanswered"] == facts["unasked"] == 0
    assert facts["incomplete"] == {}
    asked = [one["service"] for one in facts["uds"] if one["kind"] == "request"]
    assert {0x10, 0x11, 0x14, 0x19, 0x22, 0x27, 0x2A, 0x2E, 0x2F, 0x31, 0x3E} == set(asked)


@pytest.mark.slow
def test_an_ecu_without_a_car(start, brakebench, channel, tmp_path):
    """Refusals have their exit code; nothing of it disturbs the ECU; the log in another format says the same."""
    recorder = start("record", "session.log", "--bus", channel)
    ecu = start("ecu", "--bus", channel)
    connection = ("--bus", channel)
    wait_until(lambda: brakebench("diag", "read", "vin", *connection, check=(0, 3)).returncode == 0, "the ECU")
    refused = brakebench("diag", "io", "pressure_demand_fl", "adjust", "1e6", *connection, check=1)
    assert "service not supported in the active session (0x7F); give --session extended" in refused.stderr
    refused = brakebench("diag", "--session", "extended", "write", "blend.fade_start_mps", "3", *connection, check=1)
    assert "security access denied (0x33); give --unlock" in refused.stderr
    unlocked = ("--session", "extended", "--unlock", *connection)
    assert "conditions not correct" in brakebench("diag", "reset", *unlocked, check=1).stderr  # no speed is known
    supported = json.loads(brakebench("diag", "read-dtc", "--supported", "--json", *connection).stdout)["result"]
    assert all(one["code"].startswith("P") and one["name"] for one in supported)
    assert len(supported) > 50
    for process in (ecu, recorder):
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=RUN_LIMIT_S)
    brakebench("convert", "session.log", "session.blf")
    texts = []
    for name in ("session.log", "session.blf"):
        facts = json.loads(brakebench("decode", name, "--uds", "--json").stdout)
        texts.append([one["text"] for one in facts["uds"]])
        assert facts["messages"]["refusal"] == 3
    assert texts[0] == texts[1]
    assert any("supported codes, " in text and "pedal_lost" in text for text in texts[0])


@pytest.mark.slow
def test_an_output_is_given_back_after_an_interrupt(start, channel):
    with ForeignEcu(channel, 0x714, 0x77E) as ecu:
        ids = ("--bus", channel, "--request-id", "714", "--response-id", "77E")
        tester = start("diag", "io", "0x0100", "adjust", "7f", "--hold", "600", *ids)
        wait_until(lambda: b"\x3e\x80" in ecu.asked, "tester present")
        tester.send_signal(signal.SIGINT)
        tester.communicate(timeout=RUN_LIMIT_S)
        assert tester.returncode == INTERRUPTED_EXIT_CODE
        assert ecu.asked[-1] == b"\x2f\x01\x00\x00"
