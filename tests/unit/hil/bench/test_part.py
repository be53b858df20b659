"""A plant that plays a part of the car, and what plays the rest."""

import pytest

from dbc.bench_messages import TruthMotion
from dbc.contract import contract, spec_of
from dbc.frame import BusName, Frame
from hil.bench.node_process import NODE_PERIOD_NS
from hil.bench.part import Part, PartError, PartOfPlant
from hil.bench.virtual import own_nodes
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from plant.node import SENDERS, PlantNode

TRUTH = spec_of(TruthMotion)


def part_of(scenario, part, say=lambda _: None):
    node = PlantNode(scenario.plant, scenario.manoeuvre, 1, NODE_PERIOD_NS, part.nodes, **scenario.effects.for_node())
    return PartOfPlant(node, part, say)


def stop(*parts, say=lambda _: None):
    """Stopping distance, m, with the car made of these parts, and the identifiers that each sends."""
    scenario = load_scenario("stop72")
    nodes = [part_of(scenario, part, say) for part in parts] or own_nodes(scenario, 1)[:1]
    members = [*(Member(node, NODE_PERIOD_NS) for node in nodes)]
    members.append(Member(own_nodes(scenario, 1)[1], NODE_PERIOD_NS, 5_000_000))
    sent, motion = [set() for _ in members], None
    for step in lockstep(members):
        if step.now_ns > 10_000_000_000:
            return motion, sent[:-1]
        for frame in step.frames:
            sent[step.member].add((frame.bus, frame.can_id))
            if frame.bus is BusName.BENCH and frame.can_id == TRUTH.can_id:
                motion = TRUTH.decode(frame.data)
    return None


def test_a_car_of_two_parts_stops_as_the_whole_one():
    """The brake in another node: its pressure comes quantised and a tick later."""
    whole, (all_sent,) = stop()
    rest, (body_sent, brake_sent) = stop(Part(SENDERS - {"EHB"}), Part(["ehb"]))
    print(f"whole {whole.distance_m:.2f} m, brake elsewhere {rest.distance_m:.2f} m")
    assert rest.speed_mps == pytest.approx(0.0, abs=0.02)
    assert rest.distance_m == pytest.approx(whole.distance_m, rel=0.01)
    assert body_sent | brake_sent == all_sent
    assert not body_sent & brake_sent


def test_without_the_rest_it_says_what_does_not_come():
    said = []
    motion, _ = stop(Part(["sensors", "IWM", "battery", "driver"]), say=said.append)
    assert motion.speed_mps > 15.0  # nobody brakes
    assert said == [f"EHB_PRESSURE_{axle} does not come: start what sends it" for axle in ("FRONT", "REAR")]


def test_it_says_when_the_rest_comes():
    said, scenario = [], load_scenario("stop72")
    node = part_of(scenario, Part(SENDERS - {"EHB"}), said.append)
    pressures = [
        Frame(BusName.VEHICLE, spec.can_id, bytes(spec.length)) for spec in contract(BusName.VEHICLE).sent_by("EHB")
    ]
    for k in range(300):
        node.step(k * NODE_PERIOD_NS, pressures if k >= 150 else [])
    assert said[2:] == ["EHB_PRESSURE_FRONT comes", "EHB_PRESSURE_REAR comes"]


def test_a_real_imu_is_left_out():
    part = Part(leave=["body_motion"])
    assert not part.whole
    sent = {f.can_id for f in part_of(load_scenario("stop72"), part).step(0, []) if f.bus is BusName.VEHICLE}
    assert sent == {spec.can_id for spec in contract(BusName.VEHICLE).sent_by(*SENDERS) if spec.name != "BODY_MOTION"}
    assert str(part) == "plays BATTERY, DRIVER, EHB, IWM, SENSORS without BODY_MOTION"


def test_what_it_plays_and_reads():
    part = Part(["sensors", "iwm", "battery"])
    assert part.senders == ("BATTERY", "IWM", "SENSORS", "PLANT")
    assert str(part) == (
        "plays BATTERY, IWM, SENSORS; reads EHB_PRESSURE_FRONT, EHB_PRESSURE_REAR of EHB; "
        "BRAKE_PEDAL, STEERING of DRIVER from the bus"
    )
    assert Part().whole
    assert "PLANT" not in Part(["ehb"]).senders


@pytest.mark.parametrize(
    ("play", "leave", "message"),
    [
        (["radio"], [], "--play: RADIO: no node of the car; expected some of BATTERY, DRIVER, EHB"),
        ([], ["EHB_PRESSURE_FRONT"], "--leave: EHB_PRESSURE_FRONT: expected a played message"),
        (["ehb"], ["BODY_MOTION"], "some of none"),
    ],
)
def test_refuses_a_part_that_is_none(play, leave, message):
    with pytest.raises(PartError, match=message):
        Part(play, leave)
