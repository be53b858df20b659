"""Logs of any kind become the same canonical table, or are refused with a reason."""

from pathlib import Path

import numpy as np
import pytest

from dbc.database import parse_database
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import UnusableError, make_log
from hil.diagnosis.data.read import from_frame, read_logs, read_one


def _csv(path: Path, head: str, rows: np.ndarray) -> Path:
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


def _rows(n: int = 300) -> np.ndarray:
    t = np.arange(n) * 0.01
    return np.column_stack((t, 20.0 - t, 0.5 * t))


def test_csv_with_units_in_the_head_is_si(tmp_path: Path) -> None:
    path = _csv(tmp_path / "a.csv", "t_s,speed_mps [km/h],pressure_fl_pa [bar]", _rows())
    log = read_one(path)
    assert np.allclose(log.channels["speed_mps"], (20.0 - log.t_s) / 3.6)
    assert np.allclose(log.channels["pressure_fl_pa"], 0.5e5 * log.t_s)


def test_parquet_and_mat_read_like_csv(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet
    from scipy.io import savemat

    rows = _rows()
    columns = {"t_s": rows[:, 0], "speed_mps": rows[:, 1]}
    pyarrow.parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    savemat(tmp_path / "a.mat", columns)
    for name in ("a.parquet", "a.mat"):
        assert np.allclose(read_one(tmp_path / name).channels["speed_mps"], rows[:, 1])


def test_a_data_frame_is_a_log() -> None:
    rows = _rows()
    log = from_frame({"t_s": rows[:, 0], "speed_mps": rows[:, 1], "mood": rows[:, 2]})
    assert set(log.channels) == {"speed_mps"}
    assert "mood" in log.remarks[0]


def test_channel_map_scales_signs_and_offsets(tmp_path: Path) -> None:
    path = _csv(tmp_path / "a.csv", "clock,v,decel", _rows())
    (tmp_path / "map.toml").write_text(
        'time = "clock"\n[speed_mps]\nsignal = "v"\nunit = "km/h"\n'
        '[ax_mps2]\nsignal = "decel"\nsign = -1\noffset = 0.1\n'
    )
    log = read_one(path, channel_map=load_map(tmp_path / "map.toml"))
    assert np.allclose(log.channels["speed_mps"], (20.0 - log.t_s) / 3.6)
    assert np.allclose(log.channels["ax_mps2"], -0.5 * log.t_s + 0.1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[speed]\nsignal='v'\n", "unknown channel"),
        ("[speed_mps]\nsignal='v'\nunit='furlong'\n", "unit"),
        ("[speed_mps]\nscale=2\n", "expected a table with signal"),
        ("[speed_mps\n", "channel map"),
    ],
)
def test_a_wrong_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(UnusableError, match=message):
        load_map(tmp_path / "map.toml")


def test_logs_toml_gives_direction_and_temperature(tmp_path: Path) -> None:
    _csv(tmp_path / "a.csv", "t_s,speed_mps,ax_mps2", _rows())
    (tmp_path / "logs.toml").write_text('["a.csv"]\ndirection = -1\ninitial_disc_temperature_k = 500.0\n')
    (log,) = read_logs([tmp_path])
    assert (log.direction, log.disc_temperature_k) == (-1, 500.0)


@pytest.mark.parametrize(
    ("t_s", "channels", "message"),
    [
        (np.arange(300) * 0.01, {}, "no channel"),
        (np.arange(300) * -0.01, {"speed_mps": np.ones(300)}, "backwards"),
        (np.arange(30) * 0.01, {"speed_mps": np.ones(30)}, "long"),
        (np.arange(30) * 1.0, {"speed_mps": np.ones(30)}, "samples a second"),
        (np.arange(300) * 0.01, {"pressure_fl_pa": np.full(300, 1e9)}, "wrong unit"),
        (np.full(300, np.nan), {"speed_mps": np.ones(300)}, "not finite"),
    ],
)
def test_an_unusable_log_is_refused(t_s: np.ndarray, channels: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(UnusableError, match=message):
        make_log("x", t_s, channels)


def test_wheel_speeds_of_the_road_are_divided_by_the_sets_radius(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text('[wheel_speed_fl_rad_s]\nsignal = "v"\nunit = "km/h"\n')
    assert load_map(tmp_path / "map.toml", 0.3).entries["wheel_speed_fl_rad_s"].factor == pytest.approx(1 / 3.6 / 0.3)
    with pytest.raises(UnusableError, match="divide it by the rolling radius"):
        load_map(tmp_path / "map.toml")
    scaled = tmp_path / "scaled.toml"
    scaled.write_text('[wheel_speed_fl_rad_s]\nsignal = "v"\nunit = "km/h"\nscale = 4.0\n')
    assert load_map(scaled, 0.3).entries["wheel_speed_fl_rad_s"].factor == pytest.approx(4.0 / 3.6)


def test_a_map_with_a_question_mark_is_refused_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text('[steer_rad]\nsignal = "s"\nscale = ?\n')
    with pytest.raises(UnusableError, match=r"not filled in: scale \(line 3\)"):
        load_map(tmp_path / "map.toml")


SLOW_DBC = """VERSION ""
BU_: CAR
BO_ 256 FAST: 8 CAR
 SG_ V : 0|16@1+ (0.01,0) [0|655] "m/s" CAR
BO_ 512 SLOW: 8 CAR
 SG_ AX : 0|16@1- (0.01,0) [-40|40] "m/s2" CAR
"""


def test_a_slow_channel_of_the_bus_has_values_where_it_was_sampled_alone(tmp_path: Path) -> None:
    """Lines between samples of 0.1 s are smooth: a comparison took that for a filter of the sensor."""
    lines = []
    for k in range(500):
        lines.append(f"({k * 0.02:.6f}) can0 100#{(1000 + k).to_bytes(2, 'little').hex()}000000000000")
        if k % 5 == 0:
            lines.append(f"({k * 0.02 + 0.004:.6f}) can0 200#{(k % 7).to_bytes(2, 'little').hex()}000000000000")
    (tmp_path / "a.log").write_text("\n".join(lines) + "\n")
    (tmp_path / "map.toml").write_text('[speed_mps]\nsignal = "FAST.V"\n[ax_mps2]\nsignal = "SLOW.AX"\n')
    database = parse_database(SLOW_DBC.encode(), "slow.dbc")
    log = read_one(tmp_path / "a.log", database, load_map(tmp_path / "map.toml"))
    assert np.isfinite(log.channels["speed_mps"]).mean() > 0.98
    finite = np.isfinite(log.channels["ax_mps2"])
    assert finite.sum() == pytest.approx(100, abs=2)
    # what stands there is the line at the row of 10 ms nearest to the sample, 4 ms off
    steps = np.abs(log.channels["ax_mps2"][finite] - np.round(log.channels["ax_mps2"][finite], 2))
    assert steps.max() < 0.005
