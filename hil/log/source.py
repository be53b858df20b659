"""Where the bytes of a log come from: a file, a gzip file, standard input."""

import gzip
import shutil
import sys
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, tzinfo
from pathlib import Path
from typing import IO, Any, Self

from hil.log.account import Account
from hil.log.frames import LogError

HEAD_BYTES = 65_536  # enough to tell the format
STDIN = "-"
_GZIP = b"\x1f\x8b"


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
    path : a file, which may be packed with gzip; ``-`` is standard input, which is kept in a temporary file.
    limit_bytes : most bytes that are read (unpacked); what lies behind counts as cut off. None reads all.

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
            self._raw: IO[bytes] = _spooled(sys.stdin.buffer) if str(path) == STDIN else self.path.open("rb")
            self.size = self._raw.seek(0, 2)
            self._raw.seek(0)
            self.packed = self._raw.read(2) == _GZIP
        except OSError as error:
            raise LogError(path, f"cannot be opened: {error.strerror or error}; give a log file") from error
        self._stream: IO[bytes] = self._raw
        self._position = 0
        self.rewind(self.account)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        for file in (self._stream, self._raw, self._kept):
            if file is not None:
                file.close()

    def rewind(self, account: Account) -> None:
        """Begin anew; a log that ends inside its gzip stream is noted in ``account`` as cut off."""
        self.account = account
        self._position = 0
        self._raw.seek(0)
        self._stream = _unpacked(self._raw) if self.packed else self._raw

    def read(self, size: int) -> bytes:
        """At most ``size`` bytes; fewer at the end of what can be read, none behind it."""
        if self.limit_bytes is not None:
            left = self.limit_bytes - self._position
            if size > left:
                self.account.note(f"only the first {self.limit_bytes} bytes are read")
                self.account.cut_at(self.limit_bytes)
                size = left
        try:
            content = self._stream.read(size)
        except EOFError:
            content = b""
            self.account.cut_at(self._position)
        except (OSError, zlib.error) as error:
            if not self.packed:
                raise LogError(self.path, f"cannot be read: {error}", self._position) from error
            content = b""
            self.account.note(f"damaged gzip file: {error}")
            self.account.cut_at(self._position)
        self._position += len(content)
        return content

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
            self._kept = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the source)
            while part := self.read(1 << 20):
                self._kept.write(part)
        self._kept.seek(0)
        return self._kept


def _spooled(stream: IO[bytes]) -> IO[bytes]:
    file = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the source)
    shutil.copyfileobj(stream, file, 1 << 20)
    return file


def _unpacked(raw: IO[bytes]) -> IO[bytes]:
    try:
        from isal import igzip
    except ImportError:
        return gzip.GzipFile(fileobj=raw, mode="rb")  # type: ignore[return-value]
    opener: Callable[..., Any] = igzip.IGzipFile  # three times as fast
    return opener(fileobj=raw, mode="rb")  # type: ignore[no-any-return]
