"""Decoded signals message by message: a folder of Parquet files, an MF4 file with a group or MCAP with a topic each."""

import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Self

import pyarrow as pa
import pyarrow.parquet

from hil.log.atomic_write import atomic_write, orderly_end, temporary_stem
from hil.log.export.blocks import Block, Layout, grouped, of_message
from hil.log.export.tables import batch_of, check_suffix, export_blocks, opened, schema_of
from hil.log.frames import LogError

MAX_FILES = 800  # open at the same time
CELLS_PER_GROUP = 125_000  # kept of one message before they are written
CELLS_HELD = 1_000_000  # of all messages together


def write_signals(
    blocks: Iterable[Block], layout: Layout, target: str, overwrite: bool = False, read: Iterable[Path] = ()
) -> int:
    """Write blocks as the target says and return the number of rows.

    Parameters
    ----------
    target : ``NAME.csv`` and ``NAME.parquet`` are wide tables, ``NAME.mf4`` has one group, ``NAME.mcap`` one topic
        and ``NAME/`` one Parquet file for each message.
    overwrite, read : as of `hil.log.export.tables.export`; in a folder, files of other names are left alone.

    Raises
    ------
    LogError
        For another suffix, when the target exists, and when it cannot be written.
    """
    check_target(target)
    path = Path(target)
    if not target.endswith("/") and path.suffix not in (".mf4", ".mcap"):
        return export_blocks(blocks, layout, path, overwrite, read)
    rows = 0
    if path.suffix == ".mcap" and not target.endswith("/"):
        from hil.log.export.mcap_file import write_mcap

        return write_mcap(blocks, layout, path, overwrite, read)
    if path.suffix == ".mf4" and not target.endswith("/"):
        from hil.log.export.mf4_file import Mf4Groups

        with atomic_write(path, overwrite, read) as temporary, Mf4Groups(temporary, layout) as groups:
            for block in blocks:
                groups.write(block)
                rows += len(block)
        return rows
    with _atomic_folder(path, overwrite, read) as folder, MessageFolder(folder, layout) as files:
        for block in blocks:
            files.write(block)
            rows += len(block)
    return rows


def check_target(target: str) -> None:
    """Refuse a target whose suffix names no known kind of output."""
    if not target.endswith("/"):
        check_suffix(Path(target), (".csv", ".parquet", ".mf4", ".mcap"))
        if target.endswith(".mcap"):
            from hil.log.export.mcap_file import check_extra

            check_extra(Path(target))


@contextmanager
def _atomic_folder(path: Path, overwrite: bool, read: Iterable[Path]) -> Iterator[Path]:
    """Yield a temporary folder; its files appear in ``path`` when the block ends without an error."""
    if path.exists() and not overwrite:
        raise LogError(path, "exists already; use --force to write into it, or give another name")
    if path.exists() and not path.is_dir():
        raise LogError(path, "is a file; give another name for the folder")
    temporary = path.with_name(temporary_stem(path.name))
    with orderly_end(), _placed(path, temporary, read):
        yield temporary


@contextmanager
def _placed(path: Path, temporary: Path, read: Iterable[Path]) -> Iterator[None]:
    """Have a temporary folder in the block; its files are in ``path`` behind it."""
    try:
        temporary.mkdir(parents=True)
        yield
        if not path.exists():
            temporary.replace(path)
            return
        files = sorted(temporary.iterdir())
        for file in files:
            there = path / file.name
            if there.exists() and any(other.exists() and there.samefile(other) for other in read):
                raise LogError(there, "is read by this command too; give another folder for the output")
        for file in files:
            file.replace(path / file.name)
    except OSError as error:
        raise LogError(path, f"cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


class MessageFolder(AbstractContextManager["MessageFolder"]):
    """One Parquet file for each message, with the columns ``time``, ``channel`` (where needed) and its signals."""

    def __init__(self, folder: Path, layout: Layout) -> None:
        self._folder = folder
        self._layout = layout
        self._groups = grouped(layout)
        if len(self._groups) > MAX_FILES:
            raise LogError(
                folder, f"{len(self._groups)} messages; at most {MAX_FILES} files are written, choose with --messages"
            )
        self._open = ExitStack()
        self._writers: dict[str, pa.parquet.ParquetWriter] = {}
        self._held: dict[str, list[pa.RecordBatch]] = {}
        self._cells: dict[str, int] = {}
        self._names = _file_names(self._groups)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the files."""
        for message in list(self._held):
            self._flush(message)
        for writer in self._writers.values():
            writer.close()
        self._writers.clear()
        self._open.close()

    def write(self, block: Block) -> None:
        """Write further rows."""
        for message, fields in self._groups.items():
            own = of_message(block, message, fields)
            if own is None:
                continue
            schema = self._schema(message)
            self._held.setdefault(message, []).append(batch_of(own, self._layout, fields, schema, 0, len(own)))
            self._cells[message] = self._cells.get(message, 0) + len(own) * len(schema)
            if self._cells[message] > CELLS_PER_GROUP:
                self._flush(message)
        if sum(self._cells.values()) > CELLS_HELD:
            for message in list(self._held):
                self._flush(message)

    def _schema(self, message: str) -> pa.Schema:
        return schema_of(self._layout, self._groups[message], "{0.signal.name}")

    def _flush(self, message: str) -> None:
        batches = self._held.pop(message, [])
        self._cells.pop(message, None)
        if message not in self._writers:
            file = self._open.enter_context(opened(self._folder / f"{self._names[message]}.parquet"))
            self._writers[message] = pa.parquet.ParquetWriter(file, self._schema(message), compression="zstd")
        self._writers[message].write_table(pa.Table.from_batches(batches))


def _file_names(messages: Iterable[str]) -> dict[str, str]:
    """Names of files: letters that a file system might refuse are replaced, and each one is used once."""
    names: dict[str, str] = {}
    taken: set[str] = set()
    for message in messages:
        plain = re.sub(r"[^\w@.+-]", "_", message).lstrip(".")[:100] or "message"
        name, number = plain, 2
        while name.lower() in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name.lower())
        names[message] = name
    return names
