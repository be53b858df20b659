"""Tables as other programs write them: separators, decimal commas, rows of units, clocks, heads that stand twice."""

from pathlib import Path

import numpy as np
import pytest

from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.data.read import from_frame, read_one

T_S = np.arange(300) * 0.01
SPEED = 20.0 - T_S


def _table(path: Path, between: str = ",", decimal: str = ".", head: str = "t_s|speed_mps|ax_mps2", below: str = "",
           t: np.ndarray = T_S) -> Path:  # fmt: skip
    rows = [f"{a:.12g}|{b:.4f}|-1.0" for a, b in zip(t, SPEED, strict=True)]
    lines = [head, *([below] if below else []), *(row.replace(".", decimal) for row in rows)]
    path.write_text("\n".join(lines).replace("|", between) + "\n")
    return path


@pytest.mark.parametrize(("between", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")])
@pytest.mark.parametrize("below", ["", "s|m/s|m/s2", "[s]|[m/s]|[m/s^2]"])
def test_separators_and_decimals_are_told_by_the_rows(tmp_path: Path, between: str, decimal: str, below: str) -> None:
    log = read_one(_table(tmp_path / "a.csv", between, decimal, below=below))
    assert np.allclose(log.channels["speed_mps"], SPEED, atol=1e-3)
    assert np.allclose(log.t_s, T_S)


def test_quoted_numbers_with_decimal_commas_are_read(tmp_path: Path) -> None:
    rows = [f'"{t:.2f}","{v:.2f}"'.replace(".", ",") for t, v in zip(T_S, SPEED, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(['"t_s","speed_mps"', *rows]).replace('",""', '","'))
    assert np.allclose(read_one(tmp_path / "a.csv").channels["speed_mps"], SPEED, atol=0.01)


def test_a_row_of_units_converts(tmp_path: Path) -> None:
    log = read_one(_table(tmp_path / "a.csv", ";", ",", below="s|km/h|g"))
    assert np.allclose(log.channels["speed_mps"], SPEED / 3.6, atol=1e-3)
    assert np.allclose(log.channels["ax_mps2"], -9.80665)


def test_a_head_with_a_degree_sign_of_an_older_program_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{t:.2f};{v:.2f};9" for t, v in zip(T_S, SPEED, strict=True)]
    path.write_bytes("\n".join(["t_s;speed_mps;yaw_rate_rad_s [°/s]", *rows]).encode("cp1252"))
    assert np.allclose(read_one(path).channels["yaw_rate_rad_s"], np.deg2rad(9.0))


@pytest.mark.parametrize(
    ("between", "rows", "message"),
    [
        (",", ["0,00,20,5", "0,01,20,4"], "semicolons"),
        (";", ["1;1,234", "2;1,235"], "thousands"),
        (";", ["0,00;20.5", "0,01;20.4"], "thousands"),
        (";", ["0,00;1.234,5", "0,01;1.234,5"], "no number"),
    ],
)
def test_numbers_that_read_two_ways_are_refused(tmp_path: Path, between: str, rows: list[str], message: str) -> None:
    (tmp_path / "a.csv").write_text("\n".join([f"t_s{between}speed_mps", *rows * 150]))
    with pytest.raises(UnusableError, match=message):
        read_one(tmp_path / "a.csv")


@pytest.mark.parametrize("head", ["t_s|speed_mps|speed_mps", "t_s|speed_mps [km/h]|speed_mps", "t_s|speed_mps|t_s"])
def test_heads_that_stand_twice_are_refused_by_name_and_place(tmp_path: Path, head: str) -> None:
    with pytest.raises(UnusableError, match=r"(speed_mps at columns 2, 3|t_s at columns 1, 3)"):
        read_one(_table(tmp_path / "a.csv", head=head))


def test_a_mapped_signal_that_stands_twice_is_refused_and_others_are_not(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text('[speed_mps]\nsignal = "v"\n')
    channel_map = load_map(tmp_path / "map.toml")
    with pytest.raises(UnusableError, match="v at columns 2, 3"):
        read_one(_table(tmp_path / "a.csv", head="t_s|v|v"), None, channel_map)
    rows = np.column_stack((T_S, SPEED, SPEED, SPEED))
    np.savetxt(tmp_path / "b.csv", rows, delimiter=",", header="t_s,v,note,note", comments="")
    assert read_one(tmp_path / "b.csv", None, channel_map).has("speed_mps")


def test_parquet_heads_that_stand_twice_are_refused(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet

    table = pa.Table.from_arrays([pa.array(T_S), pa.array(SPEED), pa.array(SPEED)], ["t_s", "speed_mps", "speed_mps"])
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(UnusableError, match="speed_mps at columns 2, 3"):
        read_one(tmp_path / "a.parquet")


@pytest.mark.parametrize(
    ("name", "factor", "start"),
    [
        ("t_s", 1.0, 0.0), ("t_s", 1.0, 1.7e9), ("t_s", 1e3, 1.7e12), ("time", 1e3, 0.0), ("t", 1e6, 0.0),
        ("timestamp", 1e9, 1.7e18), ("t_ms", 1e3, 0.0), ("t_s [ms]", 1e3, 500.0), ("timestamp_ns", 1e9, 0.0),
    ],
)  # fmt: skip
def test_clocks_in_ms_us_ns_and_since_1970_are_seconds_from_zero(name: str, factor: float, start: float) -> None:
    log_t = start + T_S * factor
    if "[" in name:
        from hil.diagnosis.data.columns import Column
        from hil.diagnosis.data.read import from_columns

        log = from_columns("a", {"t_s": Column(log_t, "ms"), "speed_mps": Column(SPEED)})
    else:
        log = from_frame({name: log_t, "speed_mps": SPEED})
    assert np.allclose(log.t_s, T_S, atol=1e-5)


def test_milliseconds_under_a_head_that_says_seconds_are_refused_with_what_to_write() -> None:
    with pytest.raises(UnusableError, match=r"100 samples a second: write `t_s \[ms\]`"):
        from_frame({"t_s": 1e3 * T_S, "speed_mps": SPEED})


def test_without_a_clock_the_columns_are_listed_and_the_one_that_grows_is_proposed() -> None:
    with pytest.raises(UnusableError, match=r'columns seen: v, clock; .*--map CHANNELS.toml: time = "clock"'):
        from_frame({"v": SPEED, "clock": T_S})


def test_no_known_name_lists_what_was_seen_and_what_is_near() -> None:
    with pytest.raises(UnusableError, match=r"columns seen: Speed, mood; near names: speed_mps <- Speed; .*--map"):
        from_frame({"t_s": T_S, "Speed": SPEED, "mood": SPEED})


@pytest.mark.parametrize(
    ("channel", "unit", "message"),
    [
        ("wheel_speed_fl_rad_s", "km/h", "rolling radius"),
        ("speed_mps", "bar", "no unit of speed_mps; expected m/s, km/h"),
        ("pressure_fl_pa", "rpm", "expected Pa, kPa"),
    ],
)
def test_a_unit_of_another_quantity_is_refused(channel: str, unit: str, message: str) -> None:
    from hil.diagnosis.data.columns import Column
    from hil.diagnosis.data.read import from_columns

    with pytest.raises(UnusableError, match=message):
        from_columns("a", {"t_s": Column(T_S), channel: Column(SPEED, unit)})


@pytest.mark.parametrize(
    ("channel", "value", "unit"),
    [("wheel_speed_fl_rad_s", 700.0, "rpm"), ("yaw_rate_rad_s", 20.0, "deg/s"), ("steer_rad", 90.0, "deg"),
     ("pedal", 50.0, "%"), ("speed_mps", 130.0, "km/h")],
)  # fmt: skip
def test_values_out_of_range_name_the_unit_that_fits(channel: str, value: float, unit: str) -> None:
    with pytest.raises(UnusableError, match=rf"wrong unit\? If it is in .*write `{channel} \[") as refused:
        from_frame({"t_s": T_S, channel: np.full(300, value)})
    assert f"[{unit}]" in str(refused.value)


def test_what_was_read_is_told_by_channel() -> None:
    sparse = np.where(np.arange(300) % 10 == 0, SPEED, np.nan)
    sparse[100:200] = np.nan
    log = from_frame({"t_s": T_S, "speed_mps": sparse, "ax_mps2": -T_S, "pressure_fl_pa": np.full(300, np.nan)})
    speed, ax, pressure = channels_read([log])
    assert (speed["log"], speed["channel"], speed["unit"]) == ("dataframe", "speed_mps", "m/s")
    assert speed["rate_hz"] == pytest.approx(10.0)
    assert (speed["gaps"], speed["samples"]) == (1, 20)
    assert speed["nan_share"] == pytest.approx(280 / 300)
    assert (ax["least"], ax["greatest"], ax["gaps"]) == (pytest.approx(-2.99), 0.0, 0)
    assert (pressure["samples"], pressure["least"], pressure["rate_hz"]) == (0, None, None)
    assert any("pressure_fl_pa" in text for text in log.remarks)


def test_mf4_tells_the_rate_of_each_channel_before_any_gridding(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    slow_t = np.arange(30) * 0.1
    with asammdf.MDF() as mdf:
        mdf.append([asammdf.Signal(SPEED * 3.6, T_S, "km/h", "speed_mps")])
        mdf.append([asammdf.Signal(np.full(30, 2.0), slow_t, "bar", "pressure_fl_pa")])
        mdf.save(tmp_path / "a.mf4")
    log = read_one(tmp_path / "a.mf4")
    rows = {row["channel"]: row for row in channels_read([log])}
    assert np.allclose(log.channels["speed_mps"], SPEED)
    assert rows["speed_mps"]["rate_hz"] == pytest.approx(100.0)
    assert (rows["pressure_fl_pa"]["unit"], rows["pressure_fl_pa"]["rate_hz"]) == ("bar", pytest.approx(10.0))
