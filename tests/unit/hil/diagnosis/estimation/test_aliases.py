"""Aliases: terms that change the parameter of a nuisance, resolved to the most likely split."""

import numpy as np
import pytest

from hil.diagnosis.estimation.aliases import alias_of, resolve_aliases
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.load import paper_car
from hil.diagnosis.vehicle.priors import recording_nuisances

VEHICLE = paper_car()
BASE = nominal(VEHICLE)
CANDIDATES = {candidate.name: candidate for candidate in candidates(columns())}


def _model(name: str, value: float, z: float, number: str) -> tuple[Model, int]:
    at = next(k for k, nuisance in enumerate(VEHICLE.nuisances) if nuisance.name == number)
    moved = np.zeros(len(VEHICLE.nuisances))
    moved[at] = z
    return Model(moved, (Term(CANDIDATES[name], value),), {}, 100.0 + z * z, np.zeros((0, 0))), at


def _number(model: Model, at: int) -> float:
    return float(BASE.with_nuisances(VEHICLE.nuisances, model.z).p[VEHICLE.nuisances[at].at[0]])


@pytest.mark.parametrize(("name", "number", "slope"), [
    ("mass_offset@car", "vehicle_mass_kg", 1.0),
    ("ehb_dead_time@car", "ehb_dead_time_s", 1.0),
    ("motor_tau@car", "motor_time_constant_s", 1.0),
    ("rotating_inertia@car", "wheel_inertia_kg_m2", 1.0),
    ("ehb_bandwidth.frequency@car", "ehb_natural_frequency_hz", VEHICLE.parameters.ehb.natural_frequency_hz),
])  # fmt: skip
def test_a_term_is_an_alias_of_a_nuisance(name, number, slope):
    candidate = CANDIDATES[name]
    same = alias_of(Term(candidate, 0.2 * candidate.parameter.typical), VEHICLE.nuisances, BASE)
    assert same is not None
    nuisance = VEHICLE.nuisances[same.nuisance]
    assert nuisance.name == number
    assert same.slope == pytest.approx(slope)
    assert same.deviation(VEHICLE.nuisances) == pytest.approx(abs(nuisance.step[0] / slope))


@pytest.mark.parametrize("node", ["imu", "pressure", "motor"])
def test_stamps_of_a_node_that_are_late_are_its_latency(node):
    """Late by 45 ms, of which a latency at its bound had taken 6: nearly all is the term's."""
    nuisances = (*VEHICLE.nuisances, *recording_nuisances(True, VEHICLE.latencies))
    at = next(k for k, nuisance in enumerate(nuisances) if nuisance.name == f"late_{node}")
    z = np.zeros(len(nuisances))
    z[at] = 3.0
    term = Term(CANDIDATES[f"timestamp_offset@{node}"], 0.039)
    resolved = resolve_aliases(Model(z, (term,), {}, 9.0, np.zeros((0, 0))), nuisances, BASE)
    late = BASE.with_nuisances(nuisances, resolved.z).latency_s[nuisances[at].at[0]]
    assert resolved.terms[0].value + late == pytest.approx(0.045)
    assert abs(late) < 5e-4
    same = alias_of(term, nuisances, BASE)
    assert same is not None
    assert same.deviation(nuisances) == pytest.approx(2e-3)


def test_stamps_of_the_wheels_are_no_latency():
    """The clock of all others is relative to theirs."""
    nuisances = (*VEHICLE.nuisances, *recording_nuisances(True, VEHICLE.latencies))
    assert alias_of(Term(CANDIDATES["timestamp_offset@wheel"], 0.02), nuisances, BASE) is None


@pytest.mark.parametrize("name", ["pad_mu_gain@fl", "road_grade@car", "imu_bias.ax_mps2@car", "slip_stiffness@car"])
def test_other_terms_have_no_alias(name):
    candidate = CANDIDATES[name]
    assert alias_of(Term(candidate, 0.2 * candidate.parameter.typical), VEHICLE.nuisances, BASE) is None


def test_the_car_stays_and_the_number_goes_back_to_what_is_stated():
    """6 ms by the term and three standard deviations by the nuisance: most of both is the term's."""
    model, at = _model("ehb_dead_time@car", 0.006, 3.0, "ehb_dead_time_s")
    resolved = resolve_aliases(model, VEHICLE.nuisances, BASE)
    assert abs(resolved.z[at]) < 0.3
    assert resolved.terms[0].value + _number(resolved, at) == pytest.approx(0.006 + _number(model, at))
    assert resolved.cost == pytest.approx(100.0 + resolved.z[at] ** 2)
    again = resolve_aliases(resolved, VEHICLE.nuisances, BASE)
    assert again.terms[0].value == pytest.approx(resolved.terms[0].value)


def test_a_share_is_of_what_the_number_is_now():
    model, at = _model("ehb_bandwidth.frequency@car", -0.2, 2.0, "ehb_natural_frequency_hz")
    resolved = resolve_aliases(model, VEHICLE.nuisances, BASE)
    assert _number(resolved, at) * (1.0 + resolved.terms[0].value) == pytest.approx(_number(model, at) * 0.8)


def test_what_no_value_of_the_cause_can_make_stays_as_it_is():
    low = CANDIDATES["rotating_inertia@car"].parameter.low
    model, _ = _model("rotating_inertia@car", low, -3.0, "wheel_inertia_kg_m2")
    assert resolve_aliases(model, VEHICLE.nuisances, BASE) is model
