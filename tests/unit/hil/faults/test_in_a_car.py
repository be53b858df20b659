"""Every fault of the catalogue armed once in a car that brakes, in virtual time: it acts from its time on, seeded."""

import pytest

from dbc.bench_messages import TruthPadFriction
from dbc.contract import spec_of
from dbc.frame import BusName
from dbc.messages import BrakePedal, MotorState, MotorStatusFront
from hil.bench.session import Session, virtual_run
from hil.bench.virtual import simulate
from hil.errors import BrakebenchError
from hil.faults.catalogue import FAULTS, injection
from hil.faults.fault import FROM_THE_FIRST_TICK, Side
from hil.scenario.scenario import load_scenario

SCENARIO = """title = "braking"
[start]
speed_mps = 15.0
[driver]
pedal = [[0.0, 0.5]]
[end]
duration_s = 0.5
"""
AT_S, TICK_NS = 0.3, 10_000_000
INDIRECT = (Side.PLANT, Side.RECEIVER)
BLENDED = "blending = 0.5\n"
VIRTUAL = [kind for kind in FAULTS if kind.in_virtual_time]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("faults") / "braking.toml"
    path.write_text(BLENDED + SCENARIO)
    return load_scenario(str(path))


def frames_of(scenario, *faults):
    """Vehicle frames of each tick of plant and controller, by the tick's time, ns, and who sent."""
    found = {}

    def see(step):
        found[step.now_ns, step.member] = [f for f in step.frames if f.bus is BusName.VEHICLE]

    signals = simulate(scenario, faults=faults, each_tick=see)
    return found, round(signals.start_s * 1e9)


@pytest.fixture(scope="module")
def clean(scenario):
    return frames_of(scenario)


QUICK = ("silent", "replayed", "bits_flipped", "bus_off", "signal_value", "process_stopped")
EACH = [
    pytest.param(kind, id=kind.name, marks=() if kind.name in QUICK or kind.side is Side.PLANT else pytest.mark.slow)
    for kind in VIRTUAL
]


@pytest.mark.parametrize("kind", EACH)
def test_each_fault_acts_from_its_time_on(scenario, clean, kind):
    values = dict(kind.usual_values) | {"for_s": 0.15}
    values |= {"share": 1.0} if "share" in values else {}
    values |= {"delay_s": 0.2} if kind.lead else {}
    found, start_ns = frames_of(scenario, kind.on(at_s=AT_S, seed=5, values=values))
    ticks = sorted(set(clean[0]) | set(found))
    (first_ns, _), *_ = [tick for tick in ticks if clean[0].get(tick) != found.get(tick)]
    begin_ns = start_ns + round(AT_S * 1e9)
    # what is lost on the way in, and what befalls the car, shows in what is sent a little later
    assert begin_ns <= first_ns <= begin_ns + (120_000_000 if kind.side in INDIRECT else 2 * TICK_NS)


def test_a_fault_of_a_scenario_is_the_same_as_one_that_is_armed(scenario, tmp_path):
    path = tmp_path / "faulty.toml"
    path.write_text(
        BLENDED
        + SCENARIO
        + f'[[faults]]\nfault = "bits_flipped"\non = "BRAKE_PEDAL"\nat_s = {AT_S}\nfor_s = 0.1\nseed = 9\nbits = 3\n'
    )
    armed = injection("bits_flipped", "BRAKE_PEDAL", at_s=AT_S, seed=9, for_s=0.1, bits=3)
    assert load_scenario(str(path)).faults == (armed,)
    assert frames_of(load_scenario(str(path))) == frames_of(scenario, armed)


def test_the_run_s_seed_decides_where_a_fault_has_none(scenario):
    faults = [injection("lost", "ALL", at_s=0.1, share=0.3)]
    one, same, other = (simulate(scenario, seed, faults=faults) for seed in (1, 1, 2))
    sent = [signals.get("BRAKE_PEDAL.PEDAL_TRAVEL_1")[0].tolist() for signals in (one, same, other)]
    assert sent[0] == sent[1] != sent[2]


def test_two_faults_at_once_and_one_from_the_first_tick_on(scenario):
    late = injection("process_late", "ECU", at_s=FROM_THE_FIRST_TICK, for_s=0.2)
    found, _ = frames_of(scenario, late, injection("silent", "WHEEL_SPEED_FRONT", at_s=0.2, for_s=0.1))
    first = min(now for (now, member), frames in found.items() if member == 1 and frames)
    assert first == 205_000_000
    speed = spec_of(BrakePedal).can_id, 0xC0
    sent = [{f.can_id for f in frames} for (_, member), frames in sorted(found.items()) if member == 0]
    assert sum(speed[0] in ids and speed[1] not in ids for ids in sent) == 10


@pytest.fixture
def session(tmp_path):
    session = Session(virtual_run, tmp_path, "faults")
    yield session
    session.stop()


def test_a_session_arms_and_clears(session):
    session.drive("20 m/s")
    session.run(0.2)
    armed = session.inject("silent", on="BRAKE_PEDAL", after=0.1)
    assert armed.expected.detect_ms == 40.0
    assert session.fault_s == pytest.approx(session.time_s + 0.11)
    session.run(0.2)
    before = session.count(BrakePedal)
    session.run(0.1)
    assert session.count(BrakePedal) == before
    armed.clear()
    session.run(0.1)
    assert session.count(BrakePedal) == pytest.approx(before + 10, abs=1)


def test_a_fault_lasts_as_long_as_its_block_and_a_cleared_one_never_comes(session):
    session.drive("20 m/s")
    with session.inject("motor_dead", wheel="fl"):
        session.run(0.1)
        assert session.latest(MotorStatusFront).fault_fl is MotorState.FAILED
    session.run(0.1)
    assert session.latest(MotorStatusFront).fault_fl is MotorState.OK
    session.inject("motor_dead", wheel="fl", after=0.2, for_s=0.8, on_s=0.1, off_s=0.1)
    session.clear("motor_dead", wheel="fl", after=0.1)
    session.run(0.5)
    assert session.latest(MotorStatusFront).fault_fl is MotorState.OK


def test_pads_of_one_wheel_are_halved_or_as_asked_and_well_again_at_the_end(session):
    session.drive("20 m/s")
    session.pedal(0.5)
    session.run(1.0)
    well, _, rear, _ = session.latest(TruthPadFriction)
    with session.inject("pad_friction", wheel="fl"):
        session.run(0.1)
        now = session.latest(TruthPadFriction)
        assert (now[0], now[2]) == (pytest.approx(0.5 * well, rel=0.02), pytest.approx(rear, rel=0.02))
    session.inject("pad_friction", wheel="fl,rl", factor=0.8, for_s=0.1)
    session.run(0.08)
    now = session.latest(TruthPadFriction)
    assert (now[0], now[2]) == (pytest.approx(0.8 * well, rel=0.02), pytest.approx(0.8 * rear, rel=0.02))
    session.run(0.1)
    assert session.latest(TruthPadFriction)[0] == pytest.approx(well, rel=0.02)


def test_an_armed_fault_may_be_handed_over(session):
    session.drive("20 m/s")
    session.inject(injection("signal_value", "BRAKE_PEDAL.PEDAL_TRAVEL_1", value=0.5, for_s=0.1))
    session.run(0.06)
    assert session.latest(BrakePedal).pedal_travel_1 == 0.5
    session.run(0.1)
    assert session.latest(BrakePedal).pedal_travel_1 < 0.1
    assert session.signals.get("FAULT_SELECT.FAULT")[1].tolist() == [50.0]


@pytest.mark.parametrize(
    ("arm", "says"),
    [
        (lambda s: s.inject("silnt"), "did you mean 'silent'"),
        (lambda s: s.inject("silent", on="PEDAL"), "cannot be armed on 'PEDAL'"),
        (lambda s: s.inject("lost", on="ALL", sharre=0.1), "no parameter 'sharre'; did you mean 'share'"),
    ],
)
def test_a_session_refuses_what_cannot_be(session, arm, says):
    with pytest.raises(BrakebenchError, match=says):
        arm(session)
