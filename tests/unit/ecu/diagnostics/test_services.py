"""Each service by udsoncan's client, against the car of the ECU's tests."""

import math
import struct
from itertools import pairwise

import pytest
from uds_tester import functional
from udsoncan.exceptions import NegativeResponseException

from dbc.diagnostic_ids import PERIODIC, REQUEST, REQUEST_FUNCTIONAL, RESPONSE
from dbc.frame import BusName, Frame
from dbc.isotp import segment
from dbc.messages import WheelSpeedFront
from ecu.diagnostics.calibration import PARAMETERS
from ecu.diagnostics.identifiers import IDENTIFIERS
from ecu.diagnostics.protocol import BURST

DEMAND_FL = 0x4000


def refused(code, function, *arguments, **keywords):
    with pytest.raises(NegativeResponseException) as caught:
        function(*arguments, **keywords)
    assert caught.value.response.code == code


def did_of(name):
    (did,) = [did for did, one in IDENTIFIERS.items() if one.name == name]
    return did


def test_sessions_and_their_end(bench):
    data = bench.client.change_session(3).service_data
    assert (data.p2_server_max, data.p2_star_server_max) == (0.05, 10.0)
    assert bench.client.read_data_by_identifier_first(0xF186) == (3,)
    for _ in range(3):
        bench.tester.step(400)
        bench.client.tester_present()
    assert bench.server.session == 3
    bench.tester.step(490)
    assert bench.server.session == 3
    bench.tester.step(20)
    assert bench.server.session == 1
    assert not bench.server.awake
    refused(0x12, bench.client.change_session, 2)


def test_every_identifier_is_read_with_its_size(bench):
    dids = list(IDENTIFIERS)
    for first in range(0, len(dids), 20):
        values = bench.client.read_data_by_identifier(dids[first : first + 20]).service_data.values
        assert len(values) == len(dids[first : first + 20])
    p = bench.rig.node.parameters
    for did, one in PARAMETERS.items():
        value = getattr(getattr(p, one.table), one.name)
        read = bench.client.read_data_by_identifier_first(did)
        assert read == (value if isinstance(value, str | tuple) else (value,)), one.name
    assert bench.client.read_data_by_identifier_first(0xF190) == "BRAKEBENCH0000001"
    speed, current = (bench.client.read_data_by_identifier_first(did_of(n))[1] for n in ("speed", "charge_power"))
    assert speed == pytest.approx(0.0, abs=0.5)
    assert current == pytest.approx(200e3)


def test_an_answer_ends_within_p2_or_says_that_it_comes(bench):
    dids = [did for did, one in PARAMETERS.items() if one.numbers][:40]
    asked = bench.tester.now_ns
    bench.client.read_data_by_identifier(dids[:1])
    (first,) = bench.tester.answered_ns
    assert first - asked <= 50_000_000
    for block_size, st_min in ((0, 0), (0, 0), (1, 0), (0, 20), (4, 127), (0, 0xF5), (0, 0)):
        bench.tester.link.block_size, bench.tester.link.st_min = block_size, st_min
        asked = bench.tester.now_ns
        bench.tester.specific_send(bytes((0x22,)) + b"".join(did.to_bytes(2, "big") for did in dids))
        while len(bench.tester.answers) < 1 or bench.tester.answers[-1][0] == 0x7F:
            bench.tester.step()
            assert bench.tester.now_ns - asked < 10_000_000_000
        first, *rest = bench.tester.answered_ns
        assert first - asked <= 50_000_000
        assert bench.tester.answers[-1][0] == 0x62
        assert [a.hex() for a in bench.tester.answers][:-1] == ["7f2278"] * len(rest)


def test_too_long_an_answer_is_refused(bench):
    dids = [did for did, one in PARAMETERS.items() if one.numbers][:60]
    refused(0x14, bench.client.read_data_by_identifier, dids)


def test_what_is_not_known_is_left_out_and_refused_alone(bench):
    assert bench.tester.ask("22 f1 86 00 01") == ["62 f1 86 01"]
    assert bench.tester.ask("22 00 01") == ["7f 22 31"]
    assert bench.tester.ask("22 f1 86 00") == ["7f 22 13"]
    assert functional(bench.tester, "22 00 01") == []
    assert functional(bench.tester, "22 f1 86") == ["62 f1 86 01"]


def test_seed_and_key(bench):
    client = bench.client
    client.change_session(3)
    refused(0x24, client.send_key, 2, bytes(4))
    assert bench.tester.ask("27 02") == ["7f 27 13"]  # the length is looked at first
    for code in (0x35, 0x35, 0x36):
        client.request_seed(1)
        refused(code, client.send_key, 2, bytes(4))
    refused(0x37, client.request_seed, 1)
    for _ in range(3):
        bench.tester.step(400)
        client.tester_present()
    client.unlock_security_access(1)
    assert client.request_seed(1).service_data.seed == bytes(4)
    client.change_session(3)
    refused(0x33, client.write_data_by_identifier, did_of("blend.fade_start_mps"), 4.0)


def test_calibration_has_bounds_and_ends_with_a_hard_reset(bench):
    client, node = bench.client, bench.rig.node
    did, before = did_of("blend.fade_start_mps"), node.parameters.blend.fade_start_mps
    client.change_session(3)
    refused(0x33, client.write_data_by_identifier, did, 4.0)
    bench.unlock()
    for value in (math.nan, math.inf, 25.0, -1.0, 0.5):  # the last is below the end of the fading
        refused(0x31, client.write_data_by_identifier, did, value)
    refused(0x31, client.write_data_by_identifier, did_of("pedal.map_cubic"), 0.4)
    refused(0x31, client.write_data_by_identifier, did_of("compensation.method"), "joint")
    assert bench.tester.ask("2e " + did.to_bytes(2, "big").hex() + "00") == ["7f 2e 13"]
    client.write_data_by_identifier(did, 4.0)
    assert client.read_data_by_identifier_first(did) == (4.0,)
    client.ecu_reset(3)
    assert node.parameters.blend.fade_start_mps == 4.0
    bench.tester.step(200)
    client.ecu_reset(1)
    bench.tester.step(2)
    assert node.parameters.blend.fade_start_mps == before
    bench.drive()
    bench.unlock()
    refused(0x22, client.write_data_by_identifier, did, 4.0)


def test_a_reset_begins_the_law_anew_behind_its_answer(bench):
    client, node = bench.client, bench.rig.node
    assert node.memory.time_s > 5.0
    client.ecu_reset(1)
    assert node.memory.time_s < 0.05
    bench.tester.step(150)
    assert node.memory.modes.mode == 1
    bench.drive()
    refused(0x22, client.ecu_reset, 1)


def test_demands_are_the_testers_only_while_the_car_stands(bench):
    client, node = bench.client, bench.rig.node
    bench.client.change_session(3)
    refused(0x33, client.io_control, DEMAND_FL, 3, [20e5])
    bench.unlock()
    for value in (61e5, -1.0, math.nan):
        refused(0x31, client.io_control, DEMAND_FL, 3, [value])
    refused(0x31, client.io_control, DEMAND_FL, 1)
    client.io_control(DEMAND_FL, 3, [20e5])
    client.io_control(0x4013, 3, [-20.0])
    assert node.outputs.pressure_demand_pa == (20e5, 0.0, 0.0, 0.0)
    assert node.outputs.motor_demand_nm == (0.0, 0.0, 0.0, -20.0)
    client.io_control(DEMAND_FL, 0)
    assert node.outputs.pressure_demand_pa == (0.0,) * 4
    client.io_control(0x4013, 2)
    assert node.outputs.motor_demand_nm[3] == -20.0
    bench.tester.step(300)
    client.tester_present()
    bench.tester.step(502)  # the session ends
    assert node.outputs.motor_demand_nm[3] == 0.0


@pytest.mark.parametrize("what", ["drives", "brakes", "wheel speeds lost"])
def test_demands_go_back_at_once(bench, what):
    client, node, car = bench.client, bench.rig.node, bench.rig.car
    bench.unlock()
    client.io_control(DEMAND_FL, 3, [20e5])
    if what == "drives":
        car.wheel_speed = 1.0
    elif what == "brakes":
        car.pedal = (0.3, 0.3)
    else:
        car.silent.add(WheelSpeedFront)
    held = []
    for _ in range(20):
        bench.tester.step()
        held.append(node.outputs.pressure_demand_pa[0] == 20e5)
    assert held[0]  # the frame is on its way
    assert not any(held[5:])
    refused(0x22, client.io_control, DEMAND_FL, 3, [20e5])
    refused(0x22, client.start_routine, 0x0202)


def test_bleeding_presses_each_wheel_and_ends(bench):
    client, node = bench.client, bench.rig.node
    client.change_session(3)
    refused(0x24, client.get_routine_result, 0x0202)
    refused(0x33, client.start_routine, 0x0202)
    bench.unlock()
    client.start_routine(0x0202)
    refused(0x22, client.io_control, DEMAND_FL, 3, [20e5])
    pulses = [0] * 4
    last = (0.0,) * 4
    for tick in range(1000):
        bench.tester.step()
        now = node.outputs.pressure_demand_pa
        for wheel in range(4):
            pulses[wheel] += now[wheel] == 30e5 and last[wheel] == 0.0
        assert sum(p > 0.0 for p in now) <= 1
        last = now
        if tick % 300 == 0:
            client.tester_present()
    assert pulses == [3, 3, 3, 3]
    assert client.get_routine_result(0x0202).service_data.routine_status_record == b"\x02"
    client.start_routine(0x0202)
    bench.tester.step(5)
    client.stop_routine(0x0202)
    assert node.outputs.pressure_demand_pa == (0.0,) * 4
    assert client.get_routine_result(0x0202).service_data.routine_status_record == b"\x03"
    refused(0x24, client.stop_routine, 0x0202)
    refused(0x31, client.start_routine, 0x0299)


def test_self_test_says_what_is_missing(bench):
    client = bench.client
    client.change_session(3)
    assert client.start_routine(0x0201).service_data.routine_status_record == b"\x02"
    state, supplied, codes, mode = struct.unpack(
        ">BHBB", client.get_routine_result(0x0201).service_data.routine_status_record
    )
    assert (state, supplied, codes, mode) == (2, 0x3FF, 0, 1)


def test_zero_of_the_pressure_sensors(bench):
    client, car = bench.client, bench.rig.car
    car.pressure_fl_pa = 1.5e5
    bench.unlock()
    client.start_routine(0x0203)
    bench.tester.step(60)
    status = client.get_routine_result(0x0203).service_data.routine_status_record
    state, *zero = struct.unpack(">B4f", status)
    assert state == 2
    assert zero == pytest.approx([1.5e5, 0.0, 0.0, 0.0])
    assert client.read_data_by_identifier_first(0x0205)[0] == pytest.approx(0.0, abs=1.0)
    car.pressure_fl_pa = 6e5
    bench.tester.step(3)
    client.start_routine(0x0203)
    bench.tester.step(60)
    assert client.get_routine_result(0x0203).service_data.routine_status_record[0] == 4
    assert client.read_data_by_identifier_first(0x0205)[0] == pytest.approx(4.5e5)
    client.ecu_reset(1)
    bench.tester.step(100)
    assert client.read_data_by_identifier_first(0x0205)[0] == pytest.approx(6e5)
    car.pressure_fl_pa = 1.5e5
    bench.unlock()
    client.start_routine(0x0203)
    bench.tester.step(60)
    status = client.get_routine_result(0x0203).service_data.routine_status_record
    assert struct.unpack(">B4f", status) == pytest.approx((2, 1.5e5, 0.0, 0.0, 0.0))
    assert client.read_data_by_identifier_first(0x0205)[0] == pytest.approx(0.0, abs=1.0)


def test_messages_are_silent_only_while_the_car_stands(bench):
    client = bench.client
    client.change_session(3)
    sent = []
    bench.tester._tick = lambda out: sent.append(bench.rig.step(1, out)) or sent[-1]
    client.communication_control(1, 1)
    bench.tester.step(5)
    assert {frame.bus.value for frame in sent[-1]} <= {"bench"}
    client.communication_control(0, 3)
    assert {frame.bus.value for frame in bench.tester.step()} == {"bench", "vehicle"}
    refused(0x31, client.communication_control, 1, 2)
    client.communication_control(1, 1)
    bench.rig.car.wheel_speed = 5.0
    bench.tester.step(5)
    assert any(frame.bus.value == "vehicle" for frame in bench.tester.step())
    refused(0x22, client.communication_control, 1, 1)


def test_after_a_reset_a_silenced_node_says_farewell_again(bench):
    client, node = bench.client, bench.rig.node
    client.change_session(3)
    client.communication_control(1, 1)
    assert node.farewell(bench.rig.tick * 10_000_000) == []
    client.ecu_reset(1)
    assert any(frame.bus.value == "vehicle" for frame in bench.tester.step(20))
    assert len(node.farewell(bench.rig.tick * 10_000_000)) == 4


def test_periodic_reading_at_100_hz(bench):
    tester = bench.tester
    bench.client.change_session(3)
    assert tester.ask("2a 03 00 06") == ["6a"]  # udsoncan refuses this answer of one byte, which the standard asks for
    tester.periodic.clear()
    tester.step(100)
    for low in (0, 6):
        records = [struct.unpack(">BBf", data[:6]) for data in tester.periodic if data[0] == low]
        assert len(records) == 100
        counts = [count for _, count, _ in records]
        assert all((b - a) & 0xFF == 1 for a, b in pairwise(counts))
    times = [struct.unpack(">BBf", data[:6])[2] for data in tester.periodic if data[0] == 0]
    assert times[-1] - times[0] == pytest.approx(0.99, abs=1e-3)
    assert tester.ask("2a 02 06") == ["6a"]
    tester.periodic.clear()
    tester.step(100)
    assert len([data for data in tester.periodic if data[0] == 6]) == 10
    assert tester.ask("2a 04 00") == ["6a"]
    assert tester.ask("2a 03") == ["7f 2a 13"]
    assert tester.ask("2a 05 00") == ["7f 2a 31"]
    assert tester.ask("2a 03 ff") == ["7f 2a 31"]
    assert tester.ask("2a 03 01 02 03 04 05 07 08 09 0a") == ["7f 2a 31"]
    assert tester.ask("2a 04") == ["6a"]
    tester.periodic.clear()
    tester.step(20)
    assert tester.periodic == []


@pytest.mark.parametrize(("session", "number"), [(3, 20), (1, 0)])
def test_periodic_reading_ends_with_the_default_session_only(bench, session, number):
    tester = bench.tester
    bench.client.change_session(3)
    assert tester.ask("2a 03 00") == ["6a"]
    bench.client.change_session(session)
    tester.periodic.clear()
    tester.step(20)
    assert len(tester.periodic) == number


def test_answers_come_before_periodic_data_and_both_keep_to_the_queues_of_adapters(bench):
    tester, ticks = bench.tester, []
    step = tester._tick
    tester._tick = lambda out: ticks.append([f for f in step(out) if f.can_id in (RESPONSE, PERIODIC)]) or ticks[-1]
    bench.client.change_session(3)
    ticks.clear()
    assert tester.ask("2a 03 00 01 02 03 04 05 06 07") == ["6a"]
    begun = next(frames for frames in ticks if any(frame.can_id == PERIODIC for frame in frames))
    assert [frame.can_id for frame in begun] == [RESPONSE] + [PERIODIC] * 8
    tester.periodic.clear()
    dids = [did for did, one in PARAMETERS.items() if one.numbers][:40]
    bench.client.read_data_by_identifier(dids)
    asked = tester.now_ns
    bench.client.read_data_by_identifier(dids)  # its flow control is known now: one frame a tick takes too long
    first, last = tester.answered_ns
    assert first - asked <= 50_000_000 < last - asked
    long = segment(b"\x22" + b"".join(did.to_bytes(2, "big") for did in dids))[0]
    present = Frame(BusName.VEHICLE, REQUEST_FUNCTIONAL, b"\x02\x3e\x00")
    tester._tick([Frame(BusName.VEHICLE, REQUEST, long), present])  # a flow control and an answer at once
    tester.step(5)
    tester._tick([Frame(BusName.VEHICLE, REQUEST, long)] * 12)  # only the last one is worth a flow control
    tester.step(5)
    assert max(map(len, ticks)) == BURST
    records = [data for frames in ticks for data in (f.data for f in frames if f.can_id == PERIODIC)]
    for low in range(8):
        counts = [data[1] for data in records if data[0] == low]
        assert len(counts) > 50
        # one that had no room came a tick later
        assert sum((b - a) & 0xFF != 1 for a, b in pairwise(counts)) <= 2


def test_suppressed_answers_and_functional_requests(bench):
    tester = bench.tester
    assert tester.ask("3e 80") == []
    assert tester.ask("3e 81") == ["7f 3e 12"]
    assert functional(tester, "3e 00") == ["7e 00"]
    assert functional(tester, "3e 81") == []
    assert functional(tester, "ba") == []
    assert functional(tester, "27 01") == []
    assert functional(tester, "3e") == ["7f 3e 13"]
    assert tester.ask("10 83") == []
    assert bench.server.session == 3
    assert functional(tester, "10 81") == []
    assert bench.server.session == 1


def test_a_request_to_everybody_amid_a_long_one(bench):
    dids = list(IDENTIFIERS)[:5]
    long = segment(b"\x22" + b"".join(did.to_bytes(2, "big") for did in dids))
    step = bench.rig.step
    sent = []
    for data in long:
        silent = Frame(BusName.VEHICLE, REQUEST_FUNCTIONAL, b"\x02\x3e\x80")
        sent += step(1, [Frame(BusName.VEHICLE, REQUEST, data), silent])
        sent += step(1, [Frame(BusName.VEHICLE, REQUEST_FUNCTIONAL, b"\x02\x3e\x00")])
    sent += [frame for _ in range(10) for frame in step(1)]
    answers = [frame.data for frame in sent if frame.can_id == RESPONSE]
    present = [data for data in answers if data[:3] == b"\x02\x7e\x00"]
    assert len(present) == len(long) - 1  # the last one comes while the long answer is on its way
    assert sum(data[0] == 0x30 for data in answers) == 1
    assert sum(data[:4] == b"\x03\x7f\x22\x78" for data in answers) == 1
    assert sum(data[0] >> 4 == 1 for data in answers) == 1


def test_an_answer_that_nobody_takes_is_given_up(bench):
    step = bench.rig.step
    supported = Frame(BusName.VEHICLE, REQUEST, b"\x02\x19\x0a")
    sent = step(1, [supported])
    for _ in range(90):
        sent += step(1, [supported])
    first = [frame.data for frame in sent if frame.can_id == RESPONSE]
    assert [data[0] for data in first] == [0x03, 0x11]  # 0x78, the first frame, nothing more
    for _ in range(30):
        step(1)
    assert not bench.server.awake
    assert bench.server._link.errors == []  # nobody reads them: they must not grow
    assert bench.tester.ask("3e 00") == ["7e 00"]
