"""A car with motors at one axle logs torques of two wheels."""

import numpy as np
import pytest

from hil.diagnosis.data.axle_torques import undriven, with_both_axles
from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, make_log
from hil.diagnosis.estimation.terms import candidates, columns


def _log(*names):
    t_s = 0.01 * np.arange(400)
    return make_log("a.csv", t_s, {name: 1.0 + np.zeros(400) for name in ("speed_mps", *names)})


@pytest.mark.parametrize(("logged", "zero", "axle"), [
    (MOTOR_TORQUE[2:], MOTOR_TORQUE[:2], "front"), (MOTOR_TORQUE[:2], MOTOR_TORQUE[2:], "rear"),
    (MOTOR_DEMAND[2:], MOTOR_DEMAND[:2], "front"),
    (MOTOR_TORQUE[2:] + MOTOR_DEMAND[2:], MOTOR_TORQUE[:2] + MOTOR_DEMAND[:2], "front"),
])  # fmt: skip
def test_the_other_axle_has_zero_torque_and_a_remark_says_so(logged, zero, axle):
    (log,) = with_both_axles([_log(*logged)])
    for name in zero:
        assert (log.channels[name] == 0.0).all()
    for name in logged:
        assert (log.channels[name] == 1.0).all()
    assert log.remarks[-1] == f"no motor torque is logged at the {axle}: taken as zero there"
    assert {name for name in log.channels if name.startswith("motor")} == {*logged, *zero}


@pytest.mark.parametrize("logged", [
    (), MOTOR_TORQUE, MOTOR_TORQUE[:1], MOTOR_TORQUE[1:], MOTOR_TORQUE[1:3], MOTOR_TORQUE[:2] + MOTOR_DEMAND[2:],
    MOTOR_TORQUE[2:] + MOTOR_DEMAND, MOTOR_TORQUE[2:] + MOTOR_DEMAND[3:],
])  # fmt: skip
def test_otherwise_logs_are_as_they_are(logged):
    logs = [_log(*logged)]
    assert with_both_axles(logs) is logs


def test_all_logs_need_the_same_axle():
    logs = [_log(*MOTOR_TORQUE[2:]), _log(*MOTOR_TORQUE)]
    assert with_both_axles(logs) is logs
    logs = [_log(*MOTOR_TORQUE[2:]), _log()]
    assert with_both_axles(logs) is logs


@pytest.mark.parametrize(("logged", "wheels"), [
    (MOTOR_TORQUE[2:], {0, 1}), (MOTOR_TORQUE[:2], {2, 3}), (MOTOR_TORQUE, set()), ((), set()),
])  # fmt: skip
def test_the_places_of_a_motor_are_those_of_wheels_that_have_one(logged, wheels):
    """The motor front right was named as those of the right side, in a car with none at the rear."""
    without = undriven(with_both_axles([_log(*logged)]))
    assert without == wheels
    listed = [one for one in candidates(columns(), without) if one.effect.name == "iwm_gain"]
    members = {one.location: {*one.members()} for one in listed}
    assert not any(those & wheels for those in members.values())
    assert {one.locations for one in listed} == {2 * len(members)}
    assert len(members) == (3 if wheels else 9)
    brakes = {one.location for one in candidates(columns(), without) if one.effect.name == "pad_mu_gain"}
    assert len(brakes) == 9
