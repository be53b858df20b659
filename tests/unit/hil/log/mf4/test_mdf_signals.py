from dataclasses import dataclass, field

import asammdf
import numpy as np
import pytest

from hil.log.mf4.signals import SignalsWriter, write_signals_mf4

START = 1_700_000_000_123_456_000


@dataclass
class Signal:
    name: str
    unit: str = ""
    choices: dict[int, str] = field(default_factory=dict)
    comment: str = ""


WHEELS = [
    Signal("SPEED", "km/h", comment="of the front left wheel"),
    Signal("GEAR", choices={0: "P", 1: "R", 15: "SNÄ"}),
    Signal("COUNT", "1"),
    Signal("SMALL", "m/s²"),
]
KINDS = [np.float64, np.int64, np.uint8, np.float32]


def samples(n, seed=1):
    rng = np.random.default_rng(seed)
    time_ns = START + np.cumsum(rng.integers(1, 10**7, n))
    columns = [rng.random(n) * 200, rng.choice([0, 1, 15, 7], n), rng.integers(0, 256, n), rng.random(n) - 0.5]
    return time_ns, [c.astype(k) for c, k in zip(columns, KINDS, strict=True)], [None, rng.random(n) < 0.3, None, None]


@pytest.fixture
def written(tmp_path):
    """Two groups, written in pieces; the file, and what was given of the first one."""
    time_ns, columns, invalid = samples(3000)
    path = tmp_path / "a.mf4"
    with path.open("w+b") as file:
        writer = SignalsWriter(file, START)
        wheels = writer.group("WHEELS", "can0", WHEELS, KINDS)
        other = writer.group("OTHER", "can1", [Signal("SPEED", "m/s")], [np.int16])
        for begin in range(0, 3000, 700):
            part = slice(begin, begin + 700)
            writer.add(
                wheels, time_ns[part], [c[part] for c in columns], [m if m is None else m[part] for m in invalid]
            )
            writer.add(other, time_ns[part], [columns[2][part]], [None])
        writer.close()
    return path, time_ns, columns, invalid


def test_asammdf_reads_names_units_comments_and_samples(written):
    path, time_ns, columns, _ = written
    with asammdf.MDF(path) as mdf:
        assert [g.channel_group.acq_name for g in mdf.groups] == ["WHEELS", "OTHER"]
        assert [g.channel_group.acq_source.name for g in mdf.groups] == ["can0", "can1"]
        for k in (0, 2, 3):
            signal = mdf.get(WHEELS[k].name, group=0)
            assert (signal.unit, signal.comment) == (WHEELS[k].unit, WHEELS[k].comment)
            assert signal.samples.dtype == np.dtype(KINDS[k])
            np.testing.assert_array_equal(signal.samples, columns[k])
            np.testing.assert_allclose(signal.timestamps * 1e9, time_ns - START, atol=1)
        signal = mdf.get("SPEED", group=1)
        assert (signal.unit, signal.samples.dtype) == ("m/s", np.int16)


def test_asammdf_reads_value_names_and_leaves_out_what_is_absent(written):
    path, time_ns, columns, invalid = written
    there = ~invalid[1]
    with asammdf.MDF(path) as mdf:
        named = mdf.get("GEAR", group=0)
        raw = mdf.get("GEAR", group=0, raw=True)
    names = {0: "P", 1: "R", 15: "SNÄ", 7: ""}
    assert [s.decode() for s in named.samples] == [names[v] for v in columns[1][there].tolist()]
    np.testing.assert_array_equal(raw.samples, columns[1][there])
    np.testing.assert_allclose(raw.timestamps * 1e9, (time_ns - START)[there], atol=1)


def test_groups_are_written_in_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr("hil.log.mf4.signals.BLOCK_BYTES", 4096)
    time_ns, columns, invalid = samples(20_000)
    path = tmp_path / "a.mf4"
    with path.open("w+b") as file:
        write_signals_mf4(file, START, [("WHEELS", "can0", WHEELS, time_ns, columns, invalid)])
    assert path.read_bytes().count(b"##DL") > 1
    with asammdf.MDF(path) as mdf:
        np.testing.assert_array_equal(mdf.get("COUNT").samples, columns[2])


def test_what_all_groups_hold_in_memory_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr("hil.log.mf4.signals.HELD_BYTES", 10_000)
    with (tmp_path / "a.mf4").open("w+b") as file:
        writer = SignalsWriter(file, START)
        groups = [writer.group(f"M{k}", "can0", [Signal("S")], [np.int64]) for k in range(50)]
        for _ in range(10):
            for group in groups:
                writer.add(group, START + np.arange(20), [np.arange(20)], [None])
                assert sum(g.size for g in writer._groups) <= 10_000
        writer.close()
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        assert [g.channel_group.cycles_nr for g in mdf.groups] == [200] * 50


def test_a_group_without_a_sample_and_stamps_before_the_start(tmp_path):
    with (tmp_path / "a.mf4").open("w+b") as file:
        writer = SignalsWriter(file, START)
        writer.group("EMPTY", "can0", [Signal("S")], [np.float64])
        group = writer.group("M", "can0", [Signal("S")], [np.int64])
        writer.add(group, np.array([START - 5, START + 7]), [np.array([-1, 2**62])], [None])
        writer.close()
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        signal = mdf.get("S", group=1)
    np.testing.assert_array_equal(signal.samples, [-1, 2**62])
    np.testing.assert_allclose(signal.timestamps, [-5e-9, 7e-9])


@pytest.mark.parametrize("kind", ["U5", "complex128", "datetime64[ns]"])
def test_values_that_have_no_place_are_refused(tmp_path, kind):
    with (tmp_path / "a.mf4").open("w+b") as file:
        writer = SignalsWriter(file, START)
        with pytest.raises(TypeError, match="signal S: values of type"):
            writer.group("M", "can0", [Signal("S")], [kind])
