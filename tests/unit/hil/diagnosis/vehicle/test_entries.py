"""Every documented key with every kind of entry: a car as stated, or a refusal that says what to do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.keys import ALIASES, DERIVED, LINE, SPECIAL
from hil.diagnosis.vehicle.latency import ALL_NODES
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle
from plant.vectors import PARAMETER, P

SIX = {
    "mass_kg": 1800.0, "wheelbase_m": 2.8, "cog_to_front_axle_m": 1.3, "rolling_radius_m": 0.33,
    "brake_gain_front_nm_pa": 2.5e-4, "brake_gain_rear_nm_pa": 1.2e-4,
}  # fmt: skip
KEYS = sorted({*ALIASES, *DERIVED, *SPECIAL, *PARAMETER.sizes})
NO_NUMBERS = [math.nan, math.inf, -math.inf, "narrow", True, [], {"value": 1.0}, [1.0, "x"]]
OF_CAR = (NuisanceKind.VEHICLE, NuisanceKind.SIGNED)


def outcome(entries: dict[str, object]) -> Vehicle | str:
    """The car, found to be sound, or the refusal, found to be whole."""
    try:
        car = load_vehicle(SIX | entries)
    except UnusableError as error:
        text = str(error)
        assert "expected" in text
        assert "got" in text
        assert "; " in text, "what to do"
        assert any(key in text or ALIASES.get(key, key) in text for key in entries), text
        return text
    assert np.isfinite(car.p).all()
    names = [one.name for one in car.nuisances]
    assert len(set(names)) == len(names)
    for one in car.nuisances:
        assert all(np.isfinite(step) and step != 0.0 for step in one.step), one
        assert one.lower <= 0.0 <= one.upper > one.lower, one
    for z in ([one.lower for one in car.nuisances], [one.upper for one in car.nuisances]):
        p = nominal(car).with_nuisances(car.nuisances, np.array(z)).p
        assert np.isfinite(p).all()
        assert (p[P.friction_brake_threshold_pressure_pa :][:2] >= 0.0).all()
        assert (p[[P.vehicle_drag_coefficient, P.vehicle_rolling_resistance, P.ehb_dead_time_s]] >= 0.0).all()
    return car


@pytest.mark.parametrize("entry", NO_NUMBERS, ids=repr)
def test_what_is_no_number_is_refused_under_every_key(entry: object) -> None:
    for key in KEYS:
        for name in (key, f"{key}_tolerance"):
            assert isinstance(outcome({name: entry}), str), name


@pytest.mark.parametrize("value", [0.0, -1.0, 1.0, [0.4, 0.5], [1.0, 1.0, 1.0]], ids=repr)
def test_every_value_is_taken_as_stated_or_refused(value: float | list[float]) -> None:
    for key in KEYS:
        car = outcome({key: value})
        name = ALIASES.get(key, key)
        if not isinstance(car, Vehicle) or name not in PARAMETER.sizes:
            continue
        own = car.p[PARAMETER.slice(name)]
        stated = float(np.mean(value)) if len(own) == 1 else value
        assert own.tolist() == pytest.approx(np.broadcast_to(stated, own.shape).tolist()), key


def test_a_tolerance_of_zero_says_known_exactly_and_changes_nothing_else() -> None:
    """As a number beside it that is no longer one of either sign, or one that is dropped with it."""
    base = {one.name: one for one in load_vehicle(SIX).nuisances}
    for key in KEYS:
        car = outcome({f"{key}_tolerance": 0.0})
        assert isinstance(car, Vehicle), key
        own = {one.name: one for one in car.nuisances}
        stem = DERIVED[key][0] if key in DERIVED else ALIASES.get(key, key)
        members = PARAMETER.slice(stem) if stem in PARAMETER.sizes else slice(0, 0)
        exact = {
            name
            for name, one in base.items()
            if one.kind in OF_CAR and not set(one.at).isdisjoint(range(members.start, members.stop))
        }
        exact |= {"vehicle_cog_to_axle_m"} if stem.startswith(("cog", "front_weight")) else set()
        if stem.startswith("brake_gain"):
            exact.add(stem)
        elif stem == "tyre_lky":  # whose state decides whether each axle has its own
            exact |= {f"vehicle_slip_angle_share_{axle}" for axle in ("front", "rear")}
        elif stem == "tyre_lmux":  # a set that states friction has tyres of the Magic Formula
            exact.add("tyre_partial_sliding")
        gone = base.keys() - own.keys()
        assert gone <= exact, key
        assert gone == exact or key in DERIVED or "piston_area" in stem, key  # one axle's alone; the brake gains'
        for name in base.keys() & own.keys():
            if (stem, name) == ("tyre_lmux", "tyre_friction_load"):
                continue  # known better beside a stated friction
            was, now = base[name], own[name]
            assert (now.kind, now.step, now.lower, now.upper) == (was.kind, was.step, was.lower, was.upper), (key, name)


@pytest.mark.parametrize("key", [*KEYS, ALL_NODES, LINE])
def test_a_negative_tolerance_or_too_long_a_list_is_refused(key: str) -> None:
    for bad in (-1.0, [0.1] * 7):
        assert "half-width" in str(outcome({f"{key}_tolerance": bad})) or key in DERIVED


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(
    st.sampled_from([name for key in KEYS for name in (key, f"{key}_tolerance")]),
    st.one_of(st.sampled_from([0.0, 1e-3, 1.0, 20.0]), st.floats(), st.lists(st.floats(-2.0, 2.0), max_size=4)),
    min_size=1, max_size=4,
))  # fmt: skip
def test_entries_together_are_taken_or_refused(entries: dict[str, object]) -> None:
    outcome(entries)


@pytest.mark.parametrize("tolerance", [0.0, 2e4])
def test_calipers_that_grip_at_once_never_grip_before(tolerance: float) -> None:
    car = outcome({"threshold_pressure_pa": 0.0, "threshold_pressure_pa_tolerance": tolerance})
    own = [one for one in car.nuisances if one.name.startswith("friction_brake_threshold")]
    assert [one.lower for one in own] == ([0.0] if tolerance else [])


def test_one_stated_axle_says_nothing_of_the_other() -> None:
    lift = {
        one.name: one.step[0]
        for one in load_vehicle(SIX | {"lift_front": 0.1, "lift_front_tolerance": 0.0}).nuisances
        if "lift" in one.name
    }
    assert lift == {"vehicle_lift_coefficient_rear": HALF_WIDTH_TO_SIGMA * 0.1}


@pytest.mark.parametrize(("key", "half", "step"), [
    ("cog_to_front_axle_m", 0.02, 0.01), ("cog_to_rear_axle_m", 0.02, 0.01), ("front_weight_share", 0.01, 0.014),
])  # fmt: skip
def test_the_centre_of_gravity_has_the_tolerance_of_whichever_key_states_it(key, half, step):
    car = load_vehicle(SIX | {f"{key}_tolerance": half})
    (cog,) = (one for one in car.nuisances if one.name == "vehicle_cog_to_axle_m")
    assert cog.step == pytest.approx((step, -step))


def test_keys_that_contradict_each_other_are_refused() -> None:
    assert "front_weight_share: expected 0.5357" in str(outcome({"front_weight_share": 0.4}))
    assert isinstance(outcome({"cog_to_rear_axle_m": 1.5, "front_weight_share": 0.536}), Vehicle)
    assert "motor_fade_start_mps: expected more than motor_fade_end_mps" in str(outcome({"motor_fade_end_mps": 8.0}))


def test_tolerances_that_no_fit_uses_are_told() -> None:
    remarks = load_vehicle(SIX | {"track_m_tolerance": 0.01, "mass_kg_tolerance": 5.0}).remarks
    assert any(text.endswith("whatever their tolerance: vehicle_track_m") for text in remarks)


def test_of_two_stated_axles_the_larger_tolerance_counts_for_both() -> None:
    discs = {"disc_heat_front_j_k": 3000.0, "disc_heat_front_j_k_tolerance": 900.0, "disc_heat_rear_j_k": 2000.0}
    for rear, half in ((700.0, 900.0), (0.0, 0.0)):
        car = load_vehicle(SIX | discs | {"disc_heat_rear_j_k_tolerance": rear})
        by_name = {one.name: one.step[0] for one in car.nuisances}
        assert by_name["friction_brake_heat_capacity_j_k_front"] == pytest.approx(HALF_WIDTH_TO_SIGMA * 900.0)
        own = by_name.get("friction_brake_heat_capacity_j_k_rear")
        assert own == (pytest.approx(HALF_WIDTH_TO_SIGMA * half) if rear else None)
