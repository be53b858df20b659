"""Which runs a campaign has, whoever asks in whatever order."""

import numpy as np
import pytest

from hil.campaign.plan import load_plan
from hil.campaign.sample import sensitivities
from hil.errors import BrakebenchError

TWO = """
[[vary]]
key = "start.speed_mps"
name = "speed"
values = [4.0, 5.0, 6.0]
[[vary]]
key = "faults.0.share"
low = 0.0
high = 0.5
"""


def test_a_grid_combines_everything_and_noise_is_innermost(planned):
    plan = load_plan(planned("seeds = 2\nseed = 7" + TWO + "steps = 2"))
    assert plan.size == 3 * 2 * 2
    assert [plan.inputs(k)["speed"] for k in (0, 3, 4, 11)] == [4.0, 4.0, 5.0, 6.0]
    assert [plan.run(k).seed for k in range(3)] == [7, 8, 7]
    assert plan.run(11).changes == (("start.speed_mps", 6.0), ("faults.0.share", 0.5))
    runs = [run for part in range(plan.parts) for run in plan.part(part)]
    assert [run.number for run in runs] == list(range(12))


def test_a_change_is_in_the_scenario_that_runs(planned):
    plan = load_plan(planned(TWO + "steps = 2"))
    run = plan.run(3)
    scenario = plan.bases["short.toml"].scenario(dict(run.changes))
    assert scenario.manoeuvre.initial_speed_mps == 5.0
    assert dict(scenario.faults[0].values)["share"] == 0.5


def test_a_list_takes_values_together(planned):
    text = 'method = "list"\n[[vary]]\nkey = "start.speed_mps"\nvalues = [4.0, 5.0]\n'
    lost = '[[vary]]\nkey = "faults"\nvalues = [[], [{ fault = "lost", on = "WHEEL_SPEED_REAR", share = 1.0 }]]\n'
    plan = load_plan(planned(text + lost + 'labels = ["no", "one"]\n'))
    assert [plan.inputs(k) for k in range(plan.size)] == [
        {"start.speed_mps": 4.0, "faults": "no"}, {"start.speed_mps": 5.0, "faults": "one"},
    ]  # fmt: skip


@pytest.mark.parametrize("method", ["latin_hypercube", "sobol", "saltelli"])
def test_a_sample_fills_its_box_and_repeats(planned, method):
    path = planned(f'method = "{method}"\ncount = 64' + TWO)
    plan, again = load_plan(path), load_plan(path)
    assert plan.size == (64 if method != "saltelli" else 64 * 4)
    np.testing.assert_array_equal(plan.points, again.points)
    shares = plan.points[:, 1]
    assert 0.0 <= shares.min() < 0.05
    assert 0.45 < shares.max() <= 0.5
    counts = np.bincount(plan.points[:, 0].astype(int))
    assert len(counts) == 3
    assert counts.min() > 0.2 * len(shares)
    assert plan.fingerprint == again.fingerprint
    assert plan.fingerprint != load_plan(planned(f'seed = 2\nmethod = "{method}"\ncount = 64' + TWO)).fingerprint


def test_sobol_indices_are_those_of_a_function_that_has_them_in_closed_form(planned):
    """Ishigami: S1 0.314 and 0.442, ST 0.558 and 0.442 (Saltelli et al. 2008, Global Sensitivity Analysis, 4.4)."""
    vary = "".join(f'[[vary]]\nkey = "start.speed_mps"\nname = "x{k}"\nlow = 0.0\nhigh = 1.0\n' for k in range(3))
    plan = load_plan(planned('method = "saltelli"\ncount = 2048\n' + vary))
    x1, x2, x3 = (2.0 * np.pi * plan.points - np.pi).T
    found = sensitivities(plan.varied, np.sin(x1) + 7.0 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1), 1)
    np.testing.assert_allclose(found["S1"], [0.314, 0.442, 0.0], atol=0.03)
    np.testing.assert_allclose(found["ST"], [0.558, 0.442, 0.244], atol=0.03)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[vary]]\nkey = 'start.speed_mps'\nlow = 1.0\nhigh = 2.0\n", "steps: expected a number from 2"),
        ("[[vary]]\nkey = 'start.sped_mps'\nvalues = [1.0]\n", "unknown key 'sped_mps'"),
        ("[[vary]]\nkey = 'start.speed_mps'\nvalues = [1000.0]\n", "start.speed_mps: expected a number from -15 to 60"),
        ("[[vary]]\nkey = 'faults.3.share'\nvalues = [1.0]\n", "faults.3.share: expected a number from 0 to 0"),
        ("[[vary]]\nkey = 'title.x'\nvalues = [1.0]\n", "title is 'short stop', which holds nothing"),
        ("[[vary]]\nkey = 'start.speed_mps'\nname = 'verdict'\nvalues = [1.0]\n", "names must differ"),
        ("[[vary]]\nkey = 'start.speed_mps'\nvalues = [1.0]\nlabels = []\n", "a text for each of the 1 values"),
        ("method = 'sobol'\ncount = 10\n[[vary]]\nkey = 'start.speed_mps'\nlow = 1.0\nhigh = 2.0\n", "take 16"),
        ("method = 'sobol'\n[[vary]]\nkey = 'start.speed_mps'\nlow = 1.0\nhigh = 2.0\n", "count: expected the number"),
        ("count = 3\n", "a grid has as many points as its values give"),
        ("method = 'random'\n", "expected one of grid, list"),
        ("speed = 3\n", "unknown key 'speed'"),
        ("seeds = 200000000\n", "seeds: expected a number"),
    ],
)
def test_what_cannot_run_is_refused_before_anything_runs(planned, text, words):
    with pytest.raises(BrakebenchError) as refused:
        load_plan(planned(text))
    assert words in str(refused.value)
    assert ".toml" in str(refused.value)
