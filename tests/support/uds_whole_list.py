"""The whole list of services, run by udsoncan's client over can-isotp against an ECU process on any bus."""

import struct
import time
from contextlib import contextmanager
from itertools import pairwise

import can
import isotp
import pytest
from processes import wait_until
from uds_tester import client_over
from udsoncan.connections import PythonIsoTpConnection
from udsoncan.exceptions import NegativeResponseException

from dbc.contract import spec_of
from dbc.diagnostic_ids import PERIODIC, REQUEST, RESPONSE
from dbc.messages import BrakeMode, BrakeStatus
from ecu.diagnostics.calibration import PARAMETERS
from ecu.diagnostics.identifiers import IDENTIFIERS
from ecu.law.trouble_codes import CODES

STANDING = """title = "standing"
[start]
speed_mps = 0.0
[driver]
pedal = [[0.0, 0.0]]
[end]
duration_s = 3600.0
"""


def until_normal(bus: can.BusABC) -> None:
    """Wait until the controller on a bus is in NORMAL."""
    spec = spec_of(BrakeStatus)
    # a slow machine's reader falls behind a whole bus, and the kernel drops what it does not take
    bus.set_filters([{"can_id": spec.can_id, "can_mask": 0x7FF}])

    def normal() -> bool:
        message = bus.recv(1.0)
        known = message is not None and message.arbitration_id == spec.can_id
        return known and spec.decode(bytes(message.data))[0] == BrakeMode.NORMAL

    wait_until(normal, "NORMAL")


@contextmanager
def plugged_in(bus: can.BusABC, **params):
    """udsoncan's client over can-isotp on a bus; a second reader takes the periodic frames."""
    bus.set_filters([{"can_id": one, "can_mask": 0x7FF} for one in (RESPONSE, PERIODIC)])
    address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=REQUEST, rxid=RESPONSE)
    notifier = can.Notifier(bus, [], timeout=0.05)
    stack = isotp.NotifierBasedCanStack(
        bus, notifier, address=address, params={"stmin": 0, "blocksize": 0, "tx_padding": 0xCC, **params}
    )
    periodic = []
    notifier.add_listener(lambda message: message.arbitration_id == PERIODIC and periodic.append(bytes(message.data)))
    # a busy machine keeps no P2 of 50 ms; that it is kept is shown in virtual time
    client = client_over(PythonIsoTpConnection(stack), use_server_timing=False, p2_timeout=10.0, request_timeout=20.0)
    client.periodic = periodic
    try:
        with client:
            yield client
    finally:
        notifier.stop()


def refused(code, function, *arguments):
    with pytest.raises(NegativeResponseException) as caught:
        function(*arguments)
    assert caught.value.response.code == code


def run_the_whole_list(client):
    """Every service once or more; the car stands, the controller is in NORMAL."""
    refused(0x7F, client.start_routine, 0x0201)
    assert client.change_session(3).service_data.p2_server_max == 0.05
    dids = list(IDENTIFIERS)
    for first in range(0, len(dids), 25):  # answers of up to 300 bytes
        assert client.read_data_by_identifier(dids[first : first + 25]).positive
    client.clear_dtc()
    assert len(client.get_supported_dtc().service_data.dtcs) == len(CODES)
    assert client.get_number_of_dtc_by_status_mask(0x01).service_data.dtc_count == 0
    client.control_dtc_setting(2)
    client.control_dtc_setting(1)
    did = next(did for did, one in PARAMETERS.items() if one.name == "fade_start_mps")
    refused(0x33, client.write_data_by_identifier, did, 4.0)
    client.unlock_security_access(1)
    client.write_data_by_identifier(did, 4.0)
    assert client.read_data_by_identifier_first(did) == (4.0,)
    client.io_control(0x4000, 3, [20e5])
    deadline = time.monotonic() + 5.0
    while client.read_data_by_identifier_first(0x0205)[0] < 15e5:  # the brake of the plant presses
        assert time.monotonic() < deadline
    client.io_control(0x4000, 0)
    assert client.start_routine(0x0201).service_data.routine_status_record == b"\x02"
    client.start_routine(0x0202)
    client.stop_routine(0x0202)
    assert client.get_routine_result(0x0202).service_data.routine_status_record == b"\x03"
    client.conn.send(bytes.fromhex("2a0300"))
    assert client.conn.wait_frame(timeout=2.0) == b"\x6a"
    deadline = time.monotonic() + 10.0
    while len(client.periodic) < 100:
        assert time.monotonic() < deadline
        client.tester_present()
    client.conn.send(bytes.fromhex("2a04"))
    assert client.conn.wait_frame(timeout=2.0) == b"\x6a"
    counts = [struct.unpack(">BBf", data[:6])[1] for data in client.periodic]
    late = sum((b - a) & 0xFF != 1 for a, b in pairwise(counts))
    assert late < 10  # ticks that a busy machine left out
    client.communication_control(1, 1)
    client.communication_control(0, 1)
    with client.suppress_positive_response:
        client.tester_present()
    client.ecu_reset(1)
    assert client.read_data_by_identifier_first(0xF186) == (1,)
