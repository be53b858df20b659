"""Where the bytes of a log come from: a file, a gzip file, standard input."""

import shutil
import sys
import tempfile
import zlib
from dataclasses import dataclass
from datetime import UTC, tzinfo
from pathlib import Path
from typing import IO, Any, Self

from hil.errors import in_words
from hil.log.account import Account
from hil.log.frames import LogError

HEAD_BYTES = 65_536  # enough to tell the format
FEW_BYTES = 1_000_000  # a log of fewer is read without the compiled pass, whose loading takes longer (0.3 s)
PACKING = 10  # a log is so many times as large as its gzip file, about
STDIN = "-"
PACKED_BYTES = 16_384
GZIP_BITS = 31  # zlib's name for a gzip frame around the stream
_GZIP = b"\x1f\x8b"

_ZLIB: Any
try:
    from isal import isal_zlib

    _ZLIB = isal_zlib  # three times as fast
except ImportError:
    _ZLIB = zlib


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a log is read.

    Attributes
    ----------
    timezone : zone of the wall clocks in the headers of BLF, ASC and TRC, which name none.
    fast : False never uses the compiled passes, True always; None leaves small logs to the careful parsers.
    """

    timezone: tzinfo = UTC
    fast: bool | None = None


DEFAULT = ReadOptions()


class Source:
    """Bytes of one log, read from its begin as often as needed.

    Parameters
    ----------
    path : a file, which may be packed with gzip; ``-`` is standard input. Standard input and pipes are kept in a
        temporary file.
    limit_bytes : most bytes that are read (unpacked); what lies behind counts as cut off. None reads all.

    Attributes
    ----------
    once : it cannot be opened a second time.

    Raises
    ------
    LogError
        When it cannot be opened.
    """

    def __init__(self, path: Path | str, limit_bytes: int | None = None) -> None:
        self.path = Path(path)
        self.limit_bytes = limit_bytes
        self.account = Account()
        self._kept: IO[bytes] | None = None
        try:
            self._raw: IO[bytes] = _standard_input() if str(path) == STDIN else self.path.open("rb")
            self.once = str(path) == STDIN or not self._raw.seekable()
            if self.once:
                self._raw = _spooled(self._raw)
            self.size = self._raw.seek(0, 2)
            self._raw.seek(0)
            self.packed = self._raw.read(2) == _GZIP
        except IsADirectoryError as error:
            raise LogError(
                path, "is a folder; give a log file, or several as a quoted pattern: 'FOLDER/*.blf'"
            ) from error
        except OSError as error:
            raise LogError(path, f"cannot be opened: {error.strerror or error}; give a log file") from error
        self._position = 0
        self.rewind(self.account)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._raw.close()
        if self._kept is not None:
            self._kept.close()

    def rewind(self, account: Account) -> None:
        """Begin anew; a log that ends inside its gzip stream is noted in ``account`` as cut off."""
        self.account = account
        self._position = 0
        self._raw.seek(0)
        self._stream = GzipStream(self._raw) if self.packed else self._raw

    def read(self, size: int) -> bytes:
        """At most ``size`` bytes; fewer at the end of what can be read, none behind it."""
        limited = self.limit_bytes is not None and self._position + size > self.limit_bytes
        if self.limit_bytes is not None and limited:
            size = self.limit_bytes - self._position
        try:
            content = self._stream.read(size)
            if limited and size == 0 and self._stream.read(1):
                self.account.note(f"only the first {self.limit_bytes} bytes are read")
                self.account.cut_at(self._position)
        except DamagedError as error:
            content = b""
            self.account.note(f"damaged gzip file: {error}")
            self.account.cut_at(self._position)
        except OSError as error:
            raise LogError(self.path, f"cannot be read: {in_words(error)}", self._position) from error
        self._position += len(content)
        return content

    def few(self, taken: int) -> bool:
        """Whether the log is small, as far as can be told where ``taken`` bytes of it have been read."""
        return taken < FEW_BYTES and self.size < (FEW_BYTES // PACKING if self.packed else FEW_BYTES)

    @property
    def done(self) -> float:
        """Share of the file that has been read, 0 to 1."""
        return min(1.0, self._raw.tell() / self.size) if self.size else 1.0

    def head(self) -> bytes:
        """The first `HEAD_BYTES` (unpacked); reading begins anew."""
        account = self.account
        self.rewind(Account())
        head = bytearray()
        while len(head) < HEAD_BYTES and (part := self.read(HEAD_BYTES - len(head))):
            head += part
        self.rewind(account)
        return bytes(head)

    def random_access(self) -> IO[bytes]:
        """A file that can be sought in, at its begin; a packed log is unpacked into a temporary file."""
        if not self.packed:
            self._raw.seek(0)
            return self._raw
        if self._kept is None:
            self.rewind(self.account)
            self._kept = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the source)
            while part := self.read(1 << 20):
                self._kept.write(part)
        self._kept.seek(0)
        return self._kept


class DamagedError(Exception):
    """A gzip stream that cannot be unpacked any further."""


class GzipStream:
    """Content of a gzip file of one or more members; what is sound before a damage is given out first."""

    def __init__(self, raw: IO[bytes]) -> None:
        self._raw = raw
        self._inflater: Any = None
        self._packed = b""
        self._begin: int | None = None  # of the member, in the file
        self._given = 0  # bytes of the member
        self._damage: DamagedError | None = None
        self._saved = b""  # what is sound before it

    def read(self, size: int) -> bytes:
        """At most ``size`` bytes, none at the end; raises DamagedError where the rest cannot be unpacked."""
        content = bytearray()
        while len(content) < size:
            if self._saved or self._damage:
                part, self._saved = self._saved[: size - len(content)], self._saved[size - len(content) :]
                content += part
                if content:
                    break
                raise self._damage or DamagedError
            if not self._packed:
                self._packed = self._raw.read(PACKED_BYTES)
            if not self._packed and self._inflater is None:
                break
            try:
                content += self._inflated(size - len(content))
            except DamagedError as error:
                self._damage = error
        return bytes(content)

    def _inflated(self, size: int) -> bytes:
        if self._inflater is None:
            if self._begin is not None and not self._packed.startswith(b"\x1f"):  # padding behind the last member
                self._packed = b""
                return b""
            self._inflater = _ZLIB.decompressobj(GZIP_BITS)
            self._begin, self._given = self._raw.tell() - len(self._packed), 0
        ended = not self._packed  # but content may still wait inside
        try:
            part: bytes = self._inflater.decompress(self._packed, size)
        except _ZLIB.error as error:
            self._saved = self._sound()
            raise DamagedError(str(error)) from error
        self._given += len(part)
        self._packed = self._inflater.unconsumed_tail
        if self._inflater.eof:
            self._packed, self._inflater = self._inflater.unused_data, None
        elif ended and not part:
            raise DamagedError("it ends early")
        return part

    def _sound(self) -> bytes:
        """What the member holds up to its damage and was not given out: it is unpacked once more, byte by byte at last.

        An inflater that meets a damage keeps what it had unpacked from the same piece to itself.
        """
        self._raw.seek(self._begin or 0)
        inflater, skipped, saved = zlib.decompressobj(GZIP_BITS), self._given, bytearray()
        while packed := self._raw.read(PACKED_BYTES):
            before = inflater.copy()
            try:
                part = inflater.decompress(packed)
            except zlib.error:
                part = _by_bytes(before, packed)
                packed = b""
            saved += part[skipped:]
            skipped -= min(skipped, len(part))
            if not packed or inflater.eof:
                break
        self._raw.seek(0, 2)
        return bytes(saved)


def _by_bytes(inflater: Any, packed: bytes) -> bytes:
    content = bytearray()
    try:
        for k in range(len(packed)):
            content += inflater.decompress(packed[k : k + 1])
    except zlib.error:
        pass
    return bytes(content)


def _standard_input() -> IO[bytes]:
    if sys.stdin is None:
        raise OSError("standard input is closed")
    return sys.stdin.buffer


def _spooled(stream: IO[bytes]) -> IO[bytes]:
    file = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the source)
    shutil.copyfileobj(stream, file, 1 << 20)
    return file
