"""Which cases a family has, in which order, and that no case is run twice."""

import json

import pytest

from hil.errors import BrakebenchError
from hil.validation.blind_trials import FAMILIES
from hil.validation.blind_trials.run import plan, run_family
from hil.validation.reference_car.cases import FAMILIES as REFERENCE_CAR
from hil.validation.strangers.cases import FAMILIES as STRANGERS

DRAWN = {*REFERENCE_CAR, *STRANGERS}


def _silent(text: str) -> None:
    pass


def _keep(path, cases, seed=5):
    """Records as if the cases had been run."""
    lines = [
        {"family": family, "index": index, "size": size, "seed": seed, "verdict": "none", "named": []}
        for family, index, size in cases
    ]
    path.mkdir(parents=True, exist_ok=True)
    (path / "cases.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")


def test_every_family_that_can_be_drawn_is_run() -> None:
    assert set(FAMILIES) >= DRAWN
    for family in FAMILIES:
        assert {drawn for drawn, _, _ in plan(family, 3)} <= DRAWN


def test_single_takes_all_effects_at_the_largest_size_first() -> None:
    cases = plan("single", 3)
    assert [size for _, _, size in cases] == [15.0] * 3 + [8.0] * 3 + [5.0] * 3 + [3.0] * 3
    assert [index for _, index, _ in cases] == [0, 1, 2] * 4


@pytest.mark.parametrize("family", sorted(DRAWN - {"single"}))
def test_other_families_are_drawn_as_they_are(family: str) -> None:
    assert plan(family, 4) == [(family, k, None) for k in range(4)]


@pytest.mark.parametrize("family", ["parameters", "gain", "calibration"])
def test_scores_of_single_share_its_cases(family: str) -> None:
    cases = plan(family, 5)
    assert [size for _, _, size in cases] == [15.0, 15.0, 15.0, 8.0, 8.0]
    assert set(plan(family, 20)) <= set(plan("single", 10))


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_on_file_is_not_run_again(family: str, tmp_path) -> None:
    cases = plan(family, 2)
    _keep(tmp_path, cases)
    before = (tmp_path / "cases.jsonl").read_bytes()
    records = run_family(family, 2, 5, tmp_path, _silent)  # to run even one would take minutes and add a line
    assert [(r["family"], r["index"], r["size"]) for r in records] == cases
    assert (tmp_path / "cases.jsonl").read_bytes() == before


def test_the_scores_of_single_run_nothing_after_single(tmp_path) -> None:
    _keep(tmp_path, plan("single", 4))
    before = (tmp_path / "cases.jsonl").read_bytes()
    for family in ("parameters", "gain", "calibration"):
        assert len(run_family(family, 8, 5, tmp_path, _silent)) == 8
    assert (tmp_path / "cases.jsonl").read_bytes() == before


def test_a_broken_line_is_told(tmp_path) -> None:
    (tmp_path / "cases.jsonl").write_text('{"family": "nu', encoding="utf-8")
    with pytest.raises(BrakebenchError, match=r"cases\.jsonl: a line is no JSON"):
        run_family("null", 1, 5, tmp_path, _silent)
