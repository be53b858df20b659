import argparse
import base64
import json
import re
import zlib

import numpy as np
import pytest

from hil.cli import diff
from hil.errors import BrakebenchError
from hil.log.compare.diff_signals import pairs

DBC = """VERSION ""
BU_: A
BO_ 1 M: 8 A
 SG_ S : 0|16@1+ (0.5,0) [0|0] "km/h" A
 SG_ T : 16|8@1+ (1,0) [0|0] "" A
 SG_ B : 24|1@1+ (1,0) [0|0] "" A
 SG_ F : 32|32@1- (1,0) [0|0] "" A
BO_ 2 N: 1 A
 SG_ U : 0|8@1+ (1,0) [0|0] "" A
VAL_ 1 T 0 "off" 1 "on" 255 "SNA" ;
SIG_VALTYPE_ 1 F : 1;
"""


def run(*words):
    parser = argparse.ArgumentParser()
    diff.add_parser(parser.add_subparsers())
    args = parser.parse_args(["diff", *map(str, words)])
    return args.run(args)


def lines(values, start=1000.0):
    for k, (s, t, b, f) in enumerate(values):
        payload = int(s).to_bytes(2, "little") + bytes([t, b]) + np.float32(f).tobytes()
        yield f"({start + k / 100:.6f}) can0 001#{payload.hex().upper()}\n"


@pytest.fixture
def compare(tmp_path, capsys):
    dbc = tmp_path / "a.dbc"
    dbc.write_text(DBC)

    def compare(one, two, *words, code):
        for name, text in (("a.log", one), ("b.log", two)):
            (tmp_path / name).write_text("".join(text))
        assert run(tmp_path / "a.log", tmp_path / "b.log", "--dbc", dbc, "--json", *words) == code
        found = json.loads(capsys.readouterr().out)
        assert run(tmp_path / "a.log", tmp_path / "b.log", "--dbc", dbc, *words) == code
        return found, capsys.readouterr().out

    return compare


SAME = [(100 + k, 1, 0, 1.5) for k in range(50)]


def test_a_page_draws_what_differs(tmp_path, capsys):
    (tmp_path / "a.dbc").write_text(DBC)
    (tmp_path / "a.log").write_text("".join(lines(SAME)))
    other = [(s + 40 * (k == 20), t, b, f) for k, (s, t, b, f) in enumerate(SAME)]
    (tmp_path / "b.log").write_text("".join(lines(other, start=2000.0)))
    words = (tmp_path / "a.log", tmp_path / "b.log", "--dbc", tmp_path / "a.dbc", "--page", tmp_path / "a.html")
    assert run(*words) == 1
    page = (tmp_path / "a.html").read_text()
    assert "<h3>M.S <small>km/h</small></h3>" in page
    assert "M.T" not in page
    data = re.search(r'id="data">(.*?)</script>', page)[1]
    first, second = json.loads(zlib.decompress(base64.b64decode(data)))["figures"][0]["traces"]
    assert [k for k in range(50) if first["y"][k] != second["y"][k]] == [20]
    assert first["x"] == second["x"]  # each from its own first frame on
    with pytest.raises(BrakebenchError, match="exists already"):
        run(*words)
    with pytest.raises(BrakebenchError, match=r"ends in \.html"):
        run(*words[:-1], tmp_path / "a.png")


def test_a_log_equals_itself(compare):
    found, out = compare(lines(SAME), lines(SAME), code=0)
    assert found["equal"]
    assert found["signals"]["M.S"]["compared"] == 50
    assert " ".join(out.split()).endswith("4 signals of 1 messages compared, 0 differ")


def test_one_raw_step_is_tolerated_but_no_bit_name_or_float(compare):
    near = [(s + 1, t, b, f * (1 + 1e-7)) for s, t, b, f in SAME]
    assert compare(lines(SAME), lines(near), code=0)[0]["equal"]
    for k, changed in enumerate(([102, 1, 0, 1.5], [100, 0, 0, 1.5], [100, 1, 1, 1.5], [100, 1, 0, 1.51])):
        found, _ = compare(lines(SAME), lines([tuple(changed), *SAME[1:]]), code=1)
        different = [name for name, one in found["signals"].items() if one["differing"]]
        assert different == [("M.S", "M.T", "M.B", "M.F")[k]]


def test_from_when_and_by_how_much(compare):
    other = [(s + (10 if k >= 20 else 0) + (6 if k == 30 else 0), t, b, f) for k, (s, t, b, f) in enumerate(SAME)]
    found, out = compare(lines(SAME), lines(other), code=1)
    one = found["signals"]["M.S"]
    assert (one["differing"], one["first_s"], one["greatest"], one["greatest_s"]) == (30, 0.2, 8.0, 0.3)
    assert one["rms"] == pytest.approx(np.sqrt((29 * 25 + 64) / 50))
    assert "M.S" in out
    assert "0.200" in out
    compare(lines(SAME), lines(other), "--tolerance", "M.*=5", code=1)
    compare(lines(SAME), lines(other), "--tolerance", "M.*=5", "--tolerance", "S=8", code=0)


def test_a_value_that_one_log_lacks_is_a_difference(compare):
    found, _ = compare(lines(SAME), lines([*SAME[:10], (110, 255, 0, 1.5), *SAME[11:]]), code=1)
    assert found["signals"]["M.T"]["only_first"] == 1
    assert found["signals"]["M.T"]["first_s"] == 0.1


def test_lost_frames_do_not_shift_the_others(compare):
    kept = list(lines(SAME))
    del kept[20:23]
    found, out = compare(lines(SAME), kept, code=1)
    assert found["messages"]["M"] == {
        "first": 50, "second": 47, "unpaired_first": 3, "unpaired_second": 0, "unpaired_s": 0.2
    }  # fmt: skip
    assert all(one["differing"] == 0 for one in found["signals"].values())
    assert out.endswith(
        "frames without a partner  in A  in B  only in A  from s\n"
        "M                           50    47          3   0.200\n"
    )


def test_logs_of_another_time_are_compared_from_their_first_frames(compare):
    found, _ = compare(lines(SAME), lines(SAME, start=5000.0), code=0)
    assert not found["same_clock"]


def test_messages_and_identifiers_of_one_log_only(compare):
    extra = ["(1000.1) can0 002#01\n", "(1000.2) can0 7FF#01\n"]
    found, out = compare(lines(SAME), [*lines(SAME), *extra], code=1)
    assert found["only_second"] == {"N": 1}
    assert found["unknown"] == {"0x7ff": [0, 1]}
    assert "only in" in out
    compare(lines(SAME), [*lines(SAME), *extra], "--messages", "M", code=0)


def test_wrong_use_is_refused(tmp_path, compare):
    with pytest.raises(BrakebenchError, match="expected a name and a number"):
        compare(lines(SAME), lines(SAME), "--tolerance", "S", code=2)
    for words in (("--signals", "Q"), ("--tolerance", "Q*=1")):
        with pytest.raises(BrakebenchError, match="no signal of the database is called 'Q"):
            compare(lines(SAME), lines(SAME), *words, code=2)


def test_nothing_compared_is_no_equality(compare):
    with pytest.raises(BrakebenchError, match=r"a\.log and .*b\.log: no channel can7; its channels are can0$"):
        compare(lines(SAME), lines(SAME), "--channel", "can7", code=2)
    for words in ((), ("--messages", "M")):
        with pytest.raises(BrakebenchError, match=r"nothing to compare: .*; give the database .* --dbc"):
            compare(["(1.0) can0 7FF#01\n"], ["(1.0) can0 7FF#02\n"], *words, code=2)


def test_times_count_from_the_first_frame_of_the_log_whatever_is_chosen(compare):
    begin = "(999.000000) can1 7FE#\n"
    changed = [*SAME[:30], (500, 1, 0, 1.5), *SAME[31:]]
    for words in ((), ("--channel", "can0")):
        found, _ = compare([begin, *lines(SAME)], [begin, *lines(changed)], *words, code=1)
        assert found["signals"]["M.S"]["first_s"] == pytest.approx(1.3)


def test_pairs_are_one_to_one_and_near():
    rng = np.random.default_rng(5)
    one = np.sort(rng.integers(0, 10_000, 300))
    two = np.sort(np.concatenate((one[::2] + rng.integers(-2, 3, 150), rng.integers(0, 10_000, 40))))
    found = pairs(one, two)
    a, b = found.first, found.second
    assert len(np.unique(a)) == len(a) == len(np.unique(b))
    assert (np.abs(one[a] - two[b]) <= np.median(np.diff(one)) / 2).all()
    assert len(a) > 140


@pytest.mark.parametrize("at_once", [1, 100, 250, 320])
def test_signals_compared_in_groups_give_the_same(compare, monkeypatch, at_once):
    other = [*lines(SAME), *(f"({1000.001 + k / 10:.6f}) can0 002#{k:02X}\n" for k in range(5))]
    changed = [line.replace("002#03", "002#09") for line in other[:30] + other[31:]]
    changed[12] = changed[12].replace("0164", "01FF")
    whole, _ = compare(other, changed, code=1)
    monkeypatch.setattr("hil.log.compare.diff.VALUES_AT_ONCE", at_once)
    monkeypatch.setattr("hil.log.compare.diff_signals.AT_ONCE", 7)
    found, _ = compare(other, changed, code=1)
    assert whole["signals"]["M.S"].pop("rms") == pytest.approx(found["signals"]["M.S"].pop("rms"))
    assert found == whole
    assert list(found["messages"]) == ["M", "N"]
    assert whole["messages"]["M"]["unpaired_first"] == 1
    assert whole["signals"]["N.U"]["greatest"] == 6
