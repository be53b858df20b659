"""A scan over every service and sub-function in every session finds the documented table and nothing else."""

import pytest
from uds_tester import functional

from ecu.diagnostics.services import SERVICES

SESSIONS = {1: "10 01", 3: "10 03"}


def expected_alone(sid, session):
    """Answer to the service identifier without anything behind it."""
    if sid not in SERVICES:
        return "11"
    return "13" if session in SERVICES[sid].sessions else "7f"


@pytest.mark.parametrize("session", [1, 3])
def test_every_service_identifier(bench, session):
    tester = bench.tester
    for sid in range(0x100):
        if sid % 32 == 0:
            assert tester.ask(SESSIONS[session], 3) != []
        nrc = expected_alone(sid, session)
        assert tester.ask(f"{sid:02x}", 3) == [f"7f {sid:02x} {nrc}"]
        assert functional(tester, f"{sid:02x}", 3) == ([f"7f {sid:02x} 13"] if nrc == "13" else [])


@pytest.mark.parametrize("session", [1, 3])
def test_every_sub_function(bench, session):
    tester = bench.tester
    for sid, service in SERVICES.items():
        if service.sub is None:
            continue
        tester.ask(SESSIONS[session], 3)
        for sub in range(0x80):
            if sub in service.sub:
                continue
            nrc = "12" if session in service.sessions else "7f"
            assert tester.ask(f"{sid:02x} {sub:02x}", 2) == [f"7f {sid:02x} {nrc}"]
            assert functional(tester, f"{sid:02x} {sub | 0x80:02x}", 2) == []


# a whole request of each service with its answer in the extended session, the lock closed, the car standing
WHOLE = {
    0x10: ("10 03", "50 03 00 32 03 e8"), 0x11: ("11 03", "51 03"), 0x14: ("14 ff ff ff", "54"),
    0x19: ("19 01 ff", "59 01 ff 01 00 00"), 0x22: ("22 f1 89", "62 f1 89 30 30 30 31"),
    0x27: ("27 02 00 00 00 00", "7f 27 24"), 0x28: ("28 00 01", "68 00"), 0x2A: ("2a 04", "6a"),
    0x2E: ("2e 14 01 00 00 00 00 00 00 00 00", "7f 2e 33"), 0x2F: ("2f 40 00 00", "7f 2f 33"),
    0x31: ("31 01 02 02", "7f 31 33"), 0x3E: ("3e 00", "7e 00"), 0x85: ("85 01", "c5 01"),
}  # fmt: skip


@pytest.mark.parametrize("sid", sorted(SERVICES))
def test_a_whole_request(bench, sid):
    request, answer = WHOLE[sid]
    tester = bench.tester
    default = [answer if 1 in SERVICES[sid].sessions else f"7f {sid:02x} 7f"]
    assert tester.ask(request, 8) == default
    tester.ask("10 03")
    assert tester.ask(request, 8) == [answer]
    bench.drive()
    tester.ask("10 03")
    assert tester.ask(request, 8) == ["7f 11 22" if sid == 0x11 else answer]
