"""The comparison of `explain` with its rivals: how figures are formed, and one small run of it."""

import json
import math

import pytest

from hil.cli.main import main
from hil.errors import BrakebenchError
from hil.validation.perf import explain
from hil.validation.perf.explain import Outcome, guess_of, rows_of
from hil.validation.perf.rivals import NONE, RIVALS, Guess

GRADE, NOTHING = Guess("road_grade", {"road_grade": 1.0, NONE: 0.0}), Guess(NONE, {NONE: 1.0})


def _entry(effect: str, probability: float) -> dict[str, object]:
    return {"effect": effect, "probability": probability}


def test_our_answer_leaves_the_rest_to_nothing():
    guess = guess_of({"causes": [_entry("road_grade", 0.7)], "rivals": [_entry("imu_bias", 0.2)]})
    assert guess.named == "road_grade"
    assert guess.probability == pytest.approx({"road_grade": 0.7, "imu_bias": 0.2, NONE: 0.1})
    assert guess_of({"causes": [], "rivals": []}) == NOTHING


def test_a_tied_set_shares_no_more_than_1():
    guess = guess_of(
        {"causes": [_entry("road_grade", 1.0)], "rivals": [_entry("imu_bias", 0.5), _entry("imu_bias", 0.3)]}
    )
    assert guess.probability == pytest.approx({"road_grade": 2 / 3, "imu_bias": 1 / 3, NONE: 0.0})


def test_the_brier_score_is_of_all_names():
    assert Outcome("road_grade", GRADE, 1.0).brier == 0.0
    assert Outcome("mass_offset", GRADE, 1.0).brier == 2.0  # a name it never thought of counts
    assert Outcome(NONE, Guess("a", {"a": 0.6, "b": 0.2, NONE: 0.2}), 1.0).brier == pytest.approx(0.36 + 0.04 + 0.64)


def test_ratios_of_shares_stay_finite():
    ours = [Outcome("road_grade", GRADE, 8.0), Outcome(NONE, NOTHING, 8.0), Outcome(NONE, NOTHING, 4.0)]
    other = [Outcome("road_grade", NOTHING, 2.0), Outcome(NONE, GRADE, 2.0), Outcome(NONE, GRADE, 2.0)]
    first, mass, of_detected, detected, alarms, brier, time = rows_of(ours, other, "another")
    for row in (first, mass, of_detected, detected):
        assert (row.ours, row.other) == (1.0, 0.0)
    assert [row.ratio for row in (first, mass, of_detected, detected)] == [2.0, 2.0, 1.0, 2.0]
    assert (alarms.ours, alarms.other, alarms.ratio) == (0.0, 1.0, 3.0)
    assert (brier.ours, brier.other, brier.ratio) == (0.0, 2.0, 7.0)
    assert (time.ours, time.other, time.ratio) == (8.0, 2.0, 0.25)
    assert all(row.ratio == pytest.approx(1.0) for row in rows_of(ours, ours, "ourselves"))


def test_intervals_hold_the_shares_and_narrow_with_cases():
    half = Guess("road_grade", {"road_grade": 0.6, "imu_bias": 0.3, NONE: 0.1})
    sure = Guess("road_grade", {"road_grade": 0.9, NONE: 0.1})
    few = [Outcome("road_grade", guess, 1.0) for guess in (half, sure)] + [Outcome(NONE, NOTHING, 1.0)]
    of_few, of_many = (rows_of(cases, cases, "ourselves") for cases in (few, 20 * few))
    for little, much in zip(of_few[:5], of_many[:5], strict=True):
        assert little.ours == pytest.approx(much.ours)
        assert little.ours_95[0] <= little.ours <= little.ours_95[1]
        assert much.ours_95[1] - much.ours_95[0] < little.ours_95[1] - little.ours_95[0]
    assert of_few[1].ours == pytest.approx(0.75)


def test_the_reading_of_a_rival_counts_that_is_better_for_it():
    shares = {"road_grade": 0.3, "mass_offset": 0.7}
    wrong = Guess("mass_offset", {"mass_offset": 1.0}, shares)
    cases = [Outcome("road_grade", wrong, 1.0), Outcome(NONE, wrong, 1.0)]
    ours = [Outcome("road_grade", GRADE, 1.0), Outcome(NONE, NOTHING, 1.0)]
    assert rows_of(ours, cases, "another")[1].other == 0.3
    right = [Outcome("road_grade", Guess("road_grade", GRADE.probability, shares), 1.0), cases[1]]
    assert rows_of(ours, right, "another")[1].other == 1.0


def test_what_is_not_detected_counts_in_the_probability_of_all_alone():
    found = Guess("road_grade", {"road_grade": 0.8, NONE: 0.2})
    missed = Guess(NONE, {"road_grade": 0.4, NONE: 0.6})
    cases = [Outcome("road_grade", guess, 1.0) for guess in (found, missed)] + [Outcome(NONE, NOTHING, 1.0)]
    first, mass, of_detected, detected, *_ = rows_of(cases, cases, "ourselves")
    assert (first.ours, detected.ours) == (0.5, 0.5)
    assert (mass.ours, of_detected.ours) == pytest.approx((0.6, 0.8))


def test_without_pysindy_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "pysindy.optimizers", None)
    with pytest.raises(BrakebenchError, match=r"pip install .*'pysindy>="):
        explain.measure()
    assert main(["perf", "explain"]) == 2
    assert "pysindy is not installed" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_all_rows_of_one_single_and_one_null_on_a_few_of_their_logs(monkeypatch, capsys):
    pytest.importorskip("pysindy", reason="pysindy is not installed")
    whole = explain.write

    def few(case, folder):
        whole(case, folder)
        for log in folder.glob("*.parquet"):
            if log.name not in explain.WARM_UP:
                log.unlink()

    monkeypatch.setattr(explain, "write", few)
    monkeypatch.setattr(explain, "SINGLES", (0,))
    monkeypatch.setattr(explain, "NULLS", (0,))
    assert main(["perf", "explain", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert len({(row["name"], row["other_is"]) for row in rows}) == len(rows) == 7 * len(RIVALS)
    assert {row["other_is"] for row in rows} == set(RIVALS)
    for row in rows:
        assert all(math.isfinite(row[key]) for key in ("ours", "other", "ratio"))
        assert row["ratio"] > 0.0
        assert row["unit"] != "share" or 0.0 <= row["ours"] <= 1.0 >= row["other"] >= 0.0
