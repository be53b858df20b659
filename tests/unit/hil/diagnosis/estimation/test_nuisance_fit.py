"""The vehicle's numbers: how strained a model is, and a fit that no single number blocks."""

from dataclasses import replace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.gauss_newton import Fitter, Term, birge_ratio
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import DISC_ASSUMED_SD_K, DISC_MEASURED_SD_K, nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle, paper_car

NOISE_PA = 2e3
GAINS = {"brake_gain_front_nm_pa": 2e-4, "brake_gain_rear_nm_pa": 1e-4}
(_MASS,) = (one for one in candidates(columns()) if one.name == "mass_offset@car")


def test_numbers_within_their_tolerance_strain_nothing():
    rng = np.random.default_rng(3)
    assert birge_ratio(np.zeros(50)) == 1.0
    assert birge_ratio(0.5 * rng.standard_normal(50)) == 1.0
    assert birge_ratio(np.full(50, 2.0)) == pytest.approx(4.0)


def test_numbers_that_data_say_nothing_of_do_not_hide_a_strain():
    z = np.concatenate((np.full(10, 2.0), np.zeros(40)))
    assert birge_ratio(z) == 1.0
    assert birge_ratio(z, told=10.0) == pytest.approx(4.0)


@pytest.mark.slow
def test_squares_of_right_numbers_add_up_to_what_the_data_tell_of_them():
    """Fitted to data made with numbers drawn by their tolerance; three times as far, the sum is many times that."""
    vehicle = paper_car()
    log = log_of_pulses()
    case = prepare([log], 0.308)
    frame = SampleMasks.of(case)
    numbers = NuisanceFit(Simulator(case, vehicle), frame, vehicle, nominal(vehicle), False)
    numbers.relinearise(np.zeros(len(numbers.nuisances)))
    noise = numbers.fitter.start()[1]
    told, rng = numbers.fitter.effective_parameters(noise), np.random.default_rng(11)
    assert 1.0 < told < len(numbers.nuisances)
    information = numbers.fitter.nuisance_information(noise)
    root = np.linalg.cholesky(information + 1e-9 * np.eye(len(information)))

    def fitted(times: float) -> float:
        true = times * rng.standard_normal(len(information))
        pull = information @ true + root @ rng.standard_normal(len(information))
        z = np.linalg.solve(information + np.eye(len(information)), pull)
        return float(z @ z)

    assert np.mean([fitted(1.0) for _ in range(400)]) == pytest.approx(told, rel=0.1)
    assert np.mean([fitted(3.0) for _ in range(400)]) > 6.0 * told


def test_a_strained_number_at_its_end_wants_to_go_on():
    z = np.array([3.0, 1.0, 1.0, 1.0])
    assert birge_ratio(z) == pytest.approx(3.0)
    assert birge_ratio(z, np.full(4, 3.0)) == pytest.approx((4 * 9.0 + 3.0) / 4)
    assert birge_ratio(z / 3.0, np.full(4, 1.0)) == 1.0  # little strained


def test_what_single_wheels_are_off_makes_light_of_no_strain():
    """A car whose set states six numbers: each of its brakes, motors and tyres has numbers of its own beside those."""
    stated = {"mass_kg": 1500.0, "wheelbase_m": 2.5, "rolling_radius_m": 0.3, "brake_gain_front_nm_pa": 2e-4}
    vehicle = load_vehicle(stated)
    case = prepare([log_of_pulses()], 0.3)
    fitter = Fitter(Simulator(case, vehicle), SampleMasks.of(case), nominal(vehicle), vehicle.nuisances, {})
    of_wheels = np.array([one.kind == "scatter" for one in vehicle.nuisances])
    assert of_wheels.sum() >= 16
    assert fitter.birge_ratio(np.where(of_wheels, 0.0, 2.0)) == pytest.approx(4.0)
    assert fitter.birge_ratio(np.where(of_wheels, 3.0, 0.0)) == 1.0


def test_the_discs_heat_matters_once_a_cause_reads_their_temperature():
    """Temperatures were as sure as if every car had the discs of the shipped one, and where a fade begins with them."""
    vehicle = load_vehicle({"mass_kg": 1500.0, "wheelbase_m": 2.5, "rolling_radius_m": 0.3} | GAINS)
    case = prepare([replace(log_of_pulses(), disc_temperature_k=650.0)], 0.3)
    numbers = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), False)
    numbers.relinearise(np.zeros(len(numbers.nuisances)))
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

    assert replays(z) > len(z)
    bare = numbers.fitter.nuisance_jacobian
    assert replays(z, Term(heavy, 100.0)) > len(z)
    beside = numbers.fitter.nuisance_jacobian
    assert replays(z + 0.4) == 0
    assert numbers.fitter.nuisance_jacobian is bare
    numbers.relinearise(z + 0.4)  # a fit of the numbers asks for its own
    assert numbers.fitter.nuisance_jacobian is not bare
    assert replays(z, Term(heavy, 110.0)) == 0
    assert numbers.fitter.nuisance_jacobian is beside
    assert replays(z, Term(heavy, 150.0)) > len(z)
    assert replays(z, Term(heavy, 150.0, (0, 1.0))) > len(z)
    assert replays(z + 1.0) > len(z)


@pytest.mark.parametrize(("told_k", "deviation_k"), [(350.0, DISC_MEASURED_SD_K), (None, DISC_ASSUMED_SD_K)])
def test_discs_whose_temperature_is_told_are_known_better(told_k, deviation_k):
    vehicle = paper_car()
    case = prepare([replace(log_of_pulses(), disc_temperature_k=told_k)], 0.308)
    numbers = NuisanceFit(Simulator(case, vehicle), SampleMasks.of(case), vehicle, nominal(vehicle), True)
    (disc,) = (one for one in numbers.nuisances if one.name == "disc_temperature_k")
    assert disc.step == (deviation_k,)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_dead_time_is_found_on_either_side(side):
    """It acts from step to step; a fit that keeps to one side leaves the other to effects."""
    vehicle = paper_car()
    case = prepare([log_of_pulses()], 0.308)
    base = nominal(vehicle)
    rig = Simulator(case, vehicle)
    names = [nuisance.name for nuisance in NuisanceFit(rig, SampleMasks.of(case), vehicle, base, True).nuisances]
    at = names.index("ehb_dead_time_s")
    numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True)
    off = np.where(np.arange(len(names)) == at, side * 0.6, 0.0)
    told = rig.run(base.with_nuisances(numbers.nuisances, off))["pressure"]
    (drive,) = case.recordings
    drive.measured["pressure"][:] = told + NOISE_PA * np.random.default_rng(1).standard_normal(told.shape)
    numbers.relinearise(np.zeros(len(names)))
    model, _ = numbers.fit(*numbers.fitter.start())
    assert np.sign(model.z[at]) == side  # how much of it is latency, one log leaves open
    left = drive.measured["pressure"] - model.channels["pressure"]
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE_PA
