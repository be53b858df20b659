"""What the controller's process sent in real time, sent again by a fresh node that is fed the same frames."""

import json
import re
from collections import defaultdict, deque

import pytest

from dbc.bench_messages import EcuReception, EcuTiming
from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from ecu.node import SOURCES, EcuNode
from hil.bench.node_process import NODE_PERIOD_NS
from hil.scenario.scenario import load_scenario

LINE = re.compile(r"\(\d+\.\d+\) (\w+) ([0-9A-F]+)#([0-9A-F]*)")
NEVER = 15


@pytest.fixture
def recorded(brakebench, channel, tmp_path, short):
    """Payloads by (bus, identifier) of a run."""
    result = json.loads(brakebench("run", short, "--json", "--bus", channel).stdout)
    payloads = defaultdict(list)
    for line in (tmp_path / result["log"]).read_text().splitlines():
        bus, can_id, data = LINE.match(line).groups()
        payloads[BusName(bus), int(can_id, 16)].append(bytes.fromhex(data))
    return payloads, load_scenario(str(tmp_path / short))


def decoded(payloads, kind):
    """All messages of a kind."""
    spec = spec_of(kind)
    return [spec.decode(data) for data in payloads[spec.bus, spec.can_id]]


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


def answers(node, numbers, all_inboxes):
    """What the node sends at its ticks, by (bus, identifier)."""
    sent = defaultdict(list)
    for number, inbox in zip(numbers, all_inboxes, strict=True):
        for frame in node.step(number * NODE_PERIOD_NS, inbox):
            sent[frame.bus, frame.can_id].append(frame.data)
    return dict(sent)


def test_the_same_frames_give_the_same_bytes_in_a_process_and_here(recorded):
    payloads, scenario = recorded
    numbers = [timing[0] for timing in decoded(payloads, EcuTiming)]  # a tick that is late leaves some out
    receptions = decoded(payloads, EcuReception)[: len(numbers)]  # the recording may end within a tick
    assert len(receptions) == len(numbers) > 150
    fed = list(inboxes(payloads, receptions))
    assert sum(map(len, fed)) > 8 * len(fed)
    sent = answers(EcuNode(scenario.ecu, NODE_PERIOD_NS), numbers, fed)
    for key, frames in sent.items():
        assert payloads[key][: len(frames)] == frames
        assert len(payloads[key]) - len(frames) in (0, 1)
    assert {spec_of(EcuReception).can_id} < {can_id for _, can_id in sent}
    assert len(sent) == 9
