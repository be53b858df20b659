import numpy as np
import pytest

from plant.inject import J
from plant.injection.bank import Shape, Variable, term
from plant.injection.theta import THETA
from plant.injection_points import INJECTION_POINTS
from plant.open_loop_manoeuvres import MANOEUVRES, drive
from plant.signals import NAMES, simulate


@pytest.fixture(scope="module")
def stop(paper_car):
    plan = drive(MANOEUVRES["straight_stop"], paper_car)
    return plan, simulate(plan)[0]


def test_numbers_by_member_list_or_one_for_all():
    theta = THETA.neutral()
    THETA.set(theta, "pad_mu_gain", {"gain": {"rl": 0.1}})
    assert theta[THETA.slice("pad_mu_gain", "gain")].tolist() == [0.0, 0.0, 0.1, 0.0]
    THETA.set(theta, "pad_mu_gain", {"gain": [0.1, 0.2, 0.3, 0.4]})
    assert theta[THETA.slice("pad_mu_gain", "gain")].tolist() == [0.1, 0.2, 0.3, 0.4]
    THETA.set(theta, "pad_mu_gain", {"gain": -0.1, "onset_s": 2.0})
    assert theta[THETA.slice("pad_mu_gain", "gain")].tolist() == [-0.1] * 4
    assert theta[THETA.slice("pad_mu_gain", "onset_s")] == 2.0


def test_a_change_multiplies_factors_and_adds_to_all_else():
    """Pads that bite 10 % more than stated, then a fifth less than before, bite 12 % less than stated."""
    before, change = THETA.neutral(), np.zeros(THETA.size)
    for theta, gain, loss, drag in ((before, 0.1, 0.3, 5.0), (change, -0.2, 0.5, 6.0)):
        THETA.set(theta, "pad_mu_gain", {"gain": gain})
        THETA.set(theta, "stuck_corner", {"loss": loss})
        THETA.set(theta, "residual_drag", {"torque_nm": drag})
    after = THETA.changed(before, change)
    assert after[THETA.slice("pad_mu_gain", "gain")] == pytest.approx(np.full(4, 1.1 * 0.8 - 1.0))
    assert after[THETA.slice("stuck_corner", "loss")] == pytest.approx(np.full(4, 1.0 - 0.7 * 0.5))
    assert after[THETA.slice("residual_drag", "torque_nm")] == pytest.approx(np.full(4, 11.0))
    assert np.array_equal(THETA.changed(before, np.zeros(THETA.size)), before)


@pytest.mark.parametrize(
    ("effect", "values", "error"),
    [
        ("pad_mu_gain", {"gain": 7.0}, "expected -0.6 to 0.6"),
        ("pad_mu_gain", {"gain": [0.1, 0.2]}, "expected 4 numbers"),
        ("pad_mu_gain", {"gain": {"front": 0.1}}, "expected fl, fr, rl, rr"),
        ("pad_mu_gain", {"grip": 0.1}, "has no parameter 'grip'"),
        ("pad_glow", {}, "no effect 'pad_glow'"),
        ("road_grade", {"grade": float("nan")}, "expected -0.2 to 0.2"),
    ],
)
def test_wrong_numbers_are_refused(effect, values, error):
    with pytest.raises((KeyError, ValueError), match=error):
        THETA.set(THETA.neutral(), effect, values)


def test_an_onset_inside_a_row_counts_with_its_share(stop):
    plan, signals = stop
    ax = NAMES.index("ax_mps2")
    changes = []
    for onset in (2.0, 2.005, 2.01):
        theta = THETA.set(THETA.typical("pad_mu_gain"), "pad_mu_gain", {"onset_s": onset})
        changed = simulate(plan, theta)[0]
        assert np.array_equal(changed[:200], signals[:200])
        changes.append(changed[201, ax] - signals[201, ax])
    assert changes[0] > changes[1] > changes[2] == 0.0


def test_an_effect_of_the_model_ends(stop):
    plan, signals = stop

    def driven(**times: float) -> np.ndarray:
        return simulate(plan, THETA.set(THETA.typical("pad_mu_gain"), "pad_mu_gain", times))[0]

    assert np.array_equal(driven(until_s=0.0), signals)
    ended, lasting = driven(onset_s=1.0, until_s=2.0), driven(onset_s=1.0)
    assert np.array_equal(ended[:201], lasting[:201])
    ax = NAMES.index("ax_mps2")
    assert np.abs(lasting[210:300, ax] - ended[210:300, ax]).min() > 0.05


def test_an_effect_ends(stop):
    plan, signals = stop
    theta = THETA.set(THETA.typical("imu_bias"), "imu_bias", {"onset_s": 1.0, "until_s": 2.0})
    ax = NAMES.index("ax_mps2")
    added = simulate(plan, theta)[0][:, ax] - signals[:, ax]
    assert np.flatnonzero(added)[[0, -1]].tolist() == [100, 199]


def test_a_basis_term_does_what_the_effect_does(stop):
    plan, _ = stop
    theta = THETA.set(THETA.neutral(), "pad_mu_gain", {"gain": {"fl": 0.1, "rr": -0.1}})
    row = term("friction.mu", [0.1, 0.0, 0.0, -0.1], (Variable.ONE, Shape.CONSTANT, 0.0, 1.0))
    np.testing.assert_array_equal(simulate(plan, terms=row[None]), simulate(plan, theta))
    theta = THETA.set(THETA.neutral(), "mass_offset", {"mass_kg": 100.0})
    row = term("vehicle_mass_kg", 100.0, (Variable.ONE, Shape.CONSTANT, 0.0, 1.0), add=True)
    np.testing.assert_allclose(simulate(plan, terms=row[None]), simulate(plan, theta), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("point", [*INJECTION_POINTS, "vehicle_mass_kg", "friction_brake_piston_area_m2"])
@pytest.mark.parametrize("add", [False, True])
def test_a_term_at_every_injection_point_acts_and_stays_finite(paper_car, point, add):
    plan = drive(MANOEUVRES["brake_in_turn"], paper_car)
    size = {"N": 100.0, "Pa": 5e4, "Pa/s": 1e5, "N m": 20.0}.get(INJECTION_POINTS.get(point, (0, "", ""))[1], 0.01)
    if point == "friction_brake_piston_area_m2":
        size = 1e-4
    row = term(point, size if add else 0.05, (Variable.SPEED, Shape.LINEAR, 0.0, 20.0), add=add)
    free, changed = simulate(plan)[0], simulate(plan, terms=row[None])[0]
    assert np.isfinite(changed).all()
    silent = point in ("motor.demand", "motor.torque", "sensor.motor_torque", "road.grade", "air.speed",
                       "steering.angle", "contact.speed", "hydraulics.rate") and not add  # fmt: skip
    silent = silent or point == "motor.available"  # no motor is asked for more than it is able to give
    assert silent or not np.array_equal(free, changed)


@pytest.mark.parametrize("variable", list(Variable))
@pytest.mark.parametrize("shape", list(Shape))
def test_every_variable_and_shape_stays_finite(stop, variable, shape):
    plan, _ = stop
    row = term("friction.mu", 0.01, (variable, shape, 0.5, 10.0), (Variable.SPEED, Shape.LINEAR, 0.0, 20.0))
    short = type(plan)(plan.start, plan.rows[:80], plan.parameters, plan.pedal[:80])
    assert np.isfinite(simulate(short, terms=row[None])).all()


def test_terms_that_cannot_be_are_refused():
    one = (Variable.ONE, Shape.CONSTANT, 0.0, 1.0)
    with pytest.raises(ValueError, match="no injection point"):
        term("friction.glue", 0.1, one)
    with pytest.raises(ValueError, match="expected 4 coefficients"):
        term("friction.mu", [0.1], one)
    with pytest.raises(ValueError, match="width"):
        term("friction.mu", 0.1, (Variable.SPEED, Shape.LINEAR, 0.0, 0.0))


def test_injection_points_lie_behind_each_other():
    assert len({getattr(J, name.replace(".", "_")) for name in INJECTION_POINTS}) == len(INJECTION_POINTS)
