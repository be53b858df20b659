"""Where hot spots stand: nobody tells, the wheels' speeds do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.hot_spots import (
    QUARTER_RAD,
    fit_phase,
    has_hot_spots,
    phase_penalty,
    row_chunks,
    wheel_angles,
    with_spots,
    without_spots,
)
from hil.diagnosis.simulation.measurement_model import SOURCE
from hil.diagnosis.simulation.parameter_set import ParameterSet, nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from plant.effects.pads.hot_spot import ORDER
from plant.injection.theta import THETA
from plant.signals import WHEELS

AMPLITUDE = 0.1
RADIUS_M, BRAKES_S = 0.308, 2.0


def _stop(wheels: np.ndarray) -> Simulator:
    """A simulator of a stop from 20 m/s with these wheel speeds, rad/s, every 10 ms, on hot discs."""
    t = np.arange(len(wheels)) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": wheels[:, k] for k, w in enumerate(WHEELS)}
    channels |= {f"pressure_{w}_pa": np.where(t > BRAKES_S, 35e5, 0.0) for w in WHEELS}
    log = replace(make_log("hot", t, channels), disc_temperature_k=650.0)
    return Simulator(prepare([log], RADIUS_M), paper_car())


def _turned(simulator: Simulator, by_rad: float = 0.0) -> Simulator:
    """With hot spots at these angles from where each log began."""
    angles = tuple(wheel_angles(recording) + by_rad for recording in simulator.dataset.recordings)
    return replace(simulator, hot_spot_angles=angles)


def _spotted(parameters: ParameterSet, amplitude: float) -> ParameterSet:
    theta = parameters.theta.copy()
    theta[THETA.slice("hot_spot", "amplitude")] = amplitude
    return replace(parameters, theta=theta)


@pytest.fixture(scope="module")
def rolled() -> np.ndarray:
    """Wheel speeds of the car without spots, as it simulates them: a log that it explains."""
    t = np.arange(650) * 0.01
    speed = np.clip(20.0 - 5.4 * np.clip(t - BRAKES_S, 0.0, None), 0.0, None) / RADIUS_M
    simulator = _stop(np.column_stack([speed] * 4))
    return simulator.states(nominal(simulator.vehicle), SOURCE["wheel"])


def test_spots_are_turned_to_where_the_wheels_show_them(rolled: np.ndarray) -> None:
    """Of a car whose spots stand elsewhere the amplitude is seen once they are turned, and was not before."""
    made = _stop(rolled)
    parameters = nominal(made.vehicle)
    made = _turned(made, QUARTER_RAD)
    spots = made.states(_spotted(parameters, AMPLITUDE), SOURCE["wheel"]) - made.states(parameters, SOURCE["wheel"])
    seen = rolled[: len(spots)] + spots

    def amplitude(simulator: Simulator) -> float:
        """The amplitude that explains most, by one linear step, of the samples that are compared."""
        compared = simulator.dataset.recordings[0].moving > 0.5
        bare = simulator.run(parameters)["wheel"]
        left = np.diff((simulator.measured()["wheel"] - bare)[compared], axis=0).ravel()
        shown = np.diff((simulator.run(_spotted(parameters, 0.01))["wheel"] - bare)[compared], axis=0).ravel() / 0.01
        return float(left @ shown / (shown @ shown))

    simulator = _stop(seen)
    before = amplitude(_turned(simulator))
    simulator = simulator.with_hot_spot_phase(parameters)
    assert before != pytest.approx(AMPLITUDE, rel=0.2)
    assert amplitude(simulator) == pytest.approx(AMPLITUDE, rel=0.2)


@pytest.mark.parametrize("stand", [-0.3, -0.05, 0.0, 0.2, 0.31])
def test_two_replays_tell_where_the_spots_stand(rolled: np.ndarray, stand: float) -> None:
    (recording,) = _stop(rolled).dataset.recordings
    rng = np.random.default_rng(3)
    shown = [rng.normal(size=(recording.samples, 4)) for _ in range(2)]
    left = 7.0 * (np.cos(ORDER * stand) * shown[0] + np.sin(ORDER * stand) * shown[1])
    angles, visibility = fit_phase(recording, left, shown)
    assert angles[0] == pytest.approx(stand)
    assert np.all(visibility > 0.0)


@pytest.mark.parametrize("much", [[1.0], [1.0] * 4, [1.0] * 8, [1.0, 0.5, 0.5, 0.2], [1.0, 0.3, 0.3, 0.3]])
def test_angles_that_noise_chooses_explain_no_more_than_their_price(much: list[float]) -> None:
    """As seldom as noise of one degree of freedom reaches the detection threshold."""
    shown, threshold = np.array(much), 12.0
    drawn = np.random.default_rng(5).rayleigh(size=(400_000, len(shown)))
    gains = (drawn @ shown) ** 2 / np.sum(shown**2)
    seldom = np.mean(gains > threshold + phase_penalty(shown[:, None], (0,)))
    assert seldom < 2.0 * chi2.sf(threshold, 1)


def test_angles_where_spots_do_not_show_cost_nothing() -> None:
    much = np.zeros((3, 4))
    assert phase_penalty(much, (0, 1)) == 0.0
    much[0, 0] = 2.0
    assert phase_penalty(much, (0, 1)) == phase_penalty(np.full((1, 4), 7.0), (1,))


def test_angles_are_those_of_the_measured_wheels(rolled: np.ndarray) -> None:
    (recording,) = _stop(np.full((600, 4), 30.0)).dataset.recordings
    turned = wheel_angles(recording)
    assert turned[0] == pytest.approx(0.0)
    assert turned[100] == pytest.approx(30.0)
    assert len(turned) == len(recording.inputs)


def test_parts_have_all_rows_once() -> None:
    rows = [row for part in row_chunks(slice(3, 21)) for row in range(part.start, part.stop)]
    assert rows == list(range(3, 21))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_spots_are_turned_for_the_sign_they_have(rolled: np.ndarray, sign: float) -> None:
    """Of a car handed in with spots: less than none is the same spots half the way to the next."""
    made = _turned(_stop(rolled))
    parameters = _spotted(nominal(made.vehicle), AMPLITUDE)
    seen = made.states(parameters, SOURCE["wheel"])
    simulator = _stop(seen)
    nominal_parameters = _spotted(parameters, sign * AMPLITUDE)
    simulator = simulator.with_hot_spot_phase(nominal_parameters)
    compared = simulator.dataset.recordings[0].moving > 0.5
    left, bare = (
        simulator.measured()["wheel"] - simulator.run(one)["wheel"]
        for one in (nominal_parameters, nominal(simulator.vehicle))
    )
    assert np.diff(left[compared], axis=0).std() < 0.4 * np.diff(bare[compared], axis=0).std()


def test_only_a_world_with_spots_asks_for_angles(rolled: np.ndarray) -> None:
    parameters = nominal(paper_car())
    assert not has_hot_spots(parameters)
    assert has_hot_spots(with_spots(parameters))
    assert not has_hot_spots(without_spots(with_spots(parameters)))
    assert pytest.approx(0.25 * 2.0 * np.pi / ORDER) == QUARTER_RAD
