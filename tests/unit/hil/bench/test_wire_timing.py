"""Jitter and latency of records whose timing is known."""

import json

import numpy as np
import pytest

from dbc.bench_messages import FaultCommand
from dbc.contract import spec_of
from dbc.database import Database, Message
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal, EhbDemandFront, WheelSpeedFront
from hil.bench.virtual import VirtualBench
from hil.bench.wire_timing import TimingError, cyclic_messages, response_of, spread, table_of
from hil.cli.main import main
from hil.log.signals.databases import Databases
from hil.scenario.scenario import load_scenario

MS = 1_000_000
OWN = Databases.own()
PEDAL, DEMAND = "BRAKE_PEDAL.PEDAL_TRAVEL_1", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL"


def sent(kind, times_ns, values):
    """Frames of a message at times, all its fields with one value each."""
    transmitter, frames = Transmitter(), []
    for k, (time_ns, value) in enumerate(zip(times_ns, values, strict=True)):
        frame = transmitter.frames(k * 10 * MS, [kind(value, value)])[0]
        frames.append(frame._replace(time_ns=int(time_ns)))
    return frames


def test_an_age_and_a_reaction_are_found_as_they_were_made():
    times = np.arange(300) * 10 * MS
    pedal = np.where(times >= 1500 * MS, 0.6, 0.0)
    demand = np.where(times + 3 * MS >= 1523 * MS, 30e5, 0.0)  # two cycles and 3 ms later
    table = table_of([*sent(BrakePedal, times, pedal), *sent(EhbDemandFront, times + 3 * MS, demand)])
    found = response_of(table, OWN, PEDAL, DEMAND)
    assert found.age == spread(np.full(299, 3.0))  # the last one comes behind the last stimulus
    assert (found.reaction, found.unanswered) == (spread(np.array([23.0])), 0)
    still = response_of(
        table_of([*sent(BrakePedal, times, pedal), *sent(EhbDemandFront, times, 0 * demand)]), OWN, PEDAL, DEMAND
    )
    assert (still.reaction.n, still.unanswered) == (0, 1)
    backwards = response_of(table, OWN, "EHB_DEMAND_FRONT", "BRAKE_PEDAL")
    assert (backwards.age, backwards.reaction) == (spread(np.full(299, 7.0)), None)


def test_a_drift_is_no_stimulus():
    times = np.arange(1000) * 10 * MS
    table = table_of([*sent(BrakePedal, times, times * 1e-10), *sent(EhbDemandFront, times, times * 1e-3)])
    assert response_of(table, OWN, PEDAL, DEMAND).reaction.n == 0


def test_jitter_is_held_against_the_stated_cycle():
    times = np.arange(101) * 10 * MS
    times[50] += 2 * MS  # 12 ms, then 8 ms
    times[61:] += 20 * MS  # two cycles without a frame
    foreign = [Frame(BusName.VEHICLE, 0x7F0, b"", k * 7 * MS, True) for k in range(20)]
    late, other = cyclic_messages(table_of([*sent(WheelSpeedFront, times, 0.0 * times), *foreign]), OWN)
    assert (late.name, late.cycle_ms, late.stated, late.frames) == ("WHEEL_SPEED_FRONT", 10.0, True, 101)
    assert (late.jitter.n, late.jitter.p50_ms, late.jitter.max_ms) == (100, 0.0, 20.0)
    assert (late.shortest_ms, late.longest_ms, late.missed) == (8.0, 30.0, 2)
    assert (other.name, other.cycle_ms, other.stated, other.jitter.max_ms) == ("0x7F0", 7.0, False, 0.0)


def test_a_message_without_a_cycle_in_a_database_of_cycles_is_sent_on_a_change():
    spec = spec_of(FaultCommand)
    times = np.cumsum(np.arange(20) * 37 * MS)
    table = table_of([Frame(BusName.BENCH, spec.can_id, bytes(8), int(t)) for t in times])
    assert cyclic_messages(table, OWN) == []
    plain = Databases(Database("plain", {(spec.can_id, False): Message("FAULT", spec.can_id, False, 8, ())}, ()))
    (listed,) = cyclic_messages(table, plain)  # which states no cycle at all
    assert (listed.name, listed.stated, listed.frames) == ("FAULT", False, 20)


def test_what_is_not_there_is_named():
    table = table_of(sent(BrakePedal, np.arange(20) * 10 * MS, np.zeros(20)))
    with pytest.raises(TimingError, match=r"no frame of EHB_DEMAND_FRONT in the record; .* in it: BRAKE_PEDAL"):
        response_of(table, OWN, "BRAKE_PEDAL", "EHB_DEMAND_FRONT")
    with pytest.raises(TimingError, match="two messages, or two signals"):
        response_of(table, OWN, "BRAKE_PEDAL", DEMAND)


def test_a_virtual_run_has_the_phases_of_its_nodes(tmp_path, capsys):
    with VirtualBench(load_scenario("stop72"), tmp_path, 1) as bench:
        bench.run()
    assert main(["latency", str(bench.log), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    through_ecu, pedal, brake = values["responses"]
    assert through_ecu["age"]["max_ms"] == through_ecu["age"]["p50_ms"] == pytest.approx(5.0)  # ECU.phase_ns
    assert pedal["reaction"]["n"] == brake["reaction"]["n"] == 1
    assert 5.0 <= pedal["reaction"]["max_ms"] < 50.0
    assert {one["jitter"]["max_ms"] for one in values["cyclic"]} == {0.0}
    assert {spec_of(kind).name for kind in (BrakePedal, EhbDemandFront)} < {one["name"] for one in values["cyclic"]}
    assert main(["latency", str(bench.log)]) == 0
    assert "WHEEL_SPEED_FRONT to EHB_DEMAND_FRONT" in capsys.readouterr().out
    assert main(["latency"]) == 2
