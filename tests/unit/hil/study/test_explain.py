"""From logs to the answer, on logs that the plant itself made: nothing in nothing, a hidden drag by its name."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil.study.explain import explain
from hil.study.logs.table import UnusableError
from hil.study.replay.vehicle_set import paper_car
from hil.study.verdict.extension import load_extension
from plant.injection.theta import THETA
from plant.model import Scene, initial_state, pack, replay
from plant.vectors import INPUT

WHEELS = ("fl", "fr", "rl", "rr")
STEP_S = 0.01
SPEED_MPS = 25.0


def _demands(n: int, k: int) -> np.ndarray:
    """Motor pulses either way, a brake pressure in between."""
    t, u = np.arange(n) * STEP_S, np.zeros((n, INPUT.size))
    u[:, INPUT.slice("motor_demand_nm")] = np.where(t % 4.0 < 1.5, -250.0, np.where(t % 4.0 < 2.5, 200.0, 0.0))[:, None]
    braking = np.clip((t % 6.0 - 3.0 - 0.2 * k) / 0.2, 0.0, 1.0) * (t % 6.0 < 4.5)
    u[:, INPUT.slice("pressure_demand_pa")] = (braking * (1.0e6 + 3e5 * k))[:, None]
    return u


def _frame(theta: np.ndarray, seed: int, k: int, seconds: float = 14.0) -> dict[str, np.ndarray]:
    """One log of the shipped car with sensor noise and a coloured force."""
    rng, n = np.random.default_rng([seed, k]), round(seconds / STEP_S)
    parameters, u = paper_car().parameters, _demands(n, k)
    groups = ("state.wheel_speed_rad_s", "state.pressure_pa", "state.motor_torque_nm")
    names = [f"{g}_{w}" for g in groups for w in WHEELS] + ["state.imu_longitudinal_mps2", "state.speed_mps"]
    x = initial_state(parameters, SPEED_MPS, 350.0, 0.7)
    (table,) = replay(x, u, pack(parameters), names, Scene(theta=theta))
    force = np.zeros(n)
    for i in range(1, n):
        force[i] = 0.99 * force[i - 1] + 0.03 * np.sqrt(1.0 - 0.99**2) * rng.standard_normal()
    drift = np.cumsum(force) * STEP_S
    found = {"t_s": np.arange(n) * STEP_S, "ax_mps2": table[:, 12] + force + 0.02 * rng.standard_normal(n)}
    found["speed_mps"] = table[:, 13] + drift + 0.03 * rng.standard_normal(n)
    for i, w in enumerate(WHEELS):
        found[f"wheel_speed_{w}_rad_s"] = (table[:, i] + drift / 0.308) * (1.0 + 0.001 * rng.standard_normal(n))
        found[f"pressure_{w}_pa"] = table[:, 4 + i] + 1e4 * rng.standard_normal(n)
        found[f"motor_torque_{w}_nm"] = table[:, 8 + i] + rng.standard_normal(n)
        found[f"pressure_demand_{w}_pa"] = u[:, INPUT.slice("pressure_demand_pa")][:, i]
        found[f"motor_torque_demand_{w}_nm"] = u[:, INPUT.slice("motor_demand_nm")][:, i]
    return found


def _logs(theta: np.ndarray, seed: int) -> list[dict[str, np.ndarray]]:
    return [_frame(theta, seed, k) for k in range(3)]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_nothing_is_found_in_nothing() -> None:
    answer = explain(_logs(THETA.neutral(), 5))
    assert answer.json["verdict"] == "none"
    assert answer.json["causes"] == []
    assert json.loads(json.dumps(answer.json))["gain"]["wheel_speed"]["after"] > 0.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hidden_drag_is_named_extended_and_then_nothing_is_left(tmp_path: Path) -> None:
    theta = THETA.set(THETA.neutral(), "residual_drag", {"torque_nm": {"rl": 30.0}})
    logs = _logs(theta, 6)
    found = explain(logs, out=tmp_path).json
    assert found["causes"][0]["effect"] == "residual_drag"
    assert found["causes"][0]["wheel"] == "rl"
    assert found["causes"][0]["parameters"]["torque_nm"]["value"] == pytest.approx(30.0, rel=0.3)
    taught = load_extension(tmp_path / "extension.toml")
    assert taught.theta[THETA.slice("residual_drag", "torque_nm")][2] == pytest.approx(30.0, rel=0.3)
    assert explain(logs, extend=tmp_path / "extension.toml").json["causes"] == []


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_drag_that_begins_in_the_middle_is_named_with_its_time() -> None:
    dragging = THETA.set(THETA.neutral(), "residual_drag", {"torque_nm": {"rl": 40.0}})
    beginning = dragging.copy()
    beginning[THETA.slice("residual_drag", "onset_s")] = 5.0
    logs = [_frame(theta, 8, k) for k, theta in enumerate((THETA.neutral(), beginning, dragging))]
    (cause,) = explain(logs).json["causes"]
    assert (cause["effect"], cause["wheel"]) == ("residual_drag", "rl")
    assert cause["onset"]["log"].endswith("1")
    assert cause["onset"]["t_s"] == pytest.approx(5.0, abs=0.1)
    assert cause["onset_s"] == pytest.approx(14.0 + 5.0, abs=0.1)


def test_without_motion_or_torque_there_is_no_answer() -> None:
    t = np.arange(500) * STEP_S
    with pytest.raises(UnusableError, match="how the car moved"):
        explain({"t_s": t, "ax_mps2": np.zeros(500)})
    with pytest.raises(UnusableError, match="what braked the car"):
        explain({"t_s": t, "speed_mps": np.full(500, 20.0)})
