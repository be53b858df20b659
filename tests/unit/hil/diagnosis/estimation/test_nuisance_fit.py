"""Nuisance parameters: Birge ratio, Jacobians that are remembered, and a fit that no single bound blocks."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import acting_among, finite_difference_jacobian, information_blocks
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.diagnosis.vehicle.priors import DISC_ASSUMED_SD_K, DISC_MEASURED_SD_K
from plant.injection.theta import THETA
from plant.vectors import INPUT

NOISE_PA = 2e3
GAINS = {"brake_gain_front_nm_pa": 2e-4, "brake_gain_rear_nm_pa": 1e-4}
_MASS, _INERTIA = (
    next(one for one in candidates(columns()) if one.name == name)
    for name in ("mass_offset@car", "rotating_inertia@car")
)


@pytest.fixture(scope="module")
def paper_fitter() -> Fitter:
    """All nuisances of the paper's car count in its Birge ratio."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    return Fitter(Simulator(case, vehicle), SampleMasks.of(case), nominal(vehicle), vehicle.nuisances, {})


def test_a_car_that_diverges_fits_nothing(paper_fitter):
    """Its wheels have a negative inertia: nothing it says is finite, which is no residual of zero."""
    z, noise = paper_fitter.origin, paper_fitter.start()[1]
    diverging = paper_fitter.at(z, (Term(_INERTIA, -2.0),), noise)
    assert not np.isfinite(paper_fitter.simulator.run(paper_fitter.parameter_set(z, diverging.terms))["wheel"]).all()
    assert diverging.cost > 1e12
    assert paper_fitter.cost(diverging.residual, z, noise) > 1e12


def test_sensors_of_a_car_that_diverges_say_nothing(paper_fitter):
    """An angle that is infinite has no cosine, and a speed that is none no place in a table."""
    level = paper_fitter.parameter_set(paper_fitter.origin, (Term(_INERTIA, -2.0),))
    uneven = level.adding(range(*THETA.slice("wheel_tooth_error", "first_cosine").indices(THETA.size)), 0.001)
    late = replace(uneven, latency_s=(0.01,) * len(uneven.latency_s))
    for values in paper_fitter.simulator.run(late).values():
        assert np.isnan(values).all()


def test_inputs_are_not_denoised_by_a_car_that_diverges(paper_fitter):
    base = _INERTIA.applied(paper_fitter.base, -2.0)
    simulator = paper_fitter.simulator.denoised(base)
    assert all(np.isfinite(one.inputs[:, INPUT.slice("pressure_pa")]).all() for one in simulator.dataset.recordings)
    with pytest.raises(UnusableError, match="the simulated car diverges"):
        Fitter(simulator, paper_fitter.masks, base, paper_fitter.nuisances, {}).start()


def test_from_a_car_that_diverges_no_step_is_made(paper_fitter):
    """Its gradient is not finite; numbers that were not reached the simulation, whose latencies were none."""
    z, noise = paper_fitter.origin, paper_fitter.start()[1]
    diverging = paper_fitter.at(z, (Term(_INERTIA, -2.0),), noise)
    for fitted in (paper_fitter.fit(diverging, noise), paper_fitter.refit_amplitudes(diverging, noise)):
        assert np.array_equal(fitted.z, z)
        assert fitted.values() == [-2.0]
        assert fitted.cost > 1e12


def test_numbers_with_which_the_car_diverges_are_refused(paper_fitter):
    base = _INERTIA.applied(paper_fitter.base, -2.0)
    diverging = Fitter(paper_fitter.simulator, paper_fitter.masks, base, paper_fitter.nuisances, {})
    with pytest.raises(UnusableError, match="the simulated car diverges"):
        diverging.start()


def test_a_step_with_which_the_car_diverges_says_nothing(paper_fitter):
    """Its column is zero, and that of a step beside it is what it is alone."""
    simulator, masks = paper_fitter.simulator, paper_fitter.masks
    level = paper_fitter.parameter_set(paper_fitter.origin, ())
    broken, heavier, base = _INERTIA.applied(level, -2.0), _MASS.applied(level, 20.0), simulator.run(level)
    both = finite_difference_jacobian(simulator, masks, base, [broken, heavier], [1.0, 1.0])
    alone = finite_difference_jacobian(simulator, masks, base, [heavier], [1.0])
    for name, values in both.items():
        assert not values[:, 0].any()
        assert np.array_equal(values[:, 1], alone[name][:, 0])
    assert both["wheel.mean"][:, 1].any()


def test_what_two_columns_differ_by_is_kept_in_precise_products(paper_fitter):
    """A term and a nuisance that are the same quantity: single precision leaves rounding, which may be negative."""
    model, noise = paper_fitter.start()
    rng, wide = np.random.default_rng(4), {name: (1e5 * one).astype(np.float32) for name, one in model.residual.items()}
    other = {name: (one + rng.standard_normal(one.shape)).astype(np.float32) for name, one in wide.items()}
    difference = {name: one - other[name] for name, one in wide.items()}

    def products(columns, precise):
        blocks = information_blocks(model.residual, columns, paper_fitter.masks, noise, 0, precise)
        return blocks.total()[1:, 1:]

    both, weights = {name: np.hstack([one, other[name]]) for name, one in wide.items()}, np.array([1.0, -1.0])
    expected = float(products(difference, True)[0, 0])
    assert weights @ products(both, True) @ weights == pytest.approx(expected, rel=0.02)
    assert weights @ products(both, False) @ weights != pytest.approx(expected, rel=0.02)


def test_numbers_that_are_held_stay_where_they_are(paper_fitter):
    held = np.zeros(len(paper_fitter.nuisances), bool)
    held[::2] = True
    rng = np.random.default_rng(5)
    root = rng.standard_normal((len(held) + 1, 2 * len(held)))
    z, *_ = paper_fitter.holding(held).moved(paper_fitter.start()[0], 10.0 * root @ root.T)
    assert (z[held] == paper_fitter.origin[held]).all()
    assert (z[~held] != paper_fitter.origin[~held]).any()
    free, *_ = paper_fitter.moved(paper_fitter.start()[0], 10.0 * root @ root.T)
    assert (free[held] != paper_fitter.origin[held]).any()


def test_nuisances_within_their_prior_have_a_birge_ratio_of_1(paper_fitter):
    rng, count = np.random.default_rng(3), len(paper_fitter.nuisances)
    assert paper_fitter.birge_ratio(np.zeros(count)) == 1.0
    assert paper_fitter.birge_ratio(0.5 * rng.standard_normal(count)) == 1.0
    assert paper_fitter.birge_ratio(np.full(count, 2.0)) == pytest.approx(4.0)


def test_nuisances_that_no_data_determine_do_not_lower_the_birge_ratio(paper_fitter):
    z = np.zeros(len(paper_fitter.nuisances))
    z[:10] = 2.0
    assert paper_fitter.birge_ratio(z) == 1.0
    assert paper_fitter.birge_ratio(z, 10.0) == pytest.approx(4.0)


@pytest.mark.slow
def test_squares_of_fitted_nuisances_add_up_to_the_effective_parameters():
    """Fitted to data of nuisances drawn from their prior; drawn three times as far, the sum is many times that."""
    vehicle = paper_car()
    log = log_of_pulses()
    case = prepare([log], 0.308)
    frame = SampleMasks.of(case)
    numbers = NuisanceFit(Simulator(case, vehicle), frame, vehicle, nominal(vehicle), False)
    noise = numbers.fitter.start()[1]
    determined, rng = numbers.fitter.effective_parameters(noise), np.random.default_rng(11)
    assert 1.0 < determined < len(numbers.nuisances)
    information = numbers.fitter.nuisance_information(noise)
    values, vectors = np.linalg.eigh(information)
    root = vectors * np.sqrt(np.maximum(values, 0.0))  # what is alike has none but for rounding

    def fitted(times: float) -> float:
        true = times * rng.standard_normal(len(information))
        pull = information @ true + root @ rng.standard_normal(len(information))
        z = np.linalg.solve(information + np.eye(len(information)), pull)
        return float(z @ z)

    assert np.mean([fitted(1.0) for _ in range(400)]) == pytest.approx(determined, rel=0.1)
    assert np.mean([fitted(3.0) for _ in range(400)]) > 6.0 * determined


def test_a_nuisance_at_its_bound_counts_as_twice_as_far(paper_fitter):
    count = len(paper_fitter.nuisances)
    z = np.full(count, 1.0)
    z[: count // 2] = 3.0
    squares = 9.0 * (count // 2) + count - count // 2
    assert paper_fitter.birge_ratio(z) == pytest.approx(squares / count)
    assert paper_fitter.birge_ratio(z, count) == pytest.approx((squares + 27.0 * (count // 2)) / count)
    few = np.where(np.arange(count) < 2, 3.0, 0.0)  # a small ratio of all
    assert paper_fitter.birge_ratio(few, 4.0) == pytest.approx(18.0 / 4.0)


def test_scatter_between_wheels_does_not_lower_the_birge_ratio():
    """A car whose set states six numbers: each of its brakes, motors and tyres has numbers of its own beside those."""
    stated = {"mass_kg": 1500.0, "wheelbase_m": 2.5, "rolling_radius_m": 0.3, "brake_gain_front_nm_pa": 2e-4}
    vehicle = load_vehicle(stated)
    case = prepare([log_of_pulses()], 0.3)
    fitter = Fitter(Simulator(case, vehicle), SampleMasks.of(case), nominal(vehicle), vehicle.nuisances, {})
    of_wheels = np.array([one.kind == "side_to_side" for one in vehicle.nuisances])
    assert of_wheels.sum() >= 16
    assert fitter.birge_ratio(np.where(of_wheels, 0.0, 2.0)) == pytest.approx(4.0)
    assert fitter.birge_ratio(np.where(of_wheels, 3.0, 0.0)) == 1.0


def test_the_discs_heat_matters_once_a_cause_reads_their_temperature():
    """Temperatures were as sure as if every car had the discs of the shipped one, and where a fade begins with them."""
    vehicle = load_vehicle({"mass_kg": 1500.0, "wheelbase_m": 2.5, "rolling_radius_m": 0.3} | GAINS)
    case = prepare([replace(log_of_pulses(), disc_temperature_k=650.0)], 0.3)
    numbers = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), False)
    bare, noise = numbers.fitter.start()
    (fade,) = (one for one in candidates(columns()) if one.name == "pad_temp_fade@front")
    fades = numbers.fitter.at(bare.z, (Term(fade, 2e-3),), noise)
    heat = [one.name for one in numbers.nuisances].index("friction_brake_heat_capacity_j_k_front")

    def acts(model):
        return (
            max(np.abs(values[:, heat]).max() for values in numbers.fitter.nuisance_jacobian_at(model).values()) > 0.0
        )

    assert not acts(bare)
    assert acts(fades)


def test_what_acts_is_found_among_what_does_not_by_few_replays(paper_fitter):
    simulator, names = paper_fitter.simulator, [one.name for one in paper_fitter.nuisances]
    base = simulator.run(paper_fitter.base)
    still = [k for k, name in enumerate(names) if "cooling" in name or "heat_capacity" in name]
    places, before = [*still, names.index("vehicle_mass_kg")], simulator.runs

    def stepped(some):
        return paper_fitter.parameter_set(np.isin(np.arange(len(names)), some).astype(float), ())

    assert len(still) > 2
    assert acting_among(simulator, base, stepped, still) == []
    assert simulator.runs == before + 1
    assert acting_among(simulator, base, stepped, places) == places[-1:]


def test_a_cause_is_compared_with_channels_of_the_same_inputs():
    """Inputs denoised anew moved every number that changes nothing, and all by the same signature."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    numbers = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), False)
    bare, noise = numbers.fitter.start()
    heavier = numbers.fitter.at(bare.z, (Term(_MASS, 100.0),), noise)
    anew, before = numbers.fitter.denoised(heavier), numbers.fitter.simulator.runs
    assert anew.nuisance_jacobian_at(heavier) is numbers.fitter.nuisance_jacobian
    assert numbers.fitter.simulator.runs == before + 2  # at the model, and all that change nothing together


def test_sensitivities_taken_lately_serve_again_where_cars_are_alike():
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    rig = Simulator(case, vehicle)
    numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, nominal(vehicle), True)
    z, heavy = np.zeros(len(numbers.nuisances)), _MASS

    def replays(z: np.ndarray, *terms: Term) -> int:
        before = rig.runs
        numbers.relinearise_cached(z, terms)
        return rig.runs - before

    bare = numbers.fitter.nuisance_jacobian
    assert replays(z) == 0
    assert replays(z, Term(heavy, 100.0)) > len(z) // 2
    beside = numbers.fitter.nuisance_jacobian
    assert replays(z + 0.4) == 0
    assert numbers.fitter.nuisance_jacobian is bare
    numbers.relinearise(z + 0.4)  # a fit of the numbers asks for its own
    assert numbers.fitter.nuisance_jacobian is not bare
    assert replays(z, Term(heavy, 110.0)) == 0
    assert numbers.fitter.nuisance_jacobian is beside
    assert replays(z, Term(heavy, 150.0)) > len(z) // 2
    assert replays(z, Term(heavy, 150.0, (0, 1.0))) > len(z) // 2
    assert replays(z + 1.0) > len(z) // 2


@pytest.mark.parametrize(("stated_k", "deviation_k"), [(350.0, DISC_MEASURED_SD_K), (None, DISC_ASSUMED_SD_K)])
def test_discs_whose_temperature_is_logged_are_known_better(stated_k, deviation_k):
    vehicle = paper_car()
    case = prepare([replace(log_of_pulses(), disc_temperature_k=stated_k)], 0.308)
    numbers = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), True)
    (disc,) = (one for one in numbers.nuisances if one.name == "disc_temperature_k")
    assert disc.step == (deviation_k,)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_dead_time_is_estimated_on_either_side(side):
    """It acts from step to step; a fit that keeps to one side leaves the other to effects."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    base = nominal(vehicle)
    rig = Simulator(case, vehicle)
    names = [nuisance.name for nuisance in vehicle.nuisances]
    at = names.index("ehb_dead_time_s")
    off = np.where(np.arange(len(names)) == at, side * 0.6, 0.0)
    simulated = rig.run(base.with_nuisances(vehicle.nuisances, off))["pressure"]
    (drive,) = case.recordings
    drive.measured["pressure"][:] = simulated + NOISE_PA * np.random.default_rng(1).standard_normal(simulated.shape)
    numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True)
    model, _ = numbers.fit(*numbers.fitter.start())
    assert np.sign(model.z[at]) == side  # how much of it is latency, one log leaves open
    left = drive.measured["pressure"] - model.channels["pressure"]
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE_PA


def test_a_fit_leaves_the_fitter_that_it_began_with_as_it_was():
    """Steps update the Jacobian; who remembers the one at the nominal vehicle goes on from there."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    fit = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), False)
    before = fit.fitter
    taken = {name: values.copy() for name, values in before.nuisance_jacobian.items()}
    _, noise = before.start()
    start = before.at(np.full(len(before.nuisances), 0.3), (), noise)
    fit.fit(start, noise)
    assert fit.fitter.updated
    assert not before.updated
    assert all(np.array_equal(values, taken[name]) for name, values in before.nuisance_jacobian.items())
