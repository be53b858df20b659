"""Scores of blind trials, each on records that meet its mark and on records that miss it."""

from typing import Any

import pytest

from hil.validation.blind_trials import FAMILIES
from hil.validation.blind_trials.metrics import median, wilson
from hil.validation.blind_trials.score import table_of

CHANNELS = ("ax_mps2", "wheel_speed")


def _cause(effect: str, joint: str = "", chance: float = 0.9, onset_s: float | None = None) -> dict[str, Any]:
    numbers = {"gain": {"value": 0.11, "unit": "", "ci95": [0.09, 0.12]}}
    return {
        "effect": effect, "injection_point": joint, "location": "car", "parameters": numbers, "probability": chance,
        "onset_s": onset_s,
    }  # fmt: skip


def _record(hidden: str | list[str], named: list[str], **more: Any) -> dict[str, Any]:
    effects, number = [hidden] if isinstance(hidden, str) else hidden, {"gain": {"value": 0.1, "unit": ""}}
    record = {
        "family": "single", "index": 0, "size": 15.0, "sources": "abc", "car": "a", "accepted": effects,
        "rivals_at": [],
        "reached": True, "noise": "medium", "named": named,
        "rivals": [], "undetectable_effects": [], "held_out_error": {}, "verdict": "named" if named else "none",
        "hidden": [
            {
                "effect": e, "location": "car", "injection_point": "friction.mu", "onset_s": None,
                "parameters": dict(number),
            } for e in effects
        ],
        "causes": [_cause(effect) for effect in named],
    }  # fmt: skip
    return record | more


def _metrics(family: str, records: list[dict[str, Any]]) -> dict[str, Any]:
    return table_of(family, records)["metrics"]


def _values(family: str, records: list[dict[str, Any]]) -> dict[str, float]:
    return {name: m["value"] for name, m in _metrics(family, records).items()}


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_has_scores_and_none_where_there_is_no_case(family: str) -> None:
    entry = table_of(family, [])
    assert entry["n"] == 0
    for metric in entry["metrics"].values():
        assert set(metric) == {"value", "low", "high", "pass_mark", "met"}
        assert metric["value"] is None
        assert metric["met"] is None


def test_wilson_intervals_hold_the_share() -> None:
    low, high = wilson(3, 300)
    assert (low, high) == pytest.approx((0.0034, 0.0289), abs=2e-4)  # Newcombe 1998's formula 3
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_interval_of_a_median_lies_between_order_statistics() -> None:
    entry = median([float(k) for k in range(1, 11)])
    assert (entry["low"], entry["value"], entry["high"]) == (2.0, 5.5, 9.0)  # 2nd and 9th of 10
    one = median([3.0], 2.0, at_most=True)
    assert (one["low"], one["high"], one["met"]) == (3.0, 3.0, False)


def test_a_null_case_with_a_cause_is_an_alarm() -> None:
    metrics = _metrics("null", [_record([], []), _record([], ["mass_offset"], noise="high")])
    assert metrics["false_alarm"]["value"] == 0.5
    assert metrics["false_alarm"]["met"] is False
    assert metrics["false_alarm_medium_noise"]["value"] == 0.0
    assert metrics["false_alarm_high_noise"]["value"] == 1.0
    assert _metrics("null", [_record([], [])])["false_alarm"]["met"] is True


def test_single_cases_count_the_first_name() -> None:
    records = [_record("a", ["a"]), _record("a", ["b"], rivals=["a"]), _record("a", ["a", "b"]), _record("a", [])]
    values = _values("single", [*records, _record("a", [], reached=False)])
    probability = {"isolation_probability_snr15": (0.9 + 0.0 + 0.5) / 3, "isolation_probability_of_all_snr15": 0.35}
    assert values == pytest.approx(
        {"detected_snr15": 0.75, "top1_snr15": 0.5, "top1_of_all_snr15": 0.5, "in_set_snr15": 0.75} | probability
    )


def test_a_rival_has_its_share_of_the_isolation_probability() -> None:
    tied = _record("a", ["b"], rivals=["a", "c"], rival_probabilities=[0.06, 0.04])
    metrics = _metrics("single", [tied, _record("a", ["a"])])
    assert metrics["isolation_probability_snr15"]["value"] == pytest.approx((0.06 + 0.9) / 2)
    assert 0.0 < metrics["isolation_probability_snr15"]["low"] <= 0.06


def test_the_first_name_is_asked_for_only_where_causes_can_be_told_apart() -> None:
    """A rolling resistance of the front axle and a drag of it leave a d' of 2 to 3 at a ratio of 15."""
    tied = _record("rolling_resistance", ["residual_drag"], rivals=["rolling_resistance"], noise="low")
    tied["hidden"][0]["location"] = "front"
    entry = table_of("single", [tied, _record("mass_offset", ["mass_offset"])])
    assert entry["metrics"]["top1_snr15"]["value"] == 1.0
    assert entry["metrics"]["top1_of_all_snr15"]["value"] == 0.5
    assert entry["missed"] == []


def test_single_marks_are_asked_from_8_on() -> None:
    metrics = _metrics("single", [_record("a", ["a"], size=size) for size in (3.0, 5.0, 8.0, 15.0)])
    marks = {name: m["pass_mark"] for name, m in metrics.items()}
    assert marks["detected_snr5"] is marks["top1_snr5"] is marks["in_set_snr3"] is None
    assert (marks["detected_snr8"], marks["top1_snr8"], marks["in_set_snr8"]) == (0.95, 0.9, 0.99)
    assert marks["top1_snr15"] == 0.97


def test_the_detection_limit_goes_down_from_the_largest_ratio() -> None:
    def found(effect: str, **at: bool) -> list[dict[str, Any]]:
        return [_record(effect, [effect] if hit else [], size=float(size[1:])) for size, hit in at.items()]

    records = [
        *found("all", s15=True, s8=True, s5=True, s3=True), *found("some", s15=True, s8=True, s5=False, s3=True),
        *found("never", s15=False, s8=True), *found("bound", s8=True, s5=False),
        _record("bound", [], size=15.0, reached=False), *found("half", s15=True, s8=True),
        _record("half", [], size=8.0),
    ]  # fmt: skip
    limits = table_of("single", records)["detection_limits"]
    assert limits == {"all": 3.0, "some": 8.0, "never": None, "bound": 8.0, "half": 8.0}


def test_two_causes_are_a_set() -> None:
    both = ["a", "b"]
    records = [_record(both, ["b", "a"]), _record(both, ["a"]), _record(both, ["a", "b", "c"]), _record(both, ["c"])]
    assert _values("two", records) == {"exact_set": 0.25, "both_found": 0.5, "extra_term": 0.5}
    metrics = _metrics("two", [_record(both, both)] * 9 + [_record(both, ["a"])])
    assert (metrics["exact_set"]["met"], metrics["both_found"]["met"], metrics["extra_term"]["met"]) == (
        True, False, True,
    )  # fmt: skip


def test_three_causes_are_all_found_or_not() -> None:
    three = ["a", "b", "c"]
    metrics = _metrics("three", [_record(three, ["c", "a", "b", "d"]), _record(three, ["a", "b"])])
    assert metrics["all_found"]["value"] == 0.5
    assert (metrics["all_found"]["pass_mark"], metrics["all_found"]["met"]) == (0.75, False)
    assert metrics["extra_term"]["value"] == 0.5


def test_the_onset_of_a_rightly_named_cause_is_compared() -> None:
    records = [
        _record("a", ["a"], causes=[_cause("a", onset_s=63.0)]), _record("a", ["a"]), _record("a", ["b"]),
    ]  # fmt: skip
    for record in records:
        record["hidden"][0]["onset_s"] = 60.0
    values = _values("onset", records)
    assert values["top1"] == pytest.approx(2 / 3)
    assert values["onset_given"] == 0.5
    assert values["onset_error_s"] == 3.0


def test_a_law_in_no_list_is_called_so_or_put_at_the_right_joint() -> None:
    law = "unlisted_cubic_mu"
    records = [
        _record(law, ["x"], verdict="unlisted", causes=[_cause("x", "brake.torque")]),
        _record(law, ["pad_mu_gain"], causes=[_cause("pad_mu_gain", "friction.mu")]),
        _record(law, ["mass_offset"], causes=[_cause("mass_offset", "body.mass")]),
        _record(law, []),
    ]
    values = _values("unlisted", records)
    assert values["unlisted_or_right_point"] == 0.5
    assert values["right_injection_point"] == 0.25
    assert values["wrong_listed_name"] == 0.25
    tied = _record(law, ["mass_offset"], verdict="cannot_tell_apart", causes=[_cause("mass_offset", "body.mass")])
    assert _values("unlisted", [tied])["wrong_listed_name"] == 0.0


def test_a_confounded_cause_must_not_be_claimed_and_is_decided_afterwards() -> None:
    def record(verdict: str, then: str, named: list[str]) -> dict[str, Any]:
        told = [_cause(effect) for effect in named]
        follow_up = {"verdict": then, "named": named, "causes": told, "rivals": []}
        return _record("mass_offset", ["mass_offset"], verdict=verdict, follow_up=follow_up)

    records = [
        record("cannot_tell_apart", "named", ["mass_offset"]), record("named", "named", ["headwind"]),
        record("cannot_tell_apart", "cannot_tell_apart", ["mass_offset"]),
        record("none", "named", ["mass_offset", "headwind"]),
    ]  # fmt: skip
    metrics = _metrics("confounded", records)
    assert metrics["single_cause_claimed"]["value"] == 0.25
    assert metrics["single_cause_claimed"]["met"] is False
    assert metrics["follow_up_decides"]["value"] == 0.25
    assert metrics["follow_up_decides"]["pass_mark"] == 0.9


def test_abstaining_from_a_twin_is_counted_apart() -> None:
    records = [
        _record("road_grade", ["road_grade"]), _record("road_grade", ["imu_bias"]), _record("road_grade", []),
        _record("road_grade", ["imu_bias"], verdict="cannot_tell_apart"),
        _record("road_grade", ["imu_bias"], reached=False),
    ]  # fmt: skip
    assert _values("twin", records) == {
        "right_side_of_answered": 0.5, "twin_named_of_answered": 0.5, "abstained": 0.5,
    }  # fmt: skip
    silent = _metrics("twin", [_record("road_grade", [])])
    assert silent["right_side_of_answered"]["met"] is None  # abstaining always meets nothing
    assert silent["abstained"]["value"] == 1.0


def test_what_was_not_excited_is_called_not_testable_and_not_named() -> None:
    records = [
        _record("hot_spot", [], undetectable_effects=["hot_spot", "iwm_gain"]), _record("hot_spot", []),
        _record("hot_spot", ["hot_spot"], undetectable_effects=["hot_spot"]),
        _record("hot_spot", ["mass_offset"], undetectable_effects=["hot_spot"]),
    ]  # fmt: skip
    metrics = _metrics("not_testable", records)
    assert metrics["called_not_testable"]["value"] == 0.5
    assert metrics["called_not_testable"]["met"] is False
    assert metrics["hidden_named"]["value"] == 0.25


def test_parameters_are_compared_where_the_name_is_right() -> None:
    metrics = _metrics("parameters", [_record("a", ["a"]), _record("a", ["b"]), _record("a", ["a"], reached=False)])
    assert metrics["median_error"]["value"] == pytest.approx(0.1)
    assert metrics["coverage95"]["value"] == 1.0
    assert metrics["coverage95"]["met"] is False  # asked is 92 to 98 %
    assert metrics["right_place"]["value"] == 1.0


def test_a_number_of_another_name_is_compared_with_its_own() -> None:
    record = _record("imu_bias", ["imu_bias"])
    record["hidden"][0]["parameters"] = {"bias_mps2": {"value": 0.2}}
    record["causes"][0]["parameters"] = {"ax_mps2": {"value": 0.25, "ci95": [0.22, 0.28]}}
    values = _values("parameters", [record])
    assert values["median_error"] == pytest.approx(0.25)
    assert values["coverage95"] == 0.0


def _gained(after: dict[str, float], **more: Any) -> dict[str, Any]:
    gains = {name: {"before": 3.0, "after": after[name], "best_wrong": 2.9} for name in CHANNELS}
    return _record("a", ["a"], held_out_error=gains, oracle=dict.fromkeys(CHANNELS, 1.0)) | more


def test_the_gain_is_a_share_of_the_oracles() -> None:
    metrics = _metrics("gain", [_gained({"ax_mps2": 1.2, "wheel_speed": 1.4})])
    assert metrics["gain_of_oracle"]["value"] == pytest.approx((1.8 + 1.6) / 4.0)
    assert metrics["gain_of_oracle"]["met"] is False
    assert metrics["never_1_percent_worse"]["met"] is True
    assert metrics["beats_best_wrong"]["value"] == 1.0
    assert _metrics("unlisted", [_gained({"ax_mps2": 1.2, "wheel_speed": 1.4})])["gain_of_oracle"]["met"] is True


def test_channels_of_the_gain_are_weighted_by_what_the_oracle_leaves() -> None:
    record = _gained({"ax_mps2": 1.0, "wheel_speed": 3.0}, oracle={"ax_mps2": 1.0, "wheel_speed": 2.0})
    assert _values("gain", [record])["gain_of_oracle"] == pytest.approx(2.0 / (2.0 + 0.5))


def test_a_missed_cause_gains_nothing_and_counts() -> None:
    missed = _gained({"ax_mps2": 3.0, "wheel_speed": 3.0}, named=[], causes=[])
    values = _values("gain", [missed])
    assert values["gain_of_oracle"] == 0.0
    assert values["gain_of_oracle_where_named"] is None


def test_no_oracle_and_an_oracle_without_gain_tell_nothing() -> None:
    without = _gained({"ax_mps2": 1.0, "wheel_speed": 1.0}, oracle=None)
    useless = _gained({"ax_mps2": 1.0, "wheel_speed": 1.0}, oracle=dict.fromkeys(CHANNELS, 2.99))
    assert _values("gain", [without, useless])["gain_of_oracle"] is None


def test_one_channel_that_gets_worse_is_seen() -> None:
    metrics = _metrics("gain", [_gained({"ax_mps2": 3.1, "wheel_speed": 1.0})])
    assert metrics["never_1_percent_worse"]["met"] is False
    assert metrics["all_channels_no_worse"]["value"] == 1.0


def _sure(chance: float, right: bool) -> dict[str, Any]:
    name = "a" if right else "b"
    return _record("a", [name], causes=[_cause(name, chance=chance)])


def test_chances_that_come_true_are_calibrated() -> None:
    good = [_sure(0.8, True)] * 80 + [_sure(0.8, False)] * 20
    metrics = _metrics("calibration", [*good, _record("a", [])])  # where none is named nothing is claimed
    assert metrics["calibration_error"]["value"] == pytest.approx(0.0, abs=1e-12)
    assert metrics["calibration_error"]["met"] is True
    assert metrics["brier"]["value"] == pytest.approx(0.8 * 0.04 + 0.2 * 0.64)


def test_boasting_is_not_calibrated() -> None:
    boasting = [_sure(1.0, True)] * 5 + [_sure(1.0, False)] * 5
    metrics = _metrics("calibration", [*boasting, *[_sure(0.55, True)] * 10])
    assert metrics["calibration_error"]["value"] == pytest.approx(0.5 * 0.5 + 0.5 * 0.45)
    assert metrics["calibration_error"]["met"] is False
    assert metrics["calibration_error"]["low"] < 0.475 < metrics["calibration_error"]["high"]


def test_answers_on_unusable_data_count_as_silence() -> None:
    record = _record("road_grade", [], verdict="unusable")
    for family in FAMILIES:
        table_of(family, [record | {"follow_up": record}])
    assert _values("twin", [record])["abstained"] == 1.0
