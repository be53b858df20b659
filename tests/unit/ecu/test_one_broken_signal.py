"""One sensor or actuator lies with valid frames, in closed loop: what the driver gets, in virtual time and ticks."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from dbc.contract import spec_of
from dbc.messages import EhbPressureFront, EhbPressureRear, Fault, MotorDemandFront, MotorDemandRear
from ecu.law.types import Inputs
from ecu.node import EcuNode
from hil.bench.result import Signals, measure
from hil.bench.virtual import simulate
from hil.faults.catalogue import injection
from hil.scenario.effects import read_effects
from hil.scenario.scenario import Scenario, load_scenario, scenario_names
from plant.effects.catalogue import BUILT_IN

FRICTION, BLENDED = "stop72", "stop72_blend70"
MID_STOP_S = 2.5
OTHERS = Fault.BATTERY  # its first frame comes last
MOTOR_FAULTS = Fault.MOTOR_FRONT | Fault.MOTOR_REAR | Fault.MOTOR_TORQUE
MOTORS = (MotorDemandFront, MotorDemandRear)
Change = Callable[[Inputs, float], Inputs]


class LiedTo(EcuNode):
    """Our controller whose inputs a test changes from a time on, as if the sensors had said so."""

    def __init__(self, scenario: Scenario, change: Change | None, from_s: float, asked: Change | None = None) -> None:
        super().__init__(scenario.ecu)
        self._change, self._from_s, self._replaced = change, from_s, asked
        self._started_ns: int | None = None
        self.time_s = -1.0
        self.faults: list[tuple[float, Fault]] = []
        self.raised = 0

    def step(self, now_ns, inbox):
        """Time from 20 ticks after the first demands on: about that of the manoeuvre."""
        if self._started_ns is None and self.memory.modes.mode == 1:
            self._started_ns = now_ns + 100_000_000
        self.time_s = -1.0 if self._started_ns is None else (now_ns - self._started_ns) * 1e-9
        frames = super().step(now_ns, inbox)
        if self.time_s >= 0.0:
            self.faults.append((self.time_s, self.outputs.faults & ~OTHERS))
            self.raised |= self.memory.bits
        return frames

    def _inputs(self, now_ns):
        inputs = super()._inputs(now_ns)
        return self._change(inputs, self.time_s) if self._change and self.time_s >= self._from_s else inputs

    def _tell(self, now_ns, outputs):
        if self._replaced and self.time_s >= self._from_s:
            outputs = self._replaced(outputs, self.time_s)
        return super()._tell(now_ns, outputs)


class Stop(NamedTuple):
    """What a stop gave: distance, m; longest and largest lack and excess of deceleration; faults told, and when."""

    distance_m: float
    lack_s: float
    lack_mps2: float
    excess_mps2: float
    ticks: float | None
    told: Fault
    signals: Signals


def drive(name, change=None, from_s=MID_STOP_S, asked=None, dropped: Sequence[type] = ()) -> Stop:
    """Stop with a fault; frames of the types ``dropped`` are lost."""
    scenario = load_scenario(name)
    lost = [injection("silent", spec_of(t).name, at_s=from_s) for t in dropped]
    node = LiedTo(scenario, change, from_s, asked)
    signals = simulate(scenario, ecu=node, faults=lost)
    t, a = signals.get("TRUTH_MOTION.ACCELERATION")
    speed = signals.get("TRUTH_MOTION.SPEED")[1]
    td, demand = signals.get("BRAKE_STATUS.DEMANDED_DECELERATION")
    lack = np.nan_to_num(demand)[np.maximum(np.searchsorted(td, t, side="right") - 1, 0)] + a
    lack = lack[speed > 2.0]
    first = next((s for s, fault in node.faults if fault and s >= from_s), None)
    return Stop(
        measure(signals).stop_distance_m, 0.01 * int((lack > 1.0).sum()), lack.max(), -lack.min(),
        None if first is None else round((first - from_s) * 100), _any(fault for _, fault in node.faults), signals,
    )  # fmt: skip


def _any(faults) -> Fault:
    told = Fault.NONE
    for fault in faults:
        told |= fault
    return told


@cache
def healthy(name: str) -> Stop:
    return drive(name)


def put(field: str, index: int | None, value: Callable[[float, float], float]) -> Change:
    """Replace one value by a function of itself and of the time."""

    def change(inputs: Inputs, time_s: float) -> Inputs:
        now = getattr(inputs, field)
        if index is None:
            return inputs._replace(**{field: value(now, time_s)})
        return inputs._replace(**{field: (*now[:index], value(now[index], time_s), *now[index + 1 :])})

    return change


def all_currents(factor: float) -> Change:
    return lambda inputs, _: inputs._replace(motor_current_a=tuple(factor * i for i in inputs.motor_current_a))


def all_motors(function: Callable[[float], float]) -> Callable:
    return lambda outputs, _: outputs._replace(motor_demand_nm=tuple(map(function, outputs.motor_demand_nm)))


MOTOR_ROWS = {
    "demands lost from before braking": ({"dropped": MOTORS, "from_s": 0.2}, 69.0),
    "demands lost": ({"dropped": MOTORS}, 69.0),
    "demands of one axle lost": ({"dropped": MOTORS[:1]}, 68.0),
    "another sender asks for nothing": ({"asked": all_motors(lambda _: 0.0)}, 69.0),
    "another sender asks for half": ({"asked": all_motors(lambda nm: 0.5 * nm)}, 69.0),
    "current reads 0": ({"change": all_currents(0.0)}, 68.0),
    "current reads half": ({"change": all_currents(0.5)}, 68.0),
    "current of one motor reads +400 A": ({"change": put("motor_current_a", 0, lambda *_: 400.0)}, 67.5),
    "current of one motor reads -400 A": ({"change": put("motor_current_a", 2, lambda *_: -400.0)}, 67.5),
}


QUICK_ROWS = ("demands lost from before braking", "demands lost", "current reads 0")


@pytest.mark.parametrize(
    "row", [row if row in QUICK_ROWS else pytest.param(row, marks=pytest.mark.slow) for row in MOTOR_ROWS]
)
def test_friction_takes_over_from_motors_that_do_not_give_what_they_are_asked_for(row):
    keywords, most_m = MOTOR_ROWS[row]
    stop = drive(BLENDED, **keywords)
    print(f"{row}: {stop.distance_m:.1f} m, {stop.ticks} ticks, lack above 1 m/s2 for {stop.lack_s:.2f} s")
    assert healthy(BLENDED).distance_m - 1.0 < stop.distance_m < most_m  # 126 m and more without supervision
    assert stop.lack_s <= 0.15
    assert stop.told & MOTOR_FAULTS
    assert not stop.told & ~MOTOR_FAULTS


def test_friction_brakes_against_motors_that_drive():
    stop = drive(BLENDED, asked=all_motors(lambda _: 300.0))
    assert stop.distance_m < 73.0
    assert stop.ticks <= 8
    assert stop.lack_s <= 0.25


def test_a_failing_current_is_found_though_it_comes_and_goes():
    gone = put("motor_current_a", 0, lambda now, t: 0.0 if t % 0.3 < 0.02 else now)
    stop = drive(BLENDED, gone)
    assert stop.told == Fault.MOTOR_FRONT | Fault.MOTOR_TORQUE
    assert stop.ticks <= 60


def test_a_motor_is_tried_again_after_the_pedal_was_free_for_long_enough_never_before(normal_rig):
    car, retry_s = normal_rig.car, normal_rig.node.parameters.plausibility.motor_retry_s
    car.blending, car.follow = 0.7, lambda _: None  # its motors give nothing

    def asked_of_motors(ticks: int) -> bool:
        return any(normal_rig.step() and min(normal_rig.node.outputs.motor_demand_nm) < 0.0 for _ in range(ticks))

    normal_rig.step(30)
    assert normal_rig.node.outputs.faults & Fault.MOTOR_FRONT
    assert not asked_of_motors(round(150 * retry_s))  # within the same braking
    car.pedal = (0.0, 0.0)
    normal_rig.step(round(100 * retry_s) - 20)
    car.pedal = (0.6, 0.6)
    assert not asked_of_motors(20)
    car.pedal = (0.0, 0.0)
    normal_rig.step(30)
    car.pedal = (0.6, 0.6)
    assert asked_of_motors(5)
    normal_rig.step(10)
    assert normal_rig.node.outputs.faults & Fault.MOTOR_FRONT


@pytest.mark.parametrize("on_off_s", [None, 0.3])
def test_no_wheel_speed_releases_pressure(on_off_s):
    def fast(now: float, t: float) -> float:
        return now if on_off_s and int(t / on_off_s) % 2 else 300.0

    stop = drive(BLENDED, put("wheel_speed_rad_s", 0, fast), from_s=1.5)
    well = healthy(BLENDED)
    for name in ("EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "EHB_DEMAND_REAR.PRESSURE_DEMAND_RL"):
        asked, as_well = stop.signals.get(name)[1], well.signals.get(name)[1]
        n = min(len(asked), len(as_well)) - 100  # the last second may end a tick apart
        braking = np.nan_to_num(as_well[:n]) > 2e5
        assert (asked[:n][braking] / as_well[:n][braking]).min() > 0.93
    assert stop.distance_m == pytest.approx(well.distance_m, abs=0.3)
    assert stop.told == Fault.WHEEL_SPEED_FRONT
    assert stop.ticks <= (3 if on_off_s is None else 65)


@pytest.mark.parametrize(
    "lost",
    [
        (EhbPressureFront,),
        pytest.param((EhbPressureRear,), marks=pytest.mark.slow),
        pytest.param((EhbPressureFront, EhbPressureRear), marks=pytest.mark.slow),
    ],
)
def test_estimates_stand_without_the_pressures_they_need(lost):
    stop = drive(FRICTION, dropped=lost, from_s=2.0)
    assert stop.distance_m == pytest.approx(healthy(FRICTION).distance_m, abs=1.5)
    assert stop.excess_mps2 < 0.35
    for end in ("FL", "FR"):
        t, mu = stop.signals.get(f"BRAKE_ESTIMATE_FRONT.PAD_FRICTION_{end}")
        assert np.ptp(mu[t > t[-1] - 3.0]) == 0.0


@pytest.mark.parametrize(
    "size", [-1.0, 3.0, *[pytest.param(size, marks=pytest.mark.slow) for size in (-5.0, -2.0, 1.5)]]
)
def test_a_wrong_acceleration_is_found_before_it_is_learned_from(size):
    stop = drive(FRICTION, put("acceleration_x_mps2", None, lambda now, _: now + size), from_s=0.2)
    assert stop.told == Fault.BODY_MOTION
    assert stop.distance_m == pytest.approx(healthy(FRICTION).distance_m, abs=2.5)


def test_a_pedal_channel_that_spikes_in_one_frame_of_five_is_not_followed():
    counted = iter(range(10_000))
    stop = drive(BLENDED, put("pedal_1", None, lambda now, _: now if next(counted) % 5 else 1.0))
    assert stop.told == Fault.PEDAL_1 | Fault.PEDAL_DISAGREE
    assert stop.ticks <= 16
    assert stop.distance_m == pytest.approx(healthy(BLENDED).distance_m, abs=0.2)


CHANNELS = {
    "wheel": ("wheel_speed_rad_s", (0, 3), (20.0, 200.0), Fault.WHEEL_SPEED_FRONT | Fault.WHEEL_SPEED_REAR),
    "pressure": ("pressure_pa", (0, 3), (5e5, 50e5), Fault.EHB_PRESSURE_FRONT | Fault.EHB_PRESSURE_REAR),
    "current": ("motor_current_a", (0, 3), (60.0, -300.0), MOTOR_FAULTS),
    "acceleration": ("acceleration_x_mps2", (None,), (3.0, -5.0), Fault.BODY_MOTION),
    "pedal": ("pedal_2", (None,), (0.3, -0.3), Fault.PEDAL_2 | Fault.PEDAL_DISAGREE),
}


def broken(kind: str, size: float) -> Callable[[float, float], float]:
    """A signal of a kind of fault; ``stuck`` keeps its first value."""
    rng, kept = np.random.default_rng(1), []

    def value(now: float, t: float) -> float:
        kept.append(now)
        return {
            "step": size,
            "offset": now + size,
            "stuck": kept[0],
            "spike": now + size * (len(kept) % 5 == 0),
            "noise": now + size * float(rng.normal()),
            "on_off": now + size * (int(t / 0.3) % 2),
            "gain": 1.5 * now,
        }[kind]

    return value


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["step", "offset", "stuck", "spike", "noise", "on_off", "gain"])
@pytest.mark.parametrize("channel", CHANNELS)
def test_each_fault_names_its_own_sensor_or_none(channel, kind):
    field, indices, sizes, own = CHANNELS[channel]
    for index, size, from_s in {
        (indices[0], sizes[0], 0.3),
        (indices[0], sizes[1], MID_STOP_S),
        (indices[-1], sizes[1], 0.3),
    }:
        stop = drive(BLENDED, put(field, index, broken(kind, size)), from_s=from_s)
        assert not stop.told & ~own, (channel, index, kind, size, from_s, stop.told)
        assert stop.distance_m < 1.1 * healthy(BLENDED).distance_m, (channel, index, kind, size, from_s)


def raised(scenario: Scenario) -> tuple[int, tuple[int, ...]]:
    """What the checks found, and whether anything the observer or the pedal found."""
    node = LiedTo(scenario, None, 1e9)
    own = [0, 0, 0]

    def look(step) -> None:
        if step.member == 1:
            known = node.memory.estimates
            own[0] |= any(known.implausible)
            own[1] |= known.stuck
            own[2] |= max(node.memory.pedal.levels) > 0.0

    simulate(scenario, ecu=node, each_tick=look)
    return node.raised, tuple(own)


QUICK = ("stop72_blend70", "mu_split", "mu_jump")


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in scenario_names()]
)
def test_no_library_scenario_raises_anything(name):
    assert raised(load_scenario(name)) == (0, (0, 0, 0))


SENSOR_FAULTS = {"wrong_scale", "quantisation", "speed_scale"}  # wheels in another unit; coarse values repeat; not here


@pytest.mark.slow
@pytest.mark.parametrize("name", [e.name for e in BUILT_IN if e.name not in SENSOR_FAULTS])
def test_no_effect_of_typical_size_is_taken_for_a_fault(name):
    effects = read_effects({name: {}}, name)
    assert raised(dataclasses.replace(load_scenario(BLENDED), effects=effects)) == (0, (0, 0, 0))
