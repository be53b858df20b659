import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant.effects.sensing.catalogue import SENSING
from plant.injection.sensing_chain import Chain
from plant.injection.theta import THETA
from plant.signals import CHANNELS

TIME_S = np.arange(200) * 0.01
WIDTH = {node: len(names) for node, names in CHANNELS.items()} | {"driver": 2}
CASES = [(effect.name, node) for effect in SENSING for node in effect.nodes]


def signal(node, seed=3):
    rng = np.random.default_rng(seed)
    smooth = np.cumsum(rng.standard_normal((len(TIME_S), WIDTH[node])), axis=0)
    base = 3.0 if node == "wheel" else 20.0
    return base + smooth if node != "pressure" else 1e6 + 1e5 * smooth


@pytest.mark.parametrize(("name", "node"), CASES)
def test_sample_by_sample_is_the_same_as_all_at_once(name, node):
    theta, values = THETA.typical(name), signal(node)
    at_once = Chain(theta).sense(node, TIME_S, values)
    chain = Chain(theta)
    one_by_one = [chain.sense(node, TIME_S[k : k + 1], values[k : k + 1])[0] for k in range(len(TIME_S))]
    np.testing.assert_allclose(one_by_one, at_once, rtol=1e-12, atol=1e-12)
    assert not np.array_equal(at_once, values)


@pytest.mark.parametrize(("name", "node"), CASES)
def test_the_future_does_not_matter(name, node):
    values = signal(node)
    other = values.copy()
    other[120:] += 3.0
    first, second = (Chain(THETA.typical(name)).sense(node, TIME_S, v) for v in (values, other))
    np.testing.assert_array_equal(first[:120], second[:120])


@pytest.mark.parametrize(("name", "node"), [(n, k) for n, k in CASES if THETA.effect(n).undo is not None])
def test_undone_where_it_says_so(name, node):
    chain, values = Chain(THETA.typical(name)), signal(node)
    back = chain.undo(node, TIME_S, chain.sense(node, TIME_S, values))
    inside = slice(20, 170)  # shifts lose the ends
    tolerance = 1e-9 if name not in ("timestamp_offset", "clock_drift") else 1.0 * np.abs(np.diff(values, axis=0)).max()
    np.testing.assert_allclose(back[inside], values[inside], rtol=1e-9, atol=tolerance)


@pytest.mark.parametrize("name", [effect.name for effect in SENSING if effect.undo is None and "imu" in effect.nodes])
def test_what_has_no_inverse_leaves_the_others_taken_back(name):
    """A late node with coarse steps too: else a step of any fineness moves all that the plant is driven by."""
    late = THETA.set(THETA.neutral(), "timestamp_offset", {"delay_s": {"imu": 0.03}})
    both = late + THETA.typical(name) - THETA.neutral()
    reported = signal("imu")
    np.testing.assert_array_equal(Chain(both).undo("imu", TIME_S, reported), Chain(late).undo("imu", TIME_S, reported))
    assert not np.array_equal(Chain(late).undo("imu", TIME_S, reported), reported)


@settings(max_examples=40)
@given(st.floats(-0.05, 0.1), st.integers(0, 2**16))
def test_a_delay_shifts(delay_s, seed):
    theta = THETA.set(THETA.neutral(), "timestamp_offset", {"delay_s": {"imu": delay_s}})
    values = signal("imu", seed)
    shifted = Chain(theta).sense("imu", TIME_S, values)
    expected = np.interp(TIME_S[20:] - delay_s, TIME_S, values[:, 0])
    np.testing.assert_allclose(shifted[20:, 0], expected, rtol=1e-9)


@settings(max_examples=40)
@given(st.floats(1e-5, 0.1))
def test_a_low_pass_delays_a_ramp_by_its_lag(lag_s):
    theta = THETA.set(THETA.neutral(), "imu_filter", {"time_s": lag_s})
    ramp = np.tile(TIME_S[:, None], WIDTH["imu"])
    slow = Chain(theta).sense("imu", TIME_S, ramp)
    settled = 15.0 * lag_s < TIME_S
    np.testing.assert_allclose(slow[settled], ramp[settled] - lag_s, atol=1e-5 * lag_s)


def test_nothing_on_nothing_touched():
    chain, values = Chain(THETA.neutral()), signal("wheel")
    assert chain.sense("wheel", TIME_S, values) is values
    assert not chain.touches("wheel")


@pytest.mark.parametrize("step", [5e-324, 1e-300, 1e-18])
def test_a_step_finer_than_a_float_leaves_the_value(step):
    """The quotient overflowed."""
    theta = THETA.neutral()
    for parameter in THETA.effect("quantisation").parameters:
        theta[THETA.slice("quantisation", parameter.name)] = step
    told = signal("imu")
    assert np.array_equal(Chain(theta).sense("imu", TIME_S, told), told)
