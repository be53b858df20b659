"""Numbers that moved: by the key of the set, in its unit, with what was stated, the interval and the deviations."""

from types import SimpleNamespace

import numpy as np
import pytest
from pulses import log_of_pulses

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.result.headline import headline
from hil.diagnosis.result.moved_numbers import MOST_SHOWN, moved_numbers, shown_numbers
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.key_names import quantity, stated_key, stated_keys
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.diagnosis.vehicle.priors import recording_nuisances

SIX = {
    "mass_kg": 1650.0, "mass_kg_tolerance": 30.0, "wheelbase_m": 2.72, "cog_from_front_m": 1.3, "tyre_radius_m": 0.318,
    "brake_gain_front_nm_pa": 2.9e-4, "brake_gain_rear_nm_pa": 1.7e-4, "slip_stiffness": 22.3,
}  # fmt: skip


@pytest.fixture(scope="module")
def diagnosis():
    vehicle = load_vehicle(SIX)
    rig = Simulator(prepare([log_of_pulses()], 0.318), vehicle)
    fitter = NuisanceFit(rig, SampleMasks.of(rig.dataset), vehicle, nominal(vehicle), relinearise=True).fitter
    model, noise = fitter.start()
    return SimpleNamespace(fitter=fitter, vehicle=vehicle, final=model, noise=noise)


def _moved(diagnosis, **by_name):
    z = np.array([by_name.get(one.name, 0.0) for one in diagnosis.fitter.nuisances])
    final = SimpleNamespace(z=z, terms=(), residual=diagnosis.final.residual)
    return moved_numbers(SimpleNamespace(**{**vars(diagnosis), "final": final}))


def test_a_stated_number_has_its_key_value_and_tolerance(diagnosis):
    mass, *others = _moved(diagnosis, vehicle_mass_kg=-1.5)
    assert (mass.key, mass.quantity.unit, mass.stated) == ("mass_kg", "kg", True)
    assert (mass.nominal, mass.half_width, mass.estimate) == (1650.0, 30.0, pytest.approx(1627.5))
    assert mass.low < mass.estimate < mass.high
    assert mass.deviations == -1.5
    assert not mass.beyond_tolerance
    assert all(one.deviations == 0.0 for one in others)


def test_numbers_carry_the_key_as_the_set_writes_it_and_its_unit(diagnosis):
    by_key = {one.key: one for one in _moved(diagnosis, tyre_lkx=1.0, brake_gain_front=1.0)}
    assert by_key["slip_stiffness"].nominal == pytest.approx(22.3)
    assert by_key["slip_stiffness"].stated
    assert by_key["brake_gain_front_nm_pa"].nominal == pytest.approx(2.9e-4)
    assert by_key["brake_gain_front_nm_pa"].half_width == pytest.approx(2.9e-6)
    assert by_key["cog_from_front_m"].nominal == pytest.approx(1.3)
    assert by_key["tyre_radius_m"].stated
    assert not by_key["wheel_inertia_kg_m2"].stated


def test_what_the_data_know_better_than_the_prior_has_a_narrower_interval(diagnosis):
    by_key = {one.key: one for one in _moved(diagnosis)}
    radius = by_key["tyre_radius_m"]
    assert radius.high - radius.low < 1.9 * radius.half_width
    assert all(one.low <= one.estimate <= one.high for one in by_key.values() if isinstance(one.low, float))


def test_at_most_twelve_are_shown_and_the_others_counted(diagnosis):
    names = [one.name for one in diagnosis.fitter.nuisances if one.upper >= 1.5][:20]
    shown, others = shown_numbers(listed := _moved(diagnosis, **dict.fromkeys(names, 1.5)))
    assert (len(shown), others) == (MOST_SHOWN, len(listed) - MOST_SHOWN)


def test_a_number_that_was_never_stated_is_not_within_stated_tolerances(diagnosis):
    """A wheel inertia moved from 1.5 to 2.57, and the answer said 'within stated tolerances'."""
    inertia = _moved(diagnosis, wheel_inertia_kg_m2=2.0)
    assert headline("none", [], [], _moved(diagnosis)) == "Nothing beyond noise and the stated tolerances."
    text = headline("none", [], [], inertia)
    assert "not stated: inertia of a wheel with all that turns with it from 1.5 to" in text
    beyond = headline("none", [], [], _moved(diagnosis, vehicle_mass_kg=2.5))
    assert "within" not in beyond
    assert "beyond their stated tolerance: mass of the car from 1650 to 1690 kg" in beyond


@pytest.mark.parametrize("vehicle", [paper_car(), load_vehicle(SIX)], ids=["shipped", "six"])
def test_every_number_has_plain_words_and_a_key_that_a_set_may_hold(vehicle):
    tolerances = {}
    for nuisance in (*vehicle.nuisances, *recording_nuisances(True, vehicle.latencies)):
        what = quantity(nuisance, vehicle)
        assert what.what
        assert "_" not in what.what, nuisance.name
        if what.key and what.has_value and "latency" not in what.key:
            stated = stated_keys({what.key: 1.0})
            assert stated_key(nuisance, what, stated) == what.key, nuisance.name
            tolerances[f"{what.key}_tolerance"] = 1e-3
    assert not [text for text in load_vehicle(SIX | tolerances).remarks if "unknown key" in text]
