"""Where the members of a loopback channel find each other: a directory of listening sockets.

    ${XDG_RUNTIME_DIR, or the temporary directory}/brakebench-<uid>/<channel>/   0700
        lock                   held (flock) while somebody joins or leaves
        <pid>-<random>.sock    0600, one per member

Joining and leaving happen one at a time, so everybody meets everybody. Sockets of killed members refuse connections and
are removed by whoever comes next; the last to leave removes the directory.
"""

import contextlib
import errno
import fcntl
import os
import re
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from hil.bus.bus import BusError
from hil.errors import in_words
from hil.rt.clock import WallClock

_CHANNEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,47}")
_PATIENCE_NS = 5_000_000_000
_LEAVING_NS = 500_000_000  # a member that ends waits no longer; what it leaves behind goes with the next one
_BACKLOG = 1024


def base_directory() -> Path:
    """Return the directory of all this user's channels, which need not exist."""
    runtime = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir())
    return (runtime if runtime.is_dir() else Path(tempfile.gettempdir())) / f"brakebench-{os.getuid()}"


def live_channels() -> list[str]:
    """Name this user's channels that somebody listens on now; it changes nothing in them."""
    base = base_directory()
    return sorted({path.parent.name for path in base.glob("*/*.sock") if _listens(path)})


def _listens(path: Path) -> bool:
    """Somebody accepts connections on a member's socket; a member of any kind just sees one come and go."""
    kind = socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK
    with contextlib.suppress(OSError), _short_name(path.parent) as place, socket.socket(socket.AF_UNIX, kind) as probe:
        return probe.connect_ex(f"{place}/{path.name}") in (0, errno.EAGAIN)  # EAGAIN: its queue of joiners is full
    return False


@contextlib.contextmanager
def _short_name(directory: Path) -> Iterator[str]:
    """Give a directory a short name: a Unix socket's path may have 107 bytes only, see unix(7)."""
    file = os.open(directory, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{file}"
    finally:
        os.close(file)


class Rendezvous:
    """One member's way into and out of a channel.

    Parameters
    ----------
    channel : letters, digits, ``.``, ``_`` and ``-``, at most 48, the first a letter or digit.
    """

    def __init__(self, channel: str) -> None:
        if not _CHANNEL.fullmatch(channel):
            raise BusError(
                f"loopback channel {channel!r}: expected 1..48 of letters, digits, '.', '_', '-', not a path"
            )
        self._directory = base_directory() / channel
        self._path = self._directory / f"{os.getpid()}-{os.urandom(3).hex()}.sock"

    def join(self) -> tuple[socket.socket, list[socket.socket]]:
        """Bind this member's socket and connect to all present.

        Returns
        -------
        The listening socket and a connection to each member, all non-blocking.
        """
        with self._locked(_PATIENCE_NS), _short_name(self._directory) as place:
            present = self._present(place)
            listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
            try:
                os.fchmod(listener.fileno(), 0o600)  # before bind: never wider, whatever the umask
                listener.bind(f"{place}/{self._path.name}")
                listener.listen(_BACKLOG)
            except OSError as error:
                for one in (listener, *present):
                    one.close()
                raise BusError(f"cannot bind {self._path}: {in_words(error)}") from error
        return listener, present

    def leave(self, listener: socket.socket) -> None:
        """Close and remove this member's socket, and the directory after the last member."""
        listener.close()
        with contextlib.suppress(BusError), self._locked(_LEAVING_NS), _short_name(self._directory) as place:
            self._path.unlink(missing_ok=True)
            present = self._present(place)
            for connection in present:
                connection.close()
            if not present:
                (self._directory / "lock").unlink(missing_ok=True)
                with contextlib.suppress(OSError):
                    self._directory.rmdir()
                    self._directory.parent.rmdir()

    def _present(self, place: str) -> list[socket.socket]:
        """Connect to every living member; remove the sockets of dead ones."""
        present = []
        for path in sorted(self._directory.glob("*.sock")):
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
            try:
                connection.connect(f"{place}/{path.name}")
                present.append(connection)
            except OSError as error:
                connection.close()
                if isinstance(error, ConnectionRefusedError):
                    path.unlink(missing_ok=True)
        return present

    @contextlib.contextmanager
    def _locked(self, patience_ns: int) -> Iterator[None]:
        clock = WallClock()
        give_up_ns = clock.now_ns() + patience_ns
        while True:
            file = self._open_lock()
            if file is not None:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    if os.fstat(file).st_nlink:  # else the last member removed it while we waited
                        break
                except BlockingIOError:
                    pass
                os.close(file)
            if clock.now_ns() > give_up_ns:
                raise BusError(
                    f"{self._directory}: locked for {patience_ns * 1e-9:g} s by another member; "
                    "is one stopped while joining?"
                )
            clock.sleep_until(clock.now_ns() + 1_000_000)
        try:
            yield
        finally:
            os.close(file)

    def _open_lock(self) -> int | None:
        """Open the lock file, making the directories; None where the last member removed them meanwhile."""
        try:
            _make(self._directory.parent)
            _make(self._directory)
            return os.open(self._directory / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise BusError(f"cannot use {self._directory} for a loopback channel: {in_words(error)}") from error


def _make(directory: Path) -> None:
    """Make a directory that is ours alone, or see that the one there is."""
    with contextlib.suppress(FileExistsError):
        directory.mkdir(mode=0o700)
    found = directory.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise BusError(
            f"{directory}: expected a directory of user {os.getuid()} with mode 0700, "
            f"got {stat.filemode(found.st_mode)} of user {found.st_uid}; remove it"
        )
