"""What the controller's process sent in real time, sent again by a fresh node that is fed the same frames."""

import json
import re
from collections import defaultdict, deque

import pytest

from dbc.bench_messages import EcuReception
from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from ecu.node import SOURCES, EcuNode
from hil.node_process import NODE_PERIOD_NS
from hil.scenario import load_scenario

LINE = re.compile(r"\(\d+\.\d+\) (\w+) ([0-9A-F]+)#([0-9A-F]*)")
NEVER = 15
TRIES = 5
SLOTS = 10  # of the ECU's cycles: the hundred milliseconds that all of them divide


@pytest.fixture
def recorded(brakebench, channel, tmp_path, short):
    """Payloads by (bus, identifier) of a run without overruns, where every tick is one period after the last."""
    for _ in range(TRIES):
        result = json.loads(brakebench("run", short, "--json", "--bus", channel).stdout)
        if result["overruns"] == 0:
            break
    else:
        pytest.skip(f"{TRIES} runs of four seconds all had overruns: this machine is too busy to know the ticks' times")
    payloads = defaultdict(list)
    for line in (tmp_path / result["log"]).read_text().splitlines():
        bus, can_id, data = LINE.match(line).groups()
        payloads[BusName(bus), int(can_id, 16)].append(bytes.fromhex(data))
    return payloads, load_scenario(str(tmp_path / short))


def inboxes(payloads, receptions):
    """Frames of each tick: of every source those up to the counter that the ECU says it consumed last."""
    specs = [spec_of(kind) for kind in SOURCES]
    waiting = [deque(payloads[spec.bus, spec.can_id]) for spec in specs]
    before = [NEVER] * len(specs)
    for message in receptions:
        inbox = []
        for n, (spec, counter) in enumerate(zip(specs, message, strict=False)):
            while before[n] != counter:
                data = waiting[n].popleft()
                before[n] = data[1] & 0xF  # ALIVE_COUNTER
                inbox.append(Frame(spec.bus, spec.can_id, data))
        yield inbox


def answers(node, all_inboxes, first_tick):
    """What the node sends, by (bus, identifier)."""
    sent = defaultdict(list)
    for tick, inbox in enumerate(all_inboxes, first_tick):
        for frame in node.step(tick * NODE_PERIOD_NS, inbox):
            sent[frame.bus, frame.can_id].append(frame.data)
    return dict(sent)


def test_the_same_frames_give_the_same_bytes_in_a_process_and_here(recorded):
    payloads, scenario = recorded
    reception = spec_of(EcuReception)
    receptions = [reception.decode(data) for data in payloads[reception.bus, reception.can_id]]
    assert len(receptions) > 150
    fed = list(inboxes(payloads, receptions))
    assert sum(map(len, fed)) > 8 * len(fed)
    for slot in range(SLOTS):  # where in the cycles the process began
        sent = answers(EcuNode(scenario.ecu, NODE_PERIOD_NS), fed, slot)
        if all(sent[key] == payloads[key] for key in sent):
            break
    else:
        pytest.fail("no node that is fed these frames sends what the process sent")
    assert {spec_of(EcuReception).can_id} < {can_id for _, can_id in sent}
    assert len(sent) == 8
