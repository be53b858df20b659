"""Replays: what answers the speed is taken at the measured one, and what cannot differ is not simulated again."""

from dataclasses import replace

import numpy as np
import pytest

from hil.study.prepare import prepare
from hil.study.rig import Rig
from hil.study.table import Log, make_log
from hil.study.vehicle import paper_car
from hil.study.world import World, nominal
from plant.effects.theta import THETA
from plant.vectors import P

WHEELS = ("fl", "fr", "rl", "rr")
RECUPERATES, BRAKES = (10.0, 15.0), (19.0, 23.0)
SEGMENTS = 3


def _log() -> Log:
    """A car that coasts, recuperates beyond what its motors may give, rolls and brakes."""
    t = np.arange(2600) * 0.01
    recuperates, brakes = ((t > begin) & (t < end) for begin, end in (RECUPERATES, BRAKES))
    speed = 36.0 - np.cumsum(0.3 + 2.5 * recuperates + 3.0 * brakes) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS} | {"ax_mps2": np.gradient(speed, t)}
    channels |= {f"pressure_{w}_pa": 15e5 * brakes for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": 15e5 * brakes for w in WHEELS}
    channels |= {f"motor_torque_{w}_nm": -280.0 * recuperates for w in WHEELS}
    channels |= {f"motor_torque_demand_{w}_nm": -690.0 * recuperates for w in WHEELS}
    return make_log("log", t, channels)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig(prepare([_log()], 0.308), paper_car())


def _with(world: World, effect: str, number: str, value: float) -> World:
    theta = world.theta.copy()
    theta[THETA.slice(effect, number)] = value
    return replace(world, theta=theta)


def test_a_motor_at_its_limit_does_not_answer_an_error_of_the_speed(rig):
    """A limit that followed the simulated speed told more of mass, drag and grade than the motion of the car did."""
    level = nominal(rig.vehicle)
    flat, steep = (rig.run(world) for world in (level, _with(level, "road_grade", "grade", 0.03)))
    assert np.abs(steep["wheel"] - flat["wheel"]).max() > 1.0
    assert np.abs(flat["motor"]).max() > 100.0
    assert np.array_equal(steep["motor"], flat["motor"])


@pytest.mark.parametrize(("effect", "number", "value"), [
    ("pad_mu_gain", "gain", 0.1), ("iwm_gain", "gain", 0.1), ("ehb_dead_time", "time_s", 0.01),
    ("road_grade", "grade", 0.01), ("imu_bias", "ax_mps2", 0.1),
])  # fmt: skip
def test_a_kept_world_changes_no_result(rig, effect, number, value):
    level = nominal(rig.vehicle)
    changed = _with(level, effect, number, value)
    fresh = Rig(rig.case, rig.vehicle).run(changed)
    rig.keep(level)
    kept = rig.run(changed)
    for group, values in fresh.items():
        apart = np.abs(kept[group] - values).max()
        assert apart <= 2e-3 * max(np.abs(values - rig.run(level)[group]).max(), 1e-9), group


def test_brakes_change_nothing_before_they_are_applied(rig):
    level = nominal(rig.vehicle)
    rig.keep(level)
    same, changed = rig.run(level), rig.run(_with(level, "pad_mu_gain", "gain", 0.2))
    first = int(rig.case.drives[0].segments[-1].first) // rig.case.drives[0].stride
    assert len(rig.case.drives[0].segments) == SEGMENTS
    assert np.array_equal(same["wheel"][:first], changed["wheel"][:first])
    assert np.abs(same["wheel"][first:] - changed["wheel"][first:]).max() > 0.1


def test_pads_begin_at_the_rest_value_of_the_car_at_hand(rig):
    """With the friction of the car as handed in, what is stated of its pads would say nothing of the first stops."""
    level = nominal(rig.vehicle)
    p = level.p.copy()
    p[P.pad_epsilon_w] *= 1.05
    rig.keep(level)
    slower = rig.run(replace(level, p=p))["wheel"][-100:] - rig.run(level)["wheel"][-100:]
    weaker = rig.run(_with(level, "pad_mu_gain", "gain", 1.0 / 1.05 - 1.0))["wheel"][-100:]
    weaker = weaker - rig.run(level)["wheel"][-100:]
    assert slower.mean() == pytest.approx(weaker.mean(), rel=0.1)
