"""The synthetic dynamometer and the records it ships."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hil.identify import dyno
from hil.identify.study import shipped_records


def test_shipped_records_come_out_again_byte_for_byte(tmp_path):
    made = subprocess.run(
        [sys.executable, "-m", "hil.identify.dyno", str(tmp_path)], check=True, capture_output=True, text=True
    )
    assert len(made.stdout.splitlines()) == 2
    for shipped in shipped_records():
        assert (tmp_path / shipped.name).read_bytes() == shipped.read_bytes()


def test_says_that_it_is_synthetic(shipped):
    for record in shipped:
        assert record.remarks[0].startswith("SYNTHETIC record, not measured")
        assert "25.5 cm2" in record.remarks[2]


def test_shares_nothing_with_the_plant():
    tree = ast.parse(Path(dyno.__file__).read_text())
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert imported == {"math", "sys", "collections.abc", "dataclasses", "pathlib", "numpy"}


def test_pressure_is_the_papers_and_test_2_is_twice_as_fast(shipped):
    for record, period in zip(shipped, (10.0, 5.0), strict=True):
        expected = 15e5 * (1.0 - np.cos(2.0 * np.pi * record.time_s / period))
        assert np.sqrt(np.mean((record.pressure_pa - expected) ** 2)) < 4e3
        assert np.ptp(record.speed_mps) < 0.02 * record.speed_mps.mean()


def test_step_of_its_integrator_is_fine_enough(monkeypatch):
    test, lining = dyno.TESTS[1], dyno.Lining()
    coarse = np.array(dyno._run(test, lining))
    monkeypatch.setattr(dyno, "_INNER_STEP_S", 0.5 * dyno._INNER_STEP_S)
    monkeypatch.setattr(dyno, "_RECORDED_EVERY", 2 * dyno._RECORDED_EVERY)
    fine = np.array(dyno._run(test, lining))
    assert np.abs(fine[:, 4] - coarse[:, 4]).max() < 0.02
    ripple = 0.006 * coarse[:, 3]  # its phase drifts with the step
    assert np.all(np.abs(fine[:, 3] - coarse[:, 3]) < 0.5 + 0.02 * ripple)


@pytest.mark.parametrize(
    ("cause", "without"),
    [
        ("seal", {"seal_bar": 0.0}),
        ("film", {"rubbing_1_j": 0.0}),
        ("pressure", {"pressure_exponent": 0.0}),
        ("fade", {"fade_depth": 0.0}),
        ("conforming", {"conforming": 0.0}),
        ("sliding speed", {"stribeck": 0.0}),
    ],
)
def test_every_cause_shows_in_the_torque(cause, without):
    start = 300.0 if cause == "fade" else 70.0
    test = dyno.Test("x.csv", 0.2, start, 0.44, 1, duration_s=10.0, speed_mps=2.0)
    full, reduced = (np.array(dyno._run(test, dyno.Lining(**change)))[:, 3] for change in ({}, without))
    assert np.abs(full - reduced).max() > 2.0


def test_a_folder_is_asked_for():
    wrong = subprocess.run([sys.executable, "-m", "hil.identify.dyno"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 1
    assert "usage" in wrong.stderr
