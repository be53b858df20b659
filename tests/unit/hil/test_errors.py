import errno
import os

import pytest

from hil.cli.main import main
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.vehicle.extension_file import load_channels, load_extension
from hil.errors import in_words, unknown_keys

TABLE = "t_s,ax_mps2\n" + "".join(f"{0.01 * n:.2f},{-0.001 * n:.3f}\n" for n in range(200))


def test_a_system_error_is_said_without_its_number():
    assert in_words(OSError(errno.EISDIR, os.strerror(errno.EISDIR), "a/b")) == "Is a directory"
    assert in_words(ValueError("no number")) == "no number"
    with pytest.raises(UnicodeDecodeError) as raised:
        b"a\xff".decode()
    assert in_words(raised.value) == "no text in UTF-8 (byte 1 is 0xff)"


def test_unknown_keys_name_what_may_have_been_meant():
    assert unknown_keys(["a"], ["a", "b"]) is None
    assert unknown_keys(["speeed", "x"], ["speed", "mass"]) == (
        "unknown key 'speeed', 'x'; known here: speed, mass; did you mean 'speed'?"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[efects.drag_area]\nfactor = 1.1\n", "unknown key 'efects'; .* did you mean 'effects'"),
        (
            "[parameters]\nvehicle_mas_kg = 1500.0\n",
            "parameters: unknown key 'vehicle_mas_kg'; .* did you mean 'vehicle_mass_kg'",
        ),
        ("vehicle = 3\n", "unknown key 'vehicle'"),
    ],
)
def test_an_extension_with_an_unknown_key_is_refused(tmp_path, text, said):
    path = tmp_path / "extension.toml"
    path.write_text(text)
    with pytest.raises(UnusableError, match=said):
        load_extension(path)
    if "parameters" not in text:
        with pytest.raises(UnusableError, match=said):
            load_channels(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('["a.csv"]\ndirektion = -1\n', "a.csv: unknown key 'direktion'; .* did you mean 'direction'"),
        ("direction = -1\n", "direction: expected tables alone"),
        ('["a.csv"]\ndirection = "west"\n', "direction: expected 1 or -1, got 'west'"),
        ('["a.csv"]\ninitial_disc_temperature_k = "hot"\n', "expected 200 to 1300, got 'hot'"),
        ("no toml", "not valid TOML"),
    ],
)
def test_a_wrong_logs_toml_is_refused(tmp_path, text, said):
    (tmp_path / "a.csv").write_text(TABLE)
    (tmp_path / "logs.toml").write_text(text)
    with pytest.raises(UnusableError, match=said):
        read_logs([tmp_path / "a.csv"])


@pytest.mark.parametrize("option", ["--map", "--logs", "--vehicle"])
def test_a_folder_for_a_file_is_said_in_words(tmp_path, capsys, option):
    (tmp_path / "a.csv").write_text(TABLE)
    more = [] if option == "--vehicle" else ["--vehicle", "paper_car"]
    assert main(["explain", str(tmp_path / "a.csv"), *more, option, str(tmp_path), "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert "Is a directory" in said or "expected" in said
    assert "Errno" not in said


def test_a_folder_for_an_extension_is_said_in_words(tmp_path):
    with pytest.raises(UnusableError, match="not an extension file: Is a directory"):
        load_extension(tmp_path)
