"""Runs of a task, and what is kept of them."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from hil.campaign.plan import CampaignError, load_plan
from hil.campaign.report import build_report, verdict_of
from hil.campaign.store import Store
from hil.campaign.tasks import killed
from hil.errors import Verdict
from hil.log.read import read_log

SPEEDS = '[[vary]]\nkey = "start.speed_mps"\nname = "speed"\nvalues = [3.0, 5.0, 7.0]\n'


@pytest.fixture
def plan(planned):
    return load_plan(planned(SPEEDS))


def done_of(plan, folder):
    store = Store(folder, plan)
    for part in store.missing():
        store.add(part, list(map(plan.runner, plan.part(part))))
    return store


def rows_of(plan):
    return [plan.runner(run).row for part in range(plan.parts) for run in plan.part(part)]


def test_results_have_inputs_verdict_expectations_and_figures(plan, tmp_path):
    store = done_of(plan, tmp_path / "out")
    rows = store.table().to_pylist()
    assert [row["speed"] for row in rows] == [3.0, 5.0, 7.0]
    assert [row["verdict"] for row in rows] == ["passed", "passed", "failed"]
    assert [row["met.stop_distance_m"] for row in rows] == [True, True, False]
    assert rows[2]["reason"].startswith("stop_distance_m: expected -inf to 6, got ")
    assert rows[0]["stop_distance_m"] < rows[1]["stop_distance_m"] < rows[2]["stop_distance_m"]
    assert [path.name for path in (tmp_path / "out" / "recordings").iterdir()] == ["000000002.log"]
    frames = read_log(tmp_path / "out" / "recordings" / "000000002.log").frames
    assert np.count_nonzero(frames.channel == frames.channels.index("vehicle")) == rows[2]["frames_sent"]
    assert not list(store.missing())


def test_the_same_campaign_gives_the_same_bytes(plan, tmp_path):
    for name in ("one", "other"):
        done_of(plan, tmp_path / name)
    for path in (tmp_path / "one" / "results").iterdir():
        assert path.read_bytes() == (tmp_path / "other" / "results" / path.name).read_bytes()


def test_a_run_that_falls_over_is_a_row_and_the_others_go_on(planned):
    silenced = "".join(f'{{ fault = "lost", on = "EHB_DEMAND_{axle}", share = 1.0 }},' for axle in ("FRONT", "REAR"))
    plan = load_plan(planned(f'[[vary]]\nkey = "faults"\nvalues = [[{silenced}], []]\nlabels = ["silent", "none"]\n'))
    rows = rows_of(plan)
    assert [(row["run"], row["verdict"]) for row in rows] == [(0, "broken"), (1, "passed")]
    assert "the plant never saw valid demands" in rows[0]["reason"]


def test_values_that_only_together_are_refused_are_told(planned):
    begins = '[[vary]]\nkey = "faults.0.at_s"\nvalues = [1.0, 3.0]\n'
    ends = '[[vary]]\nkey = "faults.0.until_s"\nvalues = [2.0, 5.0]\n'
    plan = load_plan(planned(begins + ends))
    rows = rows_of(plan)
    assert [row["verdict"] for row in rows][2] == "refused"
    assert "until_s" in rows[2]["reason"]


def test_another_campaign_is_not_mixed_into_a_folder(plan, planned, tmp_path):
    Store(tmp_path / "out", plan)
    other = load_plan(planned(SPEEDS.replace("7.0", "8.0")))
    with pytest.raises(CampaignError, match="another campaign"):
        Store(tmp_path / "out", other)


def test_a_second_command_is_kept_out(plan, tmp_path):
    store = Store(tmp_path / "out", plan)
    with store.alone(), pytest.raises(CampaignError, match="another brakebench"), Store(tmp_path / "out", plan).alone():
        pass


def test_a_file_that_was_being_written_counts_as_missing(plan, tmp_path):
    store = done_of(plan, tmp_path / "out")
    results = tmp_path / "out" / "results"
    (results / "part-000001.parquet").rename(results / ".part-000001.99.part.parquet")
    assert list(store.missing()) == [1]
    assert store.table().num_rows == 2


@pytest.mark.parametrize(
    ("counts", "verdict"),
    [
        ({"passed": 3}, Verdict.PASSED),
        ({"passed": 2, "failed": 1}, Verdict.FAILED),
        ({"passed": 2, "refused": 1}, Verdict.FAILED),
        ({"failed": 2, "killed": 1}, Verdict.BROKEN),
        ({"passed": 2}, Verdict.INCOMPLETE),
    ],
)
def test_a_campaign_is_judged_by_its_worst_run(counts, verdict):
    assert verdict_of(counts, 3)[0] is verdict


def test_the_report_says_how_to_repeat_what_did_not_pass(plan, tmp_path):
    store = Store(tmp_path / "out", plan)
    for number in (0, 2):
        store.add(number, [plan.runner(plan.run(number))])
    store.add(1, [killed(plan.run(1), 4)])
    report = build_report(plan, store.table(), None)
    assert report.verdict is Verdict.BROKEN
    (table,) = report.sections[-1].tables
    assert [(row[0], row[1], row[4]) for row in table.rows] == [
        ("killed", 1, "speed 5.000"),
        ("failed", 2, "speed 7.000"),
    ]
    assert table.rows[0][-1].endswith("campaign.toml --repeat 1")
    assert pq.read_table(tmp_path / "out" / "results").num_rows == 3
