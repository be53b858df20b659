"""Each fault of the library that names a code ends in that code, with snapshot and healing, as udsoncan sees it."""

import pytest
from uds_tester import VirtualConnection, client_over

from dbc.diagnostic_ids import ANSWERS
from dbc.messages import Fault
from ecu.diagnostics.trouble_memory import dtc_of
from ecu.law.trouble_codes import CODES
from hil.bench.stimulus import StimulusNode
from hil.bench.virtual import members, own_nodes
from hil.faults.catalogue import FAULTS
from hil.rt.lockstep import lockstep
from hil.scenario.scenario import load_scenario

SCENARIO = """title = "braking, then rolling"
blending = 0.7
[start]
speed_mps = 30.0
[driver]
pedal = [[0.0, 0.5], [2.0, 0.5], [2.2, 0.0]]
[end]
duration_s = 60.0
"""
AT_S, FOR_S = 0.5, 1.0
BY_DTC = {dtc_of(code): code for code in CODES}
# bits that name no other part: what is wrong with frames, with a torque, or between two channels
BESIDE = Fault.COMMUNICATION | Fault.MOTOR_TORQUE | Fault.PEDAL_DISAGREE
# a few quick ones of every family; the rest are slow
QUICK = ("silent", "signal_not_available", "motor_dead", "bits_flipped")


class Plugged:
    """The ECU with a tester's plug beside it: frames go in and out behind its faults."""

    def __init__(self, ecu):
        self.ecu, self.to_ecu, self.answers = ecu, [], []

    def step(self, now_ns, inbox):
        heard, self.to_ecu = [*inbox, *self.to_ecu], []
        sent = self.ecu.step(now_ns, heard)
        self.answers += [frame for frame in sent if frame.can_id in ANSWERS]
        return [frame for frame in sent if frame.can_id not in ANSWERS]


class VirtualCar:
    """The bench of `hil.bench.virtual` with a tester."""

    def __init__(self, scenario, faults):
        plant, self.ecu = own_nodes(scenario, 1)
        self.plug = Plugged(self.ecu)
        self.stimulus = StimulusNode(scenario.blending, faults, seed=1)
        self.steps = lockstep(members(scenario, plant, self.plug, self.stimulus))
        self.tester = VirtualConnection(self.tick)
        self.client = client_over(self.tester)

    def tick(self, out):
        self.plug.to_ecu += out
        for step in self.steps:
            if step.member == 2:
                break
        answers, self.plug.answers = self.plug.answers, []
        return answers

    def until(self, time_s):
        while self.stimulus.time_s is None or self.stimulus.time_s < time_s:
            self.tester.step()


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("dashboard") / "rolling.toml"
    path.write_text(SCENARIO)
    return load_scenario(str(path))


def cases():
    for kind in FAULTS:
        if kind.in_virtual_time:
            for target in kind.usual or (None,):
                marks = () if kind.name in QUICK and target == kind.usual[0] else pytest.mark.slow
                yield pytest.param(kind, target, id=f"{kind.name}-{target}", marks=marks)


@pytest.mark.parametrize(("kind", "target"), list(cases()))
def test_what_the_tester_sees_of_a_fault(scenario, kind, target):
    values = dict(kind.usual_values) | {"for_s": FOR_S}
    values |= {"delay_s": 0.2} if kind.lead else {}
    armed = kind.on(target, at_s=AT_S, seed=5, values=values)
    car = VirtualCar(scenario, (armed,))
    car.until(AT_S - 0.1)
    assert car.client.get_dtc_by_status_mask(0x08).service_data.dtcs == []
    car.until(AT_S + FOR_S + 12.0)
    found = car.client.get_dtc_by_status_mask(0x08).service_data.dtcs
    codes = [BY_DTC[dtc.id] for dtc in found]
    allowed = armed.expected.trouble
    assert all(not code.fault & ~allowed & ~BESIDE for code in codes), [code.name for code in codes]
    if not allowed:
        assert not codes
    elif armed.expected.detect_ms is not None:
        assert codes
    told = car.client.get_number_of_dtc_by_status_mask(0x08).service_data.dtc_count
    assert told == len(found)
    for dtc, code in zip(found, codes, strict=True):
        status = dtc.status
        assert not status.test_failed, f"{code.name} has not healed"
        assert not status.warning_indicator_requested
        assert status.confirmed
        assert status.test_failed_since_last_clear
        (seen,) = car.client.get_dtc_snapshot_by_dtc_number(dtc.id).service_data.dtcs
        snapshot = {one.did: one.data for one in seen.snapshots}
        assert snapshot[0x0201][0] in (1, 2, 3, 4)
        assert 0.0 < snapshot[0x0202][0] < 35.0
        (seen,) = car.client.get_dtc_extended_data_by_dtc_number(dtc.id, data_size=1).service_data.dtcs
        extended = {one.record_number: one.raw_data[0] for one in seen.extended_data}
        assert extended[1] >= 1
        assert (extended[2], extended[3]) == (0, 0x80)
    car.client.clear_dtc()
    assert car.client.get_dtc_by_status_mask(0x08).service_data.dtcs == []
