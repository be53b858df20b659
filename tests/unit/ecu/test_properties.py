"""Whatever comes in: nothing non-finite or out of range goes out, and no fault releases the brake."""

import math

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dbc.contract import contract, spec_of
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakeMode, EhbDemandFront, EhbDemandRear
from ecu.law import base_brake, friction
from ecu.law.step import initial_memory, step
from ecu.law.trouble_codes import consequence
from ecu.law.types import Brake, Health, Inputs, Source
from ecu.node import SOURCES, EcuNode

TICK_NS = 10_000_000
RELAXED = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])


def values(low, high):
    """Plausible values, the ends of the wire's range, and not available."""
    return st.one_of(st.floats(low, high), st.sampled_from([low, high, 0.0, math.nan]))


def four(low, high):
    return st.tuples(*[values(low, high)] * 4)


inputs = st.builds(
    Inputs,
    pedal_1=values(0.0, 1.0),
    pedal_2=values(0.0, 1.0),
    wheel_speed_rad_s=four(-300.0, 300.0),
    acceleration_x_mps2=values(-30.0, 30.0),
    acceleration_y_mps2=values(-30.0, 30.0),
    yaw_rate_rad_s=values(-3.2, 3.2),
    pressure_pa=four(-5e5, 2.5e7),
    brake=st.tuples(*[st.sampled_from(list(Brake))] * 2),
    motor_current_a=four(-400.0, 400.0),
    motor_available_nm=four(0.0, 2000.0),
    motor_failed=st.tuples(*[st.booleans()] * 4),
    steering_wheel_angle_rad=values(-15.0, 15.0),
    charge_power_w=values(0.0, 3e5),
    blending_factor=values(0.0, 1.0),
    link_down=st.booleans(),
    health=st.tuples(
        *[
            st.builds(
                Health,
                st.sampled_from([0.0, 0.01, 0.05, math.inf]),
                st.booleans(),
                st.integers(0, 6),
                *[st.sampled_from([0, 0, 0, 1])] * 3,
            )
        ]
        * len(Source)
    ),
)


def with_torque(inputs, memory):
    """Motor currents as they were asked for in the last step, where they are there at all."""
    asked = [0.0 if math.isnan(nm) else nm / 1.75 for nm in memory.asked_nm]
    present = [math.nan if math.isnan(i) else a for i, a in zip(inputs.motor_current_a, asked, strict=True)]
    return inputs._replace(motor_current_a=tuple(present))


def check_outputs(o, p):
    silent = [math.isnan(q) for q in o.pressure_demand_pa]
    assert all(silent) or not any(silent)
    if any(silent):
        assert o.mode in (BrakeMode.INIT, BrakeMode.SAFE_STOP)
    for q in o.pressure_demand_pa:
        assert math.isnan(q) or 0.0 <= q <= p.friction_brake.pressure_max_pa
    for t in o.motor_demand_nm:
        assert (math.isnan(t) and o.mode == BrakeMode.INIT) or -p.motor.torque_max_nm <= t <= 0.0
    if o.mode in (BrakeMode.FRICTION_ONLY, BrakeMode.SAFE_STOP):
        assert all(t == 0.0 for t in o.motor_demand_nm)
    assert 0.0 <= o.blending_factor <= 1.0 + 1e-9
    assert all(0 <= c <= 7 for c in o.confidence)
    assert all(math.isfinite(mu) and 0.0 < mu <= 1.2 for mu in o.pad_friction)
    assert not any(math.isinf(t) for t in o.wheel_torque_nm)


@RELAXED
@given(
    sequence=st.lists(st.tuples(inputs, st.integers(1, 30)), min_size=1, max_size=12), mode=st.sampled_from(BrakeMode)
)
def test_no_input_sequence_gives_an_output_out_of_range(parameters, sequence, mode):
    memory = initial_memory(parameters)
    memory = memory._replace(modes=memory.modes._replace(mode=mode))
    for values_now, ticks in sequence:
        for _ in range(ticks):
            memory, outputs = step(memory, values_now, parameters, 0.01)
            check_outputs(outputs, parameters)
    assert np.all(np.isfinite(memory.observer))


@settings(RELAXED, max_examples=20)
@given(
    sequence=st.lists(st.tuples(inputs, st.integers(1, 25)), min_size=1, max_size=12), mode=st.sampled_from(BrakeMode)
)
def test_no_degradation_without_an_active_code(parameters, sequence, mode):
    """The mode never gets worse than an active code's reaction; it stays worse only while the upgrade waits."""
    memory = initial_memory(parameters)
    memory = memory._replace(modes=memory.modes._replace(mode=mode))
    for values_now, ticks in sequence:
        for _ in range(ticks):
            before = memory.modes.mode
            memory, outputs = step(memory, values_now, parameters, 0.01)
            if outputs.mode == BrakeMode.INIT:
                continue
            active = [trouble.code for trouble in memory.troubles.troubles if trouble.active]
            allowed = max([code.reaction for code in active], default=BrakeMode.NORMAL)
            assert outputs.mode >= allowed
            assert outputs.mode == allowed or outputs.mode <= before
            assert bool(outputs.faults) == bool(active)
            assert consequence(memory.troubles.active) == (allowed, outputs.faults)


@RELAXED
@given(
    lost=st.sets(st.sampled_from([s for s in Source if s is not Source.PEDAL]), min_size=1),
    missing=st.booleans(),
    factor=st.sampled_from([0.0, 0.3, 0.7, 1.0]),
    pedal=st.floats(0.15, 0.7),
    channel=st.sampled_from([None, 1, 2]),
)
def test_losing_anything_never_lowers_the_pressure_demand(
    parameters, good_inputs, lost, missing, factor, pedal, channel
):
    normal = good_inputs._replace(blending_factor=factor, pedal_1=pedal, pedal_2=pedal)
    memory = initial_memory(parameters)
    for _ in range(40):
        memory, before = step(memory, with_torque(normal, memory), parameters, 0.01)
    assert before.mode == BrakeMode.NORMAL
    broken = normal
    if missing:
        nan4 = (math.nan,) * 4
        fields = {
            Source.WHEEL_SPEED_FRONT: {"wheel_speed_rad_s": (math.nan, math.nan, *normal.wheel_speed_rad_s[2:])},
            Source.WHEEL_SPEED_REAR: {"wheel_speed_rad_s": (*normal.wheel_speed_rad_s[:2], math.nan, math.nan)},
            Source.BODY_MOTION: {"acceleration_x_mps2": math.nan, "yaw_rate_rad_s": math.nan},
            Source.EHB_PRESSURE_FRONT: {"pressure_pa": nan4},
            Source.EHB_PRESSURE_REAR: {"brake": (Brake.DEMAND, Brake.FAILED)},
            Source.MOTOR_FRONT: {"motor_current_a": nan4},
            Source.MOTOR_REAR: {"motor_failed": (True,) * 4},
            Source.STEERING: {"steering_wheel_angle_rad": math.nan},
            Source.BATTERY: {"charge_power_w": math.nan},
        }
        for source in lost:
            broken = broken._replace(**fields[source])
    else:
        health = tuple(Health(1.0, False, 0) if s in lost else h for s, h in enumerate(normal.health))
        broken = broken._replace(health=health)
    if channel is not None:
        broken = broken._replace(**{f"pedal_{channel}": math.nan})
    for _ in range(30):
        memory, after = step(memory, with_torque(broken, memory), parameters, 0.01)
        for a, b in zip(after.pressure_demand_pa, before.pressure_demand_pa, strict=True):
            assert a >= b - 0.01 * b - 1.0


@RELAXED
@given(hold_ticks=st.integers(0, 19), pedal=st.floats(0.2, 1.0))
def test_without_pedal_the_pressure_stands(parameters, good_inputs, hold_ticks, pedal):
    normal = good_inputs._replace(pedal_1=pedal, pedal_2=pedal)
    memory = initial_memory(parameters)
    for _ in range(40):
        memory, before = step(memory, normal, parameters, 0.01)
    for _ in range(hold_ticks):
        memory, after = step(memory, normal._replace(pedal_1=math.nan, pedal_2=math.nan), parameters, 0.01)
        for a, b in zip(after.pressure_demand_pa, before.pressure_demand_pa, strict=True):
            assert a >= 0.99 * b


def anything(low, high):
    """Whatever a float can be, mostly what it should."""
    return st.one_of(st.floats(low, high), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1e300, -1e300]))


def four_of_anything(low, high):
    return st.tuples(*[anything(low, high)] * 4)


broken_inputs = st.builds(
    Inputs,
    pedal_1=anything(0.0, 1.0),
    pedal_2=anything(0.0, 1.0),
    wheel_speed_rad_s=four_of_anything(0.0, 300.0),
    acceleration_x_mps2=anything(-30.0, 30.0),
    acceleration_y_mps2=anything(-30.0, 30.0),
    yaw_rate_rad_s=anything(-3.2, 3.2),
    pressure_pa=four_of_anything(-5e5, 2.5e7),
    brake=st.just((Brake.DEMAND, Brake.DEMAND)),
    motor_current_a=four_of_anything(-400.0, 400.0),
    motor_available_nm=four_of_anything(0.0, 2000.0),
    motor_failed=st.tuples(*[st.booleans()] * 4),
    steering_wheel_angle_rad=anything(-15.0, 15.0),
    charge_power_w=anything(0.0, 3e5),
    blending_factor=st.just(0.0),
    link_down=st.booleans(),
    health=st.just((Health(0.0, True, 0),) * len(Source)),
)


@settings(RELAXED, max_examples=25)
@given(
    sequence=st.lists(st.tuples(broken_inputs, st.integers(1, 20)), min_size=1, max_size=6), factor=anything(0.0, 1.0)
)
def test_whatever_the_sensors_say_the_brake_gives_what_both_pedal_channels_ask(parameters, sequence, factor):
    """Without motors the pressure is at least what the lower channel asks for; with them nothing is out of range."""
    p = parameters
    gains = friction.gains(p.friction_brake)
    for blending in (0.0, factor):
        memory = initial_memory(p)
        for values_now, ticks in sequence:
            for _ in range(ticks):
                memory, o = step(memory, values_now._replace(blending_factor=blending), p, 0.01)
                check_outputs(o, p)
                channels = values_now.pedal_1, values_now.pedal_2
                if blending != 0.0 or math.isnan(o.pressure_demand_pa[0]) or not all(map(math.isfinite, channels)):
                    continue
                mass = p.vehicle.mass_kg * memory.estimates.mass_factor
                drag = base_brake.driving_resistance(p.plausibility.speed_max_mps, mass, p.vehicle)
                asked = base_brake.reference_deceleration(min(channels), p.pedal)
                torque = base_brake.distribute(
                    base_brake.brake_torque(asked, drag, mass, p.vehicle), p.friction_brake.front_share
                )
                least = friction.pressure_demands(torque, memory.friction, gains, p.friction_brake)
                assert all(a >= b - 1.0 for a, b in zip(o.pressure_demand_pa, least, strict=True))
        assert np.all(np.isfinite(memory.observer))


noise_frames = st.builds(
    Frame,
    st.sampled_from(list(BusName)),
    st.one_of(st.sampled_from([spec_of(t).can_id for t in SOURCES]), st.integers(0, 0x7FF)),
    st.binary(max_size=8),
    st.just(0),
    st.booleans(),
)
events = st.builds(LinkEvent, st.sampled_from(list(BusName)), st.sampled_from(list(LinkState)))


@RELAXED
@given(
    script=st.lists(st.lists(st.one_of(noise_frames, events), max_size=4), min_size=1, max_size=40), seed=st.integers()
)
def test_any_frames_give_valid_bytes_and_the_same_bytes_again(parameters, script, seed):
    """Well-formed messages of random values, hostile frames and link events between them."""
    rng = np.random.default_rng(abs(seed))
    sender = Transmitter()
    own = contract(BusName.VEHICLE).by_id
    first, second = EcuNode(parameters), EcuNode(parameters)
    for tick, extra in enumerate(script):
        now = tick * TICK_NS
        inbox = [*sender.frames(now, [_random_message(t, rng) for t in SOURCES]), *extra]
        sent = first.step(now, list(inbox))
        assert sent == second.step(now, list(inbox))
        for frame in sent:
            if frame.bus is BusName.VEHICLE:
                spec = own[frame.can_id]
                assert len(frame.data) == spec.length
                for value in spec.decode(frame.data):
                    assert value is None or math.isfinite(value)
                if spec.type in (EhbDemandFront, EhbDemandRear):
                    assert all(
                        q is None or q <= parameters.friction_brake.pressure_max_pa + 1e3
                        for q in spec.decode(frame.data)
                    )


def _random_message(message_type, rng):
    spec = spec_of(message_type)
    drawn = []
    for field in spec.fields:
        if field.enum is not None:
            drawn.append(rng.choice(list(field.enum)))
        elif rng.random() < 0.1:
            drawn.append(None)
        else:
            drawn.append(float(rng.uniform(field.minimum, field.maximum)) * field.si_per_unit)
    return message_type(*drawn)
