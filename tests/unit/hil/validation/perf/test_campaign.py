"""`perf campaign`: real pools and a real Dask scheduler, with few tasks; figures are not judged here."""

import pytest

from hil.validation.perf import campaign

pytestmark = pytest.mark.slow


def test_the_campaign_is_measured_beside_a_plain_loop(monkeypatch):
    monkeypatch.setattr(campaign, "ROUNDS", 1)
    rows = {row.name: row for row in campaign.measure(stops=6)}
    one, two = rows["stops a second, 1 worker"], rows["stops a second, 2 workers"]
    assert one.ratio == pytest.approx(one.ours / one.other)
    assert two.other == one.ours
    spent = rows["processor time of a stop, 1 worker"]
    assert spent.ratio == pytest.approx(spent.other / spent.ours)
    assert 5.0 < spent.other < 5000.0  # ms: the loop has driven
    memory = rows["memory of the command at the end"]
    assert memory.other > 50.0
    assert memory.ours < 2.0 * memory.other  # less, where pages were given back


def test_tiny_tasks_pass_a_real_scheduler():
    pytest.importorskip("distributed", reason="pip install 'brakebench[campaign]'")
    rows = {row.name: row for row in campaign.tiny(200)}
    assert rows["tasks a second, empty"].ours > rows["tasks a second, empty"].other * 0.01
    waiting = rows["tasks a second, 20 ms"]
    assert 1.0 < waiting.ours < waiting.other == campaign._CORES / campaign.TASK_S
    assert rows["scheduler's time of a task, empty"].ours > 0.0
    assert 30.0 < rows["scheduler's memory after, empty"].ours < 2000.0
