"""Scores of blind trials."""

from hil.trials.score import table_of, wilson


def _record(effect: str, named: list[str], size: float = 15.0) -> dict[str, object]:
    return {
        "size": size, "reached": True, "named": named, "rivals": [], "gain": {},
        "hidden": [{"effect": effect, "parameters": {"gain": {"value": 0.1}}}],
        "causes": [{"parameters": {"gain": {"value": 0.11, "ci95": [0.09, 0.12]}}} for _ in named],
    }  # fmt: skip


def test_wilson_intervals_hold_the_share() -> None:
    low, high = wilson(3, 300)
    assert low < 0.01 < high
    assert wilson(0, 0) == (0.0, 1.0)


def test_a_null_case_with_a_cause_is_an_alarm() -> None:
    metrics = table_of("null", [_record("none", []), _record("none", ["mass_offset"])])["metrics"]
    assert metrics["false_alarm"]["value"] == 0.5
    assert metrics["false_alarm"]["met"] is False


def test_single_cases_count_the_first_name() -> None:
    records = [_record("a", ["a"]), _record("a", ["b"]), _record("a", ["a", "b"]), _record("a", [])]
    metrics = table_of("single", records)["metrics"]
    assert metrics["top1_snr15"]["value"] == 0.5
    assert metrics["detected_snr15"]["value"] == 0.75


def test_parameters_are_compared_where_the_name_is_right() -> None:
    metrics = table_of("parameters", [_record("a", ["a"]), _record("a", ["b"])])["metrics"]
    assert abs(metrics["median_error"]["value"] - 0.1) < 1e-9
    assert metrics["coverage95"]["value"] == 1.0
