"""What candidates show: two names of one weak brake show the same, up to a stop and after it."""

import numpy as np
import pytest
from outsider import VEHICLE

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.candidates import CandidateSet, unexcited_sensors
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import MODE_NAMES, ChannelNoise, Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

WHEELS = ("fl", "fr", "rl", "rr")


def _alike(log, one: str, other: str) -> float:
    """Cosine of two signatures in the acceleration, where that is compared."""
    vehicle = load_vehicle(VEHICLE)
    case = prepare([log], 0.318)
    rig, frame, base = Simulator(case, vehicle).prepared(nominal(vehicle)), SampleMasks.of(case), nominal(vehicle)
    listed = {candidate.name: candidate for candidate in CandidateSet(rig, frame, ()).candidates}
    shown = []
    for name in (one, other):
        candidate = listed[name]
        step = 0.05 * candidate.parameter.typical
        shows = finite_difference_jacobian(rig, frame, rig.run(base), [candidate.applied(base, step)], [step])
        shown.append(np.where(frame.present["ax"].ravel() > 0.5, shows["ax"][:, 0], 0.0))
    a, b = shown
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


@pytest.mark.parametrize(("rings_s", "alike"), [(None, True), (1.0, False)])
def test_a_car_that_rings_at_a_stop_does_not_tell_two_names_of_one_brake_apart(monkeypatch, rings_s, alike):
    """The simulated car stops 0.2 s after the measured one: compared a second later, it rings."""
    if rings_s is not None:
        monkeypatch.setattr("hil.diagnosis.data.prepare._RINGS_S", rings_s)
    t = np.arange(1800) * 0.01
    speed = np.clip(20.0 - 3.0 * np.clip(t - 1.0, 0.0, None), 0.0, None)
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.318 for w in WHEELS}
    channels |= {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    channels |= {f"pressure_{w}_pa": 17e5 * np.clip((t - 1.0) / 0.2, 0.0, 1.0) for w in WHEELS}
    cosine = _alike(make_log("log", t, channels), "pad_mu_gain@front", "stuck_corner.loss@front")
    assert (abs(cosine) > 0.999) is alike


@pytest.mark.parametrize(("torque_nm", "tells"), [(0.3, False), (3.0, True)])
def test_of_a_sensor_that_tells_nothing_but_noise_no_scale_is_asked(torque_nm, tells):
    """Motors that stood still were told at 4.7 times what they give: less of their noise then drove the car."""
    shown = {f"motor.{mode}": np.full((100, 1), 0.1) for mode in MODE_NAMES}
    shown["motor.mean"][20:40] = torque_nm
    noise = Noise({name: ChannelNoise(0.5, 0.0, 0.0, 1.0) for name in shown}, ())
    quiet = unexcited_sensors(shown, noise)
    assert quiet == (["pressure"] if tells else ["pressure", "motor"])
    places = {(one.effect.name, one.location) for one in candidates(columns(), quiet=quiet)}
    for name in ("wrong_scale", "timestamp_offset", "clock_drift"):
        assert ((name, "motor") in places) == tells
        assert (name, "imu") in places
    assert ("iwm_gain", "front") in places
