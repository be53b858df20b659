import json

import pytest

from hil.cli.main import main
from hil.validation.reproduce import identification, study
from hil.validation.reproduce.study import Row

ROW = Row("9", "torque", "%", 6.0, 16.0, 1.0, 1.2, 3.0, "p95", True, "nominal", 3, None)


@pytest.fixture
def quick(monkeypatch):
    asked = []
    monkeypatch.setattr(identification, "shipped_study", lambda: None)
    monkeypatch.setattr(identification, "identification_rows", lambda _: [])
    monkeypatch.setattr(study, "measure", lambda seeds, *_: asked.append(seeds) or [ROW])
    return asked


def test_json_is_one_object_alone_on_stdout(quick, capsys):
    assert main(["reproduce", "--seeds", "3", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert quick == [3]
    assert rows[0]["median"] == 1.0
    assert rows[0]["met"] is True
    assert {"figure", "claim", "paper", "paper_method", "median", "p95", "goal", "met", "conditions"} <= set(rows[0])


def test_prints_the_table(quick, capsys):
    assert main(["reproduce"]) == 0
    out = capsys.readouterr().out
    assert quick == [20]
    assert "torque" in out
    assert "1 of 1 goals met" in out


def test_refuses_no_seeds(quick, capsys):
    assert main(["reproduce", "--seeds", "0"]) == 2
    assert "at least 1" in capsys.readouterr().err


def test_an_extension_no_car_can_have_is_refused_before_anything_is_driven(quick, tmp_path, capsys):
    path = tmp_path / "extension.toml"
    path.write_text("[effects.mass_offset]\nmass_kg = 1e6\n")
    assert main(["reproduce", "--extend", str(path)]) == 2
    assert "mass_offset" in capsys.readouterr().err
    assert main(["reproduce", "--extend", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert quick == []
