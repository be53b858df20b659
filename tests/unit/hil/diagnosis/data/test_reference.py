"""Reference logs beside those to be explained: what cannot be compared is refused, what one of them lacks is told."""

from pathlib import Path

import numpy as np
import pytest

from hil.cli.main import main
from hil.diagnosis.data.log import PRESSURE, WHEEL_SPEED, Log, UnusableError, make_log
from hil.diagnosis.data.reference import with_shared_channels

RADIUS_M = 0.3


def _log(name: str, seed: int, pressure_pa: float = 20e5, **others: float) -> Log:
    """Twelve seconds at 20 m/s and less, three of them on the brakes."""
    rng, t_s = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.01)
    noise = 0.01 * rng.normal(size=len(t_s))
    braked = ((t_s > 5.0) & (t_s < 8.0)) * 1.0
    channels = {one: 60.0 - 2.0 * np.clip(t_s - 5.0, 0.0, 3.0) + noise for one in WHEEL_SPEED}
    channels |= dict.fromkeys(PRESSURE, pressure_pa * braked + 10000.0 * noise)
    return make_log(name, t_s, channels | {one: value + noise for one, value in others.items()})


def test_channels_that_only_one_of_both_has_are_told_and_left_out() -> None:
    logs, reference, remarks = with_shared_channels(
        [_log("new", 1, ax_mps2=0.0)], [_log("old", 2, soc=0.5), _log("older", 3, soc=0.5)], RADIUS_M
    )
    assert {*logs[0].channels} == {*reference[0].channels} == {*reference[1].channels} == {*WHEEL_SPEED, *PRESSURE}
    assert remarks == [
        "not in the reference, so left out of the comparison: ax_mps2",
        "not in the logs since, so left out of the comparison: soc",
    ]


def test_the_same_recording_in_both_is_refused() -> None:
    with pytest.raises(UnusableError, match=r"old is the same recording as new of the logs to be explained; give"):
        with_shared_channels([_log("new", 1)], [_log("older", 2), _log("old", 1)], RADIUS_M)


def test_a_reference_without_stops_is_refused_where_the_others_have_some() -> None:
    coasting = _log("coasting", 2, pressure_pa=0.0)
    with pytest.raises(UnusableError, match=r"its logs brake for 0\.0 s, expected 1 s or more above 2 bar.*add"):
        with_shared_channels([_log("new", 1)], [coasting], RADIUS_M)
    with_shared_channels([coasting], [_log("old", 1)], RADIUS_M)


@pytest.mark.parametrize(("left_out", "told"), [(WHEEL_SPEED, "no speed"), (PRESSURE, "no brake pressure or motor")])
def test_a_reference_without_what_a_simulation_needs_is_refused(left_out: tuple[str, ...], told: str) -> None:
    without = _log("old", 2, soc=0.5)
    channels = {name: values for name, values in without.channels.items() if name not in left_out}
    with pytest.raises(UnusableError, match=f"{told}.*the reference has .*soc"):
        with_shared_channels([_log("new", 1)], [make_log("old", without.t_s, channels)], RADIUS_M)


def test_the_command_refuses_the_folder_that_it_explains(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = _log("new", 1)
    table = np.column_stack([log.t_s, *log.channels.values()])
    (tmp_path / "logs").mkdir()
    header = ",".join(["t_s", *log.channels])
    np.savetxt(tmp_path / "logs" / "run.csv", table, "%.9g", delimiter=",", header=header, comments="")
    vehicle = tmp_path / "car.toml"
    vehicle.write_text(
        "mass_kg = 1500.0\nwheelbase_m = 2.6\ncog_to_front_axle_m = 1.2\nrolling_radius_m = 0.3\n"
        "brake_gain_front_nm_pa = 2.6e-4\nbrake_gain_rear_nm_pa = 1.5e-4\n"
    )
    logs = str(tmp_path / "logs")
    assert main(["explain", logs, "--reference", logs, "--vehicle", str(vehicle)]) != 0
    assert "reference run.csv is the same recording as run.csv" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["explain", logs, "--reference", str(tmp_path / "empty"), "--vehicle", str(vehicle)]) != 0
    assert "no log in" in capsys.readouterr().err
