"""The signals of a whole log as an MCAP file, in bounded memory."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hil.log.account import Account
from hil.log.export.blocks import Field, Layout, blocks_of
from hil.log.export.mcap_file import check_extra, write_mcap
from hil.log.frames import LogError
from hil.log.read import Progress, open_log
from hil.log.signals.databases import Databases
from hil.log.source import DEFAULT, ReadOptions
from hil.log.summary.contents import Contents


@dataclass(frozen=True, slots=True)
class Written:
    """What became of a log.

    Attributes
    ----------
    frames : read, of them ``messages`` are in the file and ``unknown`` have no message in the databases.
    rejected : frames that are shorter than their message.
    """

    format: str
    account: Account
    frames: int
    messages: int
    unknown: int
    rejected: int


def write_signals_of(
    source: Path,
    target: Path,
    databases: Databases,
    overwrite: bool = False,
    options: ReadOptions = DEFAULT,
    progress: Progress | None = None,
    read: Iterable[Path] = (),
) -> Written:
    """Write every signal of a log as MCAP; the log is read twice.

    Parameters
    ----------
    read : files that are never replaced, beside the source.

    Raises
    ------
    LogError
        When the source cannot be read or no message of the databases is in it, and as of `write_mcap`.
    """
    check_extra(target)
    contents = Contents(databases)

    def half(part: int) -> Progress | None:
        return None if progress is None else lambda done: progress((part + done) / 2)

    with open_log(source, options=options) as log:
        for table in log.tables(half(0)):
            contents.add(table)
        summary, counts = contents.summary(), contents.counts
        if not summary.frames:
            raise LogError(source, "no frame could be read; give a CAN log")
        if not contents.signals:
            raise LogError(source, "no frame has a message in the databases; name the car's database with --dbc FILE")
        fields = tuple(Field(one.message, one.signal, one.dtype) for one in contents.signals.values())
        layout = Layout(fields, start_ns=summary.first_ns, channel_of=contents.channel_of())
        blocks = blocks_of(log.tables(half(1)), databases.decoder(None))
        messages = write_mcap(blocks, layout, target, overwrite, [source, *read])
        return Written(log.format.name, log.account, summary.frames, messages, counts.unknown, counts.rejected)
