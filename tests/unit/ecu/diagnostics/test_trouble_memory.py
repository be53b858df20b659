"""Status bits, clearing, aging and the setting of codes, by udsoncan's client."""

import pytest
from udsoncan.exceptions import NegativeResponseException

from dbc.messages import Steering
from ecu.diagnostics.trouble_memory import AGED_AFTER, TroubleCodeMemory, dtc_of
from ecu.law.trouble_codes import CODES, NO_TROUBLE, FreezeFrame, remember

LOST = next(code for code in CODES if code.name == "steering_lost")
DTC = dtc_of(LOST)
FRAME = FreezeFrame(1, 20.0, 0.0, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)
BIT = 1 << CODES.index(LOST)


def status_of(client, dtc=DTC):
    return next((d.status.get_byte_as_int() for d in client.get_supported_dtc().service_data.dtcs if d.id == dtc), None)


def test_a_lost_source_fails_heals_and_is_cleared(bench):
    client, car = bench.client, bench.rig.car
    assert len(client.get_supported_dtc().service_data.dtcs) == len(CODES)
    assert status_of(client) == 0x00
    car.silent.add(Steering)
    bench.tester.step(10)
    assert status_of(client) == 0x01 | 0x02 | 0x04 | 0x08 | 0x20 | 0x80
    client.clear_dtc()
    bench.tester.step(2)
    assert status_of(client) == 0xAF  # still failing: found anew
    car.silent.clear()
    bench.tester.step(20)
    assert status_of(client) == 0x2E
    assert [trouble.code.name for trouble in bench.rig.node.trouble_codes] == ["steering_lost"]
    client.clear_dtc(DTC)
    assert status_of(client) == 0x00
    assert bench.rig.node.trouble_codes == ()
    assert client.get_dtc_snapshot_by_dtc_number(DTC).service_data.dtcs[0].snapshots == []
    assert client.get_dtc_extended_data_by_dtc_number(DTC, data_size=1).service_data.dtcs[0].extended_data == []
    with pytest.raises(NegativeResponseException, match="RequestOutOfRange"):
        client.clear_dtc(0x123456)


def test_the_setting_of_codes_off_keeps_the_memory_as_it_is(bench):
    client, car = bench.client, bench.rig.car
    client.change_session(3)
    client.control_dtc_setting(2)
    car.silent.add(Steering)
    bench.tester.step(50)
    assert status_of(client) == 0x00
    client.control_dtc_setting(1)
    bench.tester.step(2)
    assert status_of(client) == 0xAF
    client.control_dtc_setting(2)
    client.change_session(1)
    assert bench.server.memory.enabled


def test_a_failure_that_began_with_the_setting_off_is_seen_when_the_session_ends(bench):
    client, car = bench.client, bench.rig.car
    client.change_session(3)
    client.control_dtc_setting(2)
    car.silent.add(Steering)
    bench.tester.step(50)
    client.change_session(1)
    bench.tester.step(2)
    assert not bench.server.awake
    car.silent.clear()
    bench.tester.step(50)
    assert status_of(client) == 0x2E


def test_a_cycle_begins_with_a_reset(bench):
    client, car = bench.client, bench.rig.car
    car.silent.add(Steering)
    bench.tester.step(10)
    car.silent.clear()
    bench.tester.step(50)
    client.ecu_reset(1)
    assert status_of(client) == 0x6C  # in INIT: confirmed, pending, failed since clear, not completed in this cycle
    bench.tester.step(100)
    assert status_of(client) == 0x2C
    client.ecu_reset(1)
    bench.tester.step(100)
    assert status_of(client) == 0x28
    (seen,) = client.get_dtc_extended_data_by_dtc_number(DTC, 2, data_size=1).service_data.dtcs
    assert seen.extended_data[0].raw_data == b"\x01"


def test_an_old_code_ages_away():
    memory = TroubleCodeMemory()
    entry = memory.entries[DTC]
    active = remember(NO_TROUBLE, BIT, 1.0, FRAME)
    memory.update(active)
    memory.update(remember(active, 0, 2.0, FRAME))
    memory.new_cycle()
    for cycle in range(AGED_AFTER):
        assert entry.status & 0x08
        assert entry.aging == cycle
        assert entry.snapshot == (1.0, FRAME)
        memory.complete()
        memory.new_cycle()
    assert not entry.status & 0x0F
    assert (entry.snapshot, entry.occurrences) == (None, 0)


def test_a_cycle_without_a_test_ages_nothing():
    memory = TroubleCodeMemory()
    memory.update(remember(NO_TROUBLE, BIT, 1.0, FRAME))
    memory.new_cycle()
    memory.new_cycle()
    assert memory.entries[DTC].aging == 0
    assert memory.entries[DTC].status & 0x04


def test_a_code_that_comes_again_counts_and_keeps_its_first_snapshot():
    memory, troubles = TroubleCodeMemory(), NO_TROUBLE
    for time_s in range(600):
        troubles = remember(troubles, BIT if time_s % 2 == 0 else 0, float(time_s), FRAME)
        memory.update(troubles)
    assert memory.entries[DTC].occurrences == 255
    assert memory.entries[DTC].snapshot == (0.0, FRAME)
