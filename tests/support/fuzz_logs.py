"""Coverage-guided fuzzing of one log format: both ways of reading must agree, and nothing but LogError is raised.

    pip install atheris
    python tests/support/fuzz_logs.py FORMAT FOLDER -max_total_time=600 -max_len=4096 -rss_limit_mb=2048

FORMAT is a name of `hil.log.formats`; FOLDER keeps the inputs found, seeded from tests/data/logs.
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["hil.log"]):
    from hil.log.account import Account
    from hil.log.blf import blf  # noqa: F401
    from hil.log.builder import FrameBuilder
    from hil.log.capture import pcap  # noqa: F401
    from hil.log.formats import BY_NAME, told
    from hil.log.frames import FrameTable, LogError
    from hil.log.source import ReadOptions, Source
    from hil.log.text import asc, busmaster, candump, candump_screen, csv_tables, trc  # noqa: F401

SEEDS = Path(__file__).parents[1] / "data" / "logs"
SCRATCH = Path(tempfile.mkdtemp()) / "log"


def read(form, fast):
    """Frames and account of the scratch file, or the error."""
    account = Account()
    with Source(SCRATCH) as source:
        source.rewind(account)
        try:
            tables = list(form.read(source, account, ReadOptions(fast=fast)))
        except LogError as error:
            return str(error)
    table = FrameTable.joined(tables, tables[-1].channels).widened(64)
    columns = [table.time_ns, table.channel, table.can_id, table.extended, table.length, table.data, table.flags]
    return [column.tobytes() for column in columns], table.channels, account


def main():
    """Fuzz one format."""
    FrameBuilder.__init__.__defaults__ = (None, 64)  # rows of a table: what is not allocated is not waited for
    form = BY_NAME[sys.argv[1]]
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for seed in SEEDS.rglob("*"):
        content = seed.read_bytes() if seed.is_file() else b""
        if len(content) < 4096 and told(content) is form:
            (folder / seed.name).write_bytes(content)

    def one(content):
        SCRATCH.write_bytes(content)
        careful, fast = read(form, False), read(form, True)
        assert careful == fast, (careful, fast)

    atheris.Setup([sys.argv[0], str(folder), *sys.argv[3:]], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
