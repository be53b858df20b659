"""Bad, foreign and old frames against the controller in the closed loop: modes, codes, and where the car stops."""

import numpy as np
import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakeMode, BrakePedal, Fault, WheelSpeedFront
from hil.bench.result import measure
from hil.bench.virtual import own_nodes, simulate
from hil.faults.catalogue import injection
from hil.scenario.scenario import load_scenario

BRAKING = 300  # tick in which it begins: 1.9 s into the stop at full pedal
BRAKING_S = 1.9
SLOW = pytest.mark.slow
PEDAL, FRONT_SPEED = spec_of(BrakePedal).can_id, spec_of(WheelSpeedFront).can_id


class Heard:
    """A controller whose inbox is altered."""

    def __init__(self, node, alter):
        self._node, self._alter, self._tick = node, alter, 0

    def step(self, now_ns, inbox):
        self._tick += 1
        return self._node.step(now_ns, self._alter(self._tick, list(inbox)))


class Stop:
    """A stop with an altered inbox."""

    def __init__(self, alter=lambda tick, inbox: inbox, **shares):
        scenario = load_scenario("stop72_blend70")
        faults = [injection(name, "ALL", share=share) for name, share in shares.items()]
        _, ecu = own_nodes(scenario, 1)
        signals = simulate(scenario, ecu=Heard(ecu, alter), faults=faults)
        self.codes = {trouble.code.name: trouble for trouble in ecu.trouble_codes}
        time_s, modes = signals.get("BRAKE_STATUS.MODE")
        self.modes = [BrakeMode(int(m)) for m in modes[time_s > 0.0]]
        self.faults = int(np.bitwise_or.reduce(signals.get("BRAKE_STATUS.ACTIVE_FAULTS")[1][time_s > 0.0].astype(int)))
        self.distance_m = measure(signals).stop_distance_m
        time_s, pressure = signals.get("EHB_PRESSURE_FRONT.PRESSURE_FL")
        at = np.flatnonzero((time_s >= BRAKING_S) & (time_s < 5.0))
        self.least_pressure = pressure[at].min() / pressure[at[0]]
        print(
            f"{self.distance_m:.2f} m, worst {max(self.modes).name}, least {self.least_pressure:.3f}, {[*self.codes]}"
        )


def of(item, can_id):
    return isinstance(item, Frame) and item.bus is BusName.VEHICLE and can_id in (None, item.can_id)


@pytest.fixture(scope="module")
def nominal():
    stop = Stop()
    assert stop.codes == {}
    assert set(stop.modes) == {BrakeMode.NORMAL}
    assert stop.distance_m == pytest.approx(66.2, abs=0.1)
    return stop


def second_pedal(offset, first=False):
    """A sender of a released pedal beside the real one, its counter ahead by ``offset``."""

    def alter(tick, inbox):
        out = []
        for item in inbox:
            out.append(item)
            if tick > BRAKING and of(item, PEDAL):
                fake = item._replace(data=encode(BrakePedal(0.0, 0.0), (item.data[1] % 16 + offset) % 15))
                out.insert(len(out) - first, fake)
        return out

    return alter


@pytest.mark.parametrize(
    ("offset", "first"),
    [
        (0, False),
        (1, False),
        *[pytest.param(*case, marks=SLOW) for case in ((0, True), (1, True), (3, False), (9, False))],
    ],
)
def test_a_second_pedal_sender_never_releases_the_brake(nominal, offset, first):
    stop = Stop(second_pedal(offset, first))
    assert list(stop.codes) == ["pedal_second_sender"]
    assert stop.codes["pedal_second_sender"].active
    assert stop.modes[-1] == BrakeMode.SAFE_STOP
    assert stop.faults == Fault.PEDAL_1 | Fault.PEDAL_2 | Fault.COMMUNICATION
    assert stop.distance_m < nominal.distance_m + 2.5  # friction alone, by the brake's own pedal map
    assert stop.least_pressure > 0.9


@pytest.mark.parametrize("late", [200, pytest.param(7, marks=SLOW)])
def test_replayed_pedal_frames_are_not_used(nominal, late):
    heard = []

    def alter(tick, inbox):
        heard.append([item for item in inbox if of(item, PEDAL)])
        return inbox if tick <= BRAKING else [i for i in inbox if not of(i, PEDAL)] + heard[-1 - late]

    stop = Stop(alter)
    assert list(stop.codes) == ["pedal_out_of_time"]
    assert stop.modes[-1] == BrakeMode.SAFE_STOP
    assert stop.distance_m < nominal.distance_m + 2.5
    assert stop.least_pressure > 0.9


def corrupted(when, can_id=None):
    def alter(tick, inbox):
        bad = tick > BRAKING and when(tick - BRAKING)
        flip = bytes([0x55] + [0] * 7)
        return [
            i._replace(data=bytes(a ^ b for a, b in zip(i.data, flip, strict=True))) if bad and of(i, can_id) else i
            for i in inbox
        ]

    return alter


def test_two_of_three_frames_of_every_id_corrupt_for_ever(nominal):
    stop = Stop(corrupted(lambda n: n % 3))
    assert stop.modes[-1] == BrakeMode.FRICTION_ONLY
    assert {name for name in stop.codes if name.endswith("_corrupt")} == set(stop.codes)
    assert len(stop.codes) == 10
    assert all(trouble.active and trouble.occurrences == 1 for trouble in stop.codes.values())
    assert stop.distance_m == pytest.approx(nominal.distance_m, abs=0.7)


def test_five_corrupt_frames_in_a_row_have_their_code_and_heal(nominal):
    stop = Stop(corrupted(lambda n: n <= 5, FRONT_SPEED))
    assert list(stop.codes) == ["wheel_speed_front_lost", "wheel_speed_front_corrupt"]
    assert max(stop.modes) == BrakeMode.FRICTION_ONLY
    assert stop.faults == Fault.WHEEL_SPEED_FRONT | Fault.COMMUNICATION
    assert not any(trouble.active for trouble in stop.codes.values())
    assert stop.modes[-1] == BrakeMode.NORMAL
    assert stop.distance_m == pytest.approx(nominal.distance_m, abs=0.3)


@pytest.mark.slow
def test_one_frame_in_five_corrupt_changes_nothing(nominal):
    stop = Stop(corrupted(lambda n: n % 5 == 0))
    assert stop.codes == {}
    assert set(stop.modes) == {BrakeMode.NORMAL}


@pytest.mark.parametrize(
    "faults",
    [{"late": 0.1}, *[pytest.param(one, marks=SLOW) for one in ({"lost": 0.01}, {"doubled": 0.3}, {"stale": 0.02})]],
)
def test_moderate_faults_of_frames_flip_nothing(nominal, faults):
    stop = Stop(**faults)
    assert stop.codes == {}
    assert set(stop.modes) == {BrakeMode.NORMAL}


@pytest.mark.slow
def test_many_lost_frames_are_lost_frames_and_nothing_else(nominal):
    stop = Stop(lost=0.2)
    assert not [name for name in stop.codes if name.endswith(("_corrupt", "_second_sender", "_out_of_time"))]
    assert not stop.faults & Fault.COMMUNICATION
    assert stop.distance_m < nominal.distance_m + 2.0
