"""What docs/logs.md shows of the Python interface runs as it stands there."""

from pathlib import Path

from dbc.contract import encode, spec_of
from dbc.frame import BusName
from dbc.messages import WheelSpeedFront

PAGE = Path(__file__).parents[4] / "docs" / "logs.md"


def test_the_python_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("run").mkdir()
    spec = spec_of(WheelSpeedFront)
    frame = f"{BusName.VEHICLE.value} {spec.can_id:03X}"
    lines = [f"({k / 100:.6f}) {frame}#{encode(WheelSpeedFront(k, 2 * k), k % 15).hex()}" for k in range(20)]
    Path("run/recording.log").write_text("\n".join(lines) + "\n")
    shown = {}
    exec(PAGE.read_text().split("```python\n")[1].split("```")[0], shown)  # noqa: S102 (our own page)
    assert shown["frames"].num_rows == 20
    assert shown["speed"].tolist() == list(range(20))
    assert "WHEEL_SPEED_FR" in shown["wheels"].column_names
    assert capsys.readouterr().out.endswith("0 None\n")
