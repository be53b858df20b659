"""Scores of cars that strangers wrote, on records whose answer is right, tied, beside something false, or wrong."""

from typing import Any

import pytest

from hil.validation.blind_trials.misses import misses
from hil.validation.blind_trials.score import table_of
from hil.validation.blind_trials.strangers import SAME_NUMBER, held_out_worse, is_right, something_false
from hil.validation.strangers.cases import CARS
from plant.injection.theta import THETA

HIDDEN = {"effect": "front_pads_weak", "location": "first", "parameters": {"size": {"value": -0.1, "unit": "1"}}}


def _record(*named: str, rivals: tuple[str, ...] = (), hidden: bool = True, **more: Any) -> dict[str, Any]:
    """Named and rivals as ``effect@location``."""
    causes = [{"effect": n.split("@")[0], "location": n.split("@")[1], "parameters": {}} for n in named]
    return {
        "family": "strangers_single" if hidden else "strangers", "index": 3, "size": None, "sources": "abc",
        "car": "first", "reached": True, "causes": causes, "named": [c["effect"] for c in causes],
        "rivals": [rival.split("@")[0] for rival in rivals], "rivals_at": list(rivals),
        "verdict": "cannot_tell_apart" if rivals else "named" if named else "none", "held_out_error": {},
        "hidden": [HIDDEN] if hidden else [], "accepted": ["pad_mu_gain@front", "imu_bias"] if hidden else [],
    } | more  # fmt: skip


@pytest.mark.parametrize(
    ("record", "right", "false"),
    [
        (_record("pad_mu_gain@front"), True, False),
        (_record("imu_bias@car"), True, False),  # accepted wherever it is
        (_record("pad_mu_gain@rear"), False, True),
        (_record("pad_mu_gain@front", "motor_tau@car"), True, True),
        (_record("motor_tau@car", "pad_mu_gain@front"), False, True),
        (_record("mass_offset@car", rivals=("pad_mu_gain@front",)), True, False),
        (_record("mass_offset@car", rivals=("pad_mu_gain@rear",)), False, True),
        (_record("mass_offset@car", "motor_tau@car", rivals=("pad_mu_gain@front",)), True, True),
        (_record("mass_offset@car", rivals=("pad_mu_gain@front",), verdict="named"), False, True),
        (_record(), False, False),
    ],
)
def test_the_hidden_cause_counts_first_or_tied_and_by_its_place(record, right, false) -> None:
    assert (is_right(record), something_false(record)) == (right, false)


def test_a_held_out_error_is_worse_than_without_causes_by_more_than_a_hundredth() -> None:
    errors = {"ax_mps2": {"before": 3.0, "tuned": 1.0, "after": 1.009}}
    assert not held_out_worse(_record(held_out_error=errors))
    errors |= {"wheel_speed": {"before": 3.0, "tuned": 1.0, "after": 1.02}}
    assert held_out_worse(_record(held_out_error=errors))


def test_any_cause_is_a_false_alarm_where_nothing_is_hidden() -> None:
    records = [_record(hidden=False), _record(hidden=False, car="second"), _record("motor_tau@car", hidden=False)]
    entry = table_of("strangers", records)
    values = {name: metric["value"] for name, metric in entry["metrics"].items()}
    third = pytest.approx(1 / 3)
    assert values == {
        "false_alarm": third, "false_alarm_first": 0.5, "false_alarm_second": 0.0, "held_out_worse": 0.0,
    }  # fmt: skip
    assert (entry["metrics"]["false_alarm"]["met"], entry["metrics"]["held_out_worse"]["met"]) == (False, True)
    assert entry["missed"] == ["3 first: nothing hidden; answered motor_tau@car"]


def test_singles_are_scored_against_the_marks() -> None:
    records = [_record("pad_mu_gain@front")] * 7 + [_record("mass_offset@car")] * 2 + [_record()]
    metrics = table_of("strangers_single", [*records, _record(reached=False)])["metrics"]
    assert (metrics["right"]["value"], metrics["right"]["met"]) == (0.7, True)
    assert metrics["right_first"]["value"] == 0.7
    assert (metrics["something_false"]["value"], metrics["something_false"]["met"]) == (0.2, False)
    assert metrics["false_beside_the_right"]["value"] == 0.0
    assert metrics["nothing_named"]["value"] == 0.1
    assert len(misses("strangers_single", records)) == 3
    assert misses("strangers_single", records)[-1] == "3: front_pads_weak@first -0.1 1; answered none"


def test_numbers_of_right_first_causes_are_compared_where_they_are_the_same_number() -> None:
    def named(effect: str, name: str, value: float, half: float, **more: Any) -> dict[str, Any]:
        found = {"value": value, "ci95": [value - half, value + half]}
        record = _record(f"{effect}@front", accepted=["pad_mu_gain@front", "stuck_corner@front"], **more)
        record["causes"][0]["parameters"] = {name: found}
        return record

    records = [
        named("pad_mu_gain", "gain", -0.11, 0.02), named("stuck_corner", "loss", 0.13, 0.02),
        named("mass_offset", "mass_kg", 90.0, 1.0, rivals=("pad_mu_gain@front",)), _record(),
    ]  # fmt: skip
    metrics = table_of("strangers_single", records)["metrics"]
    assert metrics["size_error"]["value"] == pytest.approx(0.2)
    assert (metrics["size_error"]["met"], metrics["size_coverage95"]["met"]) == (False, False)
    assert metrics["size_coverage95"]["value"] == 0.5


def test_every_cause_with_a_size_is_one_of_a_car_and_what_it_is_compared_with_a_right_answer() -> None:
    causes = {cause.name: cause for car in CARS.values() for cause in car.causes.values()}
    for name, same in SAME_NUMBER.items():
        accepted = {answer.split("@")[0] for answer in causes[name].accepted}
        numbers = [number.split(".") for number in same]
        assert all(THETA.effect(effect).parameter(parameter) for effect, parameter in numbers)
        assert accepted & {effect for effect, _ in numbers}
