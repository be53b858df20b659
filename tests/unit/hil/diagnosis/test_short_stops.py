"""Eight stops of 3 s are diagnosed as longer logs are: nothing in nothing, a wrong accelerometer by its name."""

import numpy as np
import plant_logs
import pytest

from hil.diagnosis.explain import explain
from plant.injection.theta import THETA
from plant.vectors import INPUT


def stops(gain: float) -> list[dict[str, np.ndarray]]:
    """Stops from 15 m/s with 7 m/s2, of the plant, with an accelerometer that reads ``gain`` times the true value."""

    def demands(n: int, k: int) -> np.ndarray:
        u = np.zeros((n, INPUT.size))
        braking = np.clip((np.arange(n) * plant_logs.STEP_S - 0.4) / 0.15, 0.0, 1.0)
        u[:, INPUT.slice("pressure_demand_pa")] = (braking * (7e6 + 4e5 * k))[:, None]
        return u

    made = [plant_logs.log(THETA.neutral(), 5, k, 3.0, demands, 15.0) for k in range(8)]
    return [one | {"ax_mps2": gain * one["ax_mps2"]} for one in made]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_eight_short_stops_are_diagnosed() -> None:
    assert explain(stops(1.0)).json["verdict"] == "none"
    (cause,) = explain(stops(0.9)).json["causes"]
    assert cause["effect"] == "imu_gain"
    assert cause["parameters"]["gain"]["value"] == pytest.approx(-0.1, abs=0.02)
