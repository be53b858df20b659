"""Dynamometer records: what is read, and what is refused with file, line and column."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.identify.record import RecordError, averaged, read_record

HEAD = "time [s],pressure [bar],speed [m/s],torque [N m],temperature [degC]"


def rows(count=300, step=0.1):
    return [f"{i * step:.2f},{10 + 5 * (i % 3)},4.0,{200 + i % 5},{80 + 0.1 * i:.1f}" for i in range(count)]


@pytest.fixture
def read(tmp_path):
    def write_and_read(text, **options):
        path = tmp_path / "dyno.csv"
        path.write_text(text, **options)
        return read_record(path)

    return write_and_read


def test_units_become_si_and_time_starts_at_zero(read):
    lines = rows()
    record = read("\n".join([HEAD, *lines[50:]]))
    assert record.time_s[0] == 0.0
    assert record.time_s[-1] == pytest.approx(24.9)
    assert record.pressure_pa[1] == pytest.approx(10e5)
    assert record.speed_mps[0] == 4.0
    assert record.torque_nm[0] == 200.0
    assert record.temperature_k[0] == pytest.approx(85.0 + 273.15)
    assert record.name == "dyno.csv"


def test_columns_in_any_order_others_beside_remarks_and_byte_order_mark(read):
    text = ["# made in room 4", "", " Temperature [degC] ,x,torque [N m],speed [m/s],pressure [bar],time [s]"]
    text += [f"80,what,{i % 7},4,{i % 9},{i / 10}" for i in range(300)]
    record = read("\n".join(text), encoding="utf-8-sig")
    assert record.remarks == ("made in room 4",)
    assert record.torque_nm[6] == 6.0
    assert record.pressure_pa[8] == 8e5


def changed(line, column, value):
    text = rows()
    cells = text[line - 2].split(",")
    cells[column] = value
    text[line - 2] = ",".join(cells)
    return "\n".join([HEAD, *text])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        (HEAD.replace("torque [N m],", "") + "\n1,2,3,4", r":1: missing column 'torque \[N m\]'"),
        (HEAD.replace("[bar]", "[MPa]"), r":1: column 'pressure': expected unit 'bar', got unit 'MPa'"),
        (HEAD.replace(" [m/s]", ""), r":1: column 'speed': expected unit 'm/s', got no unit"),
        (HEAD + ",time [s]", ":1: column 'time' stands twice"),
        (changed(17, 3, "n/a"), r":17: column 'torque \[N m\]': expected a number, got 'n/a'"),
        (changed(17, 3, ""), r":17: column 'torque \[N m\]': expected a number, got ''"),
        (changed(40, 4, "nan"), r":40: column 'temperature \[degC\]': expected a finite number"),
        (changed(40, 1, "inf"), r":40: column 'pressure \[bar\]': expected a finite number"),
        (changed(40, 4, "353.15e1"), r":40: column 'temperature \[degC\]': expected -50 to 1200 degC"),
        (changed(90, 0, "8.60"), r":90: column 'time \[s\]': expected an increasing time, got 8.6 s after 8.7 s"),
        (changed(90, 0, "8.70"), r":90: column 'time \[s\]': expected an increasing time"),
        (changed(90, 1, "1,5"), r":90: expected 5 cells as in the head, got 6.*decimals with a point"),
        (changed(90, 1, '"1'), "CSV|cells"),
        ("\n".join([HEAD, *rows(150), *[f"{20 + i / 10},{i % 5},4,1,80" for i in range(150)]]), ":152: .*gap of 5.1 s"),
        ("\n".join([HEAD, *rows(100, 0.5)]), "too short: 100 samples over 49.5 s"),
        ("\n".join([HEAD, *rows(300, 0.05)]), "too short: 300 samples over 14.95 s"),
        (HEAD, "too short: 0 samples"),
        ("\n".join([HEAD, *[f"{i / 10},10,4,200,80" for i in range(300)]]), r"pressure \[bar\].*moves by 0 bar only"),
        ("\n".join([HEAD, *[f"{i / 10},{i % 9},0,0,80" for i in range(300)]]), r"speed \[m/s\].*stands still"),
        (
            "\n".join([HEAD, *[f"{i / 10},{i % 9},4,-200,80" for i in range(300)]]),
            "mean torque is -200 N m",
        ),
    ],
)
def test_refuses_and_names_the_place(read, text, said):
    with pytest.raises(RecordError, match=said) as refused:
        read(text)
    assert "dyno.csv" in str(refused.value)
    assert refused.value.exit_code == 2


def test_refuses_what_is_no_text_or_not_there(tmp_path):
    (tmp_path / "binary.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(RecordError, match="not UTF-8 text"):
        read_record(tmp_path / "binary.csv")
    with pytest.raises(RecordError, match=r"absent.csv: cannot be read \(No such file"):
        read_record(tmp_path / "absent.csv")


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    line=st.integers(0, 300),
    text=st.text(st.characters(codec="utf-8"), max_size=30),
    replace=st.booleans(),
)
def test_any_damaged_line_is_read_or_refused_but_nothing_else(tmp_path, line, text, replace):
    lines = [HEAD, *rows()]
    lines[line] = text if replace else lines[line] + text
    path = tmp_path / "damaged.csv"
    path.write_text("\n".join(lines), encoding="utf-8", newline="")
    try:
        record = read_record(path)
    except RecordError as error:
        refusal = str(error)
    else:
        refusal = None
        assert record.time_s.size >= 200
        assert np.all(np.diff(record.time_s) > 0.0)
        assert all(np.all(np.isfinite(v)) for v in (record.pressure_pa, record.torque_nm, record.temperature_k))
    assert refusal is None or "damaged.csv" in refusal


def test_a_fast_record_is_averaged_and_a_slow_one_left_alone(read):
    fast = read("\n".join([HEAD, *[f"{i / 200},{i % 10},4,{i % 10},80" for i in range(6003)]]))
    mean = averaged(fast)
    assert mean.averaged == 10
    assert mean.time_s.size == 600
    assert np.diff(mean.time_s) == pytest.approx(0.05)
    assert mean.time_s[0] == 0.0
    assert mean.torque_nm == pytest.approx(4.5)
    slow = read("\n".join([HEAD, *rows()]))
    assert averaged(slow) is slow
