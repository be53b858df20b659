"""Signatures of candidates: two names of one weak brake have the same, up to a stop and after it."""

from types import SimpleNamespace

import numpy as np
import pytest
from outsider import VEHICLE

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.candidates import CandidateSet, inseparable_forward, unexcited_sensors
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import MODE_NAMES, ChannelNoise, Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

WHEELS = ("fl", "fr", "rl", "rr")


def _cosine(log, one: str, other: str) -> float:
    """Cosine of two signatures in the acceleration, where that is compared."""
    vehicle = load_vehicle(VEHICLE)
    dataset = prepare([log], 0.318)
    base, masks = nominal(vehicle), SampleMasks.of(dataset)
    simulator = Simulator(dataset, vehicle).prepared(base)
    listed = {candidate.name: candidate for candidate in CandidateSet(simulator, masks, ()).candidates}
    signatures = []
    for name in (one, other):
        candidate = listed[name]
        step = 0.05 * candidate.parameter.typical
        stepped = [candidate.applied(base, step)]
        jacobian = finite_difference_jacobian(simulator, masks, simulator.run(base), stepped, [step])
        signatures.append(np.where(masks.present["ax"].ravel() > 0.5, jacobian["ax"][:, 0], 0.0))
    a, b = signatures
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


@pytest.mark.parametrize(("rings_s", "alike"), [(None, True), (1.0, False)])
def test_a_car_that_rings_at_a_stop_does_not_separate_two_names_of_one_brake(monkeypatch, rings_s, alike):
    """The simulated car stops 0.2 s after the measured one: compared a second later, it rings."""
    if rings_s is not None:
        monkeypatch.setattr("hil.diagnosis.data.masks._RINGS_S", rings_s)
    t = np.arange(1800) * 0.01
    speed = np.clip(20.0 - 3.0 * np.clip(t - 1.0, 0.0, None), 0.0, None)
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.318 for w in WHEELS}
    channels |= {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    channels |= {f"pressure_{w}_pa": 17e5 * np.clip((t - 1.0) / 0.2, 0.0, 1.0) for w in WHEELS}
    cosine = _cosine(make_log("log", t, channels), "pad_mu_gain@front", "stuck_corner.loss@front")
    assert (abs(cosine) > 0.999) is alike


@pytest.mark.parametrize(("torque_nm", "excited"), [(0.3, False), (3.0, True)])
def test_a_sensor_that_carries_only_noise_has_no_scale(torque_nm, excited):
    """Motors that stood still were named at 4.7 times what they give: less of their noise then drove the car."""
    channels = {f"motor.{mode}": np.full((100, 1), 0.1) for mode in MODE_NAMES}
    channels["motor.mean"][20:40] = torque_nm
    noise = Noise({name: ChannelNoise(0.5, 0.0, 0.0, 1.0) for name in channels}, ())
    unexcited = unexcited_sensors(channels, noise)
    assert unexcited == (["pressure"] if excited else ["pressure", "motor"])
    locations = {(one.effect.name, one.location) for one in candidates(columns(), quiet=unexcited)}
    for name in ("wrong_scale", "timestamp_offset", "clock_drift"):
        assert ((name, "motor") in locations) == excited
        assert (name, "imu") in locations
    assert ("iwm_gain", "front") in locations


def test_a_calliper_that_grips_unlike_backward_is_no_candidate_where_no_log_moves_backward():
    """It led before the gain of that brake, which is the same going forward."""
    t = np.arange(500) * 0.01
    forward, backward = (
        SimpleNamespace(
            recordings=[SimpleNamespace(log=make_log("a", t, {"wheel_speed_fl_rad_s": np.full(500, speed)}))]
        )
        for speed in (-0.2, -20.0)
    )
    assert inseparable_forward(forward) == {"caliper_asymmetry": "pad_mu_gain"}
    assert inseparable_forward(backward) == {}
