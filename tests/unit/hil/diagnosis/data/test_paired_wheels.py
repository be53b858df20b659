"""A wheel without values costs itself, not all four."""

import numpy as np
import pytest
from outsider import drive

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, Log
from hil.diagnosis.data.paired_wheels import with_paired_wheels
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import from_frame
from plant.vectors import CUT


def _without(names: tuple[str, ...], empty: bool) -> Log:
    table = drive("mixed", 3, lambda v, p: np.ones(4))
    changed = {name: np.full(len(table["t_s"]), np.nan) for name in names} if empty else {}
    return from_frame({key: value for key, value in table.items() if key not in names} | changed)


@pytest.mark.parametrize("empty", [True, False])
@pytest.mark.parametrize("group", [PRESSURE, PRESSURE_DEMAND, MOTOR_TORQUE, MOTOR_DEMAND])
def test_one_empty_column_costs_left_and_right_of_its_axle_alone(group: tuple[str, ...], empty: bool) -> None:
    (log,) = with_paired_wheels([_without((group[2],), empty)])
    assert np.array_equal(log.channels[group[2]], log.channels[group[3]])
    assert any(f"{group[2]} has no values: taken as {group[3]}" in text for text in log.remarks)
    dataset = prepare([log], 0.318)
    (recording,) = dataset.recordings
    kind = "pressure" if "pressure" in group[0] else "motor"
    assert kind in dataset.groups
    assert dataset.measured_input_mask[CUT.slice("pressure")].all()
    assert not recording.compared[f"{kind}.left-right rear"].any()
    assert f"{kind}.left-right front" not in recording.compared
    assert f"{kind}.mean" not in recording.compared


def test_an_axle_without_values_is_named_where_other_logs_have_it() -> None:
    whole = _without((), False)
    _, log = with_paired_wheels([whole, _without(PRESSURE[2:], True)])
    assert not log.has(*PRESSURE)
    assert any("pressure_rl_pa, pressure_rr_pa have no values" in text for text in log.remarks)
    assert with_paired_wheels([whole])[0].remarks == whole.remarks
