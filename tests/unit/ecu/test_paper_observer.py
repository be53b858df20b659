import math

import numpy as np
import pytest

from ecu.law import paper_observer as paper
from ecu.law.estimator import paper_parameters

RADIUS, INERTIA, DT = 0.308, 1.5, 0.01
Q = np.array([0.0, 9.0, 1600.0, 2.0e4])
R = np.array([0.01, 3600.0])


def matrices():
    """Transition and measurement of all 16 states, eqs. (8a) to (8d) and (6), in the paper's order of states."""
    one = np.array(
        [
            [1.0, DT, 0.0, 0.0],
            [0.0, 0.0, -RADIUS / INERTIA, 1.0 / INERTIA],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    seen = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return np.kron(np.eye(4), one), np.kron(np.eye(4), seen)


def test_the_sixteen_states_are_observable():
    a, h = matrices()
    blocks = [h @ np.linalg.matrix_power(a, k) for k in range(16)]
    assert np.linalg.matrix_rank(np.vstack(blocks)) == 16


def test_torque_is_not_observable_without_the_virtual_force_sensor():
    a, h = matrices()
    h = h[::2]
    assert np.linalg.matrix_rank(np.vstack([h @ np.linalg.matrix_power(a, k) for k in range(16)])) < 16


def test_four_small_filters_equal_the_dense_one():
    rng = np.random.default_rng(1)
    a, h = matrices()
    q, r = np.kron(np.eye(4), np.diag(Q)), np.diag(np.tile(R, 4))
    x, p = rng.normal(size=16), np.eye(16) * 10.0
    mine, blocks = x.copy(), np.concatenate([(np.eye(4) * 10.0).ravel() for _ in range(4)])
    for _ in range(50):
        z, rate = rng.normal(size=8) * 10.0, rng.normal(size=4) * 1e3
        paper.kalman_step(mine, blocks, z, rate, Q, R, RADIUS, INERTIA, DT)
        x = a @ x
        x[2::4] += DT * rate
        p = a @ p @ a.T + q
        measured = np.array([z[k // 2 + (4 if k % 2 else 0)] for k in range(8)])
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
        x = x + gain @ (measured - h @ x)
        p = p - gain @ h @ p
        p = 0.5 * (p + p.T)
    assert mine == pytest.approx(x, rel=1e-9, abs=1e-9)
    assert blocks[:16].reshape(4, 4) == pytest.approx(p[:4, :4], rel=1e-8, abs=1e-9)


def test_bulk_run_equals_single_steps():
    rng = np.random.default_rng(2)
    z, rate = rng.normal(size=(30, 8)), rng.normal(size=(30, 4))
    x, p = np.zeros(16), np.tile(np.eye(4).ravel(), 4)
    out = np.empty((30, 16))
    paper.kalman_run(x.copy(), p.copy(), z, rate, Q, R, RADIUS, INERTIA, DT, out)
    for n in range(30):
        paper.kalman_step(x, p, z[n], rate[n], Q, R, RADIUS, INERTIA, DT)
        assert out[n].tolist() == x.tolist()


def test_burckhardt_dry_peak():
    c = (1.2801, 23.99, 0.52)
    slips = np.linspace(0.01, 1.0, 500)
    mu = [paper.burckhardt(s, 0.0, 1.0, *c)[0] for s in slips]
    assert max(mu) == pytest.approx(1.170, abs=0.001)
    assert slips[int(np.argmax(mu))] == pytest.approx(0.17, abs=0.01)
    assert paper.burckhardt(-0.05, 0.0, 4000.0, *c)[0] < 0.0
    assert paper.burckhardt(0.0, 0.0, 4000.0, *c) == (0.0, 0.0)


def sample(speed=20.0, slip=-0.01, ax=-3.2, pressure=25e5, demand=3.2):
    z = np.zeros(17)
    z[paper.AX], z[paper.DEMAND] = ax, demand
    z[paper.WHEEL : paper.WHEEL + 4] = speed * (1.0 + slip) / RADIUS
    z[paper.PRESSURE : paper.PRESSURE + 4] = pressure
    return z


def test_k_holds_while_coasting_and_on_differing_signs(parameters):
    p = paper_parameters(parameters)
    s = paper.paper_step(np.zeros(paper.SIZE), sample(slip=0.0, ax=-0.2, pressure=0.0, demand=0.0), p, DT)
    for ax, demand in ((-0.2, 0.0), (0.5, 3.2)):
        before = s[paper.K]
        s = paper.paper_step(s, sample(slip=0.0, ax=ax, pressure=0.0, demand=demand), p, DT)
        assert s[paper.K] == before == 1.0


def test_nothing_changes_without_the_acceleration(parameters):
    p = paper_parameters(parameters)
    s = paper.paper_step(np.zeros(paper.SIZE), sample(), p, DT)
    z = sample()
    z[paper.AX] = math.nan
    assert paper.paper_step(s, z, p, DT).tolist() == s.tolist()


@pytest.mark.parametrize("kernel", ["compiled", "plain"])
def test_the_same_source_runs_uncompiled(parameters, kernel):
    function = paper.paper_step if kernel == "compiled" else getattr(paper.paper_step, "py_func", paper.paper_step)
    s = np.zeros(paper.SIZE)
    speed = 20.0
    for _ in range(60):
        speed -= 3.2 * DT
        s = function(s, sample(speed), paper_parameters(parameters), DT)
    assert np.all(np.isfinite(s))
    assert np.all(s[paper.FRICTION : paper.FRICTION + 4] < 1.2)
    assert np.all(s[paper.WHEEL_TORQUE : paper.WHEEL_TORQUE + 4] < -20.0)
