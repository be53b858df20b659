import gzip
import io
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

from hil.log.account import Account
from hil.log.atomic_write import atomic_write
from hil.log.frames import LogError
from hil.log.read import open_log
from hil.log.source import Source

DATA = Path(__file__).parents[3] / "data" / "logs"
TEXT = "".join(f"(1.{k:06d}) can0 {k % 2048:03X}#{k % 256:02X}\n" for k in range(20_000)).encode()


def frames_of(path, **options):
    with open_log(path, **options) as log:
        return len(log.frames()), log.account


def test_a_packed_log_is_unpacked_on_the_way(tmp_path):
    frames, account = frames_of(DATA / "log.log.gz")
    assert (frames, account.whole) == (200, True)
    frames, account = frames_of(DATA / "log.asc.gz")
    assert (frames, account.whole) == (1, True)
    path = tmp_path / "a"
    path.write_bytes(gzip.compress(TEXT[:1000]) + gzip.compress(TEXT[1000:]))  # two members, as zcat takes them
    assert frames_of(path)[0] == 20_000


@pytest.mark.parametrize("size", [30, 1000, 20_000, -1, -8])
def test_a_packed_log_that_is_cut_off(tmp_path, size):
    path = tmp_path / "a.gz"
    packed = gzip.compress(TEXT)[:size]
    path.write_bytes(packed)
    inflated = zlib.decompressobj(31).decompress(packed)
    with open_log(path, "candump") as log:
        frames = len(log.frames())
        account = log.account
    assert frames >= inflated.count(b"\n") - 1
    assert account.truncated_at is not None
    assert account.truncated_at <= len(TEXT)


@pytest.mark.parametrize("at", [30, 0.5, 0.99, -5])
def test_all_before_a_damage_within_a_packed_log_is_read(tmp_path, at):
    """Damage: a reserved block type, which no inflater takes; or a wrong check value at the end."""
    compressor = zlib.compressobj(wbits=31)
    parts = [
        compressor.compress(TEXT[k : k + 9200]) + compressor.flush(zlib.Z_FULL_FLUSH) for k in range(0, 460_000, 9200)
    ]
    whole = {30: 1, 0.5: 25, 0.99: 49, -5: 50}[at]
    packed = b"".join(parts[:whole])
    if at == -5:
        packed += compressor.flush()[:-5] + bytes(5)
    else:
        packed += b"\x07" + b"".join(parts[whole:])
    path = tmp_path / "a.gz"
    path.write_bytes(packed)
    frames, account = frames_of(path)
    assert frames == whole * 400
    assert account.truncated_at == whole * 9200
    assert any("damaged gzip file" in note for note in account.notes)
    frames, account = frames_of(path, limit_bytes=whole * 9200)
    assert frames == whole * 400


def test_no_more_than_the_limit_is_read(tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(TEXT)
    limit = 100 * len(TEXT.splitlines(True)[0])
    frames, account = frames_of(path, limit_bytes=limit)
    assert frames == 100
    assert account.truncated_at == limit
    path.write_bytes(gzip.compress(TEXT))
    assert frames_of(path, limit_bytes=limit)[0] == 100
    assert frames_of(path, limit_bytes=len(TEXT))[1].whole


def test_a_packed_log_that_unpacks_to_very_much_is_limited_too(tmp_path):
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(TEXT + b"\n" * 50_000_000))
    frames, account = frames_of(path, limit_bytes=1_000_000)
    assert frames == 20_000
    assert account.truncated_at == 1_000_000


def test_a_packed_log_can_be_sought_in(tmp_path):
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(TEXT))
    with Source(path) as source:
        source.read(100)
        file = source.random_access()
        assert file.seek(0, 2) == len(TEXT)
        file.seek(10)
        assert file.read(10) == TEXT[10:20]
        source.rewind(Account())
        assert source.read(10) == TEXT[:10]


def test_standard_input_can_be_read_again_and_again():
    script = (
        "from hil.log.read import open_log\n"
        "with open_log('-') as log:\n"
        "    print(log.format.name, *(sum(map(len, log.tables())) for _ in range(2)))\n"
    )
    for content in (TEXT, gzip.compress(TEXT)):
        done = subprocess.run([sys.executable, "-c", script], input=content, capture_output=True, check=True)
        assert done.stdout.split() == [b"candump", b"20000", b"20000"]


def test_what_cannot_be_opened(tmp_path):
    with pytest.raises(LogError, match="cannot be opened: No such file"):
        Source(tmp_path / "none")
    with pytest.raises(LogError, match="is a folder; give a log file"):
        Source(tmp_path)
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(LogError, match="empty: no log in it"):
        open_log(tmp_path / "empty")


def test_a_log_is_not_replaced_by_what_is_made_of_it(tmp_path):
    log = tmp_path / "self.csv"
    content = (DATA / "self.csv").read_bytes()
    log.write_bytes(content)
    (tmp_path / "link.csv").symlink_to(log)
    (tmp_path / "hard.csv").hardlink_to(log)
    for target in (log, tmp_path / "link.csv", tmp_path / "hard.csv", tmp_path / "." / "self.csv"):
        with pytest.raises(LogError, match="is read by this command too"), atomic_write(target, True, [log]) as path:
            path.write_text("lost")
    assert log.read_bytes() == content
    other = tmp_path / "other.csv"
    other.write_text("old")
    with atomic_write(other, True, [log]) as path:
        path.write_text("new")
    assert other.read_text() == "new"


def test_output_appears_whole_or_not_at_all(tmp_path):
    def write():
        with atomic_write(tmp_path / "a.csv") as path:
            path.write_text("half")
            raise io.UnsupportedOperation("disk full")

    with pytest.raises(LogError, match="cannot be written"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_a_format_that_is_none_is_refused(tmp_path):
    (tmp_path / "a.log").write_text("(1.0) can0 123#11\n")
    with pytest.raises(LogError, match="no format is called 'xyz'; known are candump, "):
        open_log(tmp_path / "a.log", form="xyz")
