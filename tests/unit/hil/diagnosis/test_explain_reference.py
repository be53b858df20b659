"""What has changed since reference logs, on a car nobody here modelled, told by six numbers."""

from pathlib import Path

import numpy as np
import pytest
from outsider import VEHICLE, drive

from hil.diagnosis.explain import explain
from hil.diagnosis.result.page import build_report
from hil.diagnosis.vehicle.extension_file import load_extension
from hil.report.text import render_text
from plant.injection.theta import THETA

Drive = dict[str, np.ndarray]
_DRAG_NM = (0.0, 0.0, 40.0, 0.0)


def _drives(first_seed: int, front: float = 1.0, drag_nm: tuple[float, ...] = (0.0,) * 4) -> list[Drive]:
    """Stops, and brakes and motors in turn; front pads with ``front`` of their friction."""
    share = np.array([front, front, 1.0, 1.0])
    kinds = ("stops", "mixed")
    return [drive(kind, first_seed + k, lambda speed, pressure: share, drag_nm) for k, kind in enumerate(kinds)]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_weaker_front_pads_are_the_change_alone_or_with_what_is_tied(tmp_path: Path) -> None:
    answer = explain(_drives(20, front=0.85), VEHICLE, reference=_drives(10), out=tmp_path)
    found = answer.json
    (cause,) = found["causes"]
    assert (cause["effect"], cause["location"]) == ("pad_mu_gain", "front")
    low, high = cause["parameters"]["gain"]["ci95"]
    assert cause["parameters"]["gain"]["value"] == pytest.approx(-0.15, abs=0.015)
    assert low < -0.15 < high < low + 0.06
    assert found["headline"].startswith("Changed since the reference: front pads bite ")
    assert len(found["reference"]["logs"]) == 2
    error = found["held_out_error"]["wheel_speed"]
    assert error["after"] < 0.3 * error["before"]
    printed = render_text(build_report(answer, ["logs"]))
    assert "What the reference shows" in printed
    learned = load_extension(tmp_path / "extension.toml").theta
    assert learned[THETA.slice("pad_mu_gain", "gain")][:2] == pytest.approx([-0.15, -0.15], abs=0.04)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("before", "named"), [(_DRAG_NM, False), ((0.0,) * 4, True)])
def test_a_drag_is_a_cause_where_the_reference_has_none(before: tuple[float, ...], named: bool) -> None:
    found = explain(_drives(40, drag_nm=_DRAG_NM), VEHICLE, reference=_drives(30, drag_nm=before)).json
    told = {(one["effect"], one["location"]) for one in (*found["causes"], *found["rivals"])}
    if not named:
        assert found["verdict"] == "none"
        assert found["headline"].startswith("No change since the reference")
    else:
        assert ("residual_drag", "rl") in told
        assert found["causes"]
