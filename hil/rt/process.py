"""The one place that starts and stops processes."""

import contextlib
import ctypes
import multiprocessing
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path

from hil.rt.clock import WallClock

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
STOP_TIMEOUT_NS = 3_000_000_000
_READY, _GO = b"r", b"g"


def end_with_parent() -> None:
    """Ask the kernel to end this process (SIGTERM) when its parent dies, however the parent dies."""
    parent = os.getppid()
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != parent:  # it died before we asked
        os.kill(os.getpid(), signal.SIGTERM)


def kill_self() -> None:
    """End this process at once (SIGKILL), as a crash of the machine's would."""
    os.kill(os.getpid(), signal.SIGKILL)


def stop_self(for_s: float) -> None:
    """Stop this process (SIGSTOP) for a time; 0 for good, until somebody continues it.

    A stopped process cannot wake itself: a shell of its own does (SIGCONT), which counts from when it is told to.
    """
    waker = None
    if for_s > 0.0:
        words = ["sh", "-c", f"read go && sleep {for_s:.6f}; kill -CONT {os.getpid()}"]
        waker = subprocess.Popen(words, stdin=subprocess.PIPE, start_new_session=True)
        assert waker.stdin is not None
        waker.stdin.write(b"go\n")
        waker.stdin.close()
    os.kill(os.getpid(), signal.SIGSTOP)
    if waker is not None:
        waker.wait()


def output_of(command: Sequence[str], timeout_s: float) -> str | None:
    """Return the standard output of a command; None where there is none such, it fails, or does not end in time."""
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=timeout_s, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.decode(errors="replace") if done.returncode == 0 else None


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Let a Ctrl-C that falls into the block act at its end, so that nothing is left half done.

    Changes nothing outside of the main thread, where no signal is handled.
    """
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


class StopSignal:
    """Turns SIGTERM and SIGINT into a flag, so that a loop ends between two ticks.

    Attributes
    ----------
    asked : whether a signal has come.
    interrupted : whether it was SIGINT (Ctrl-C).
    """

    def __init__(self) -> None:
        self.asked = False
        self.interrupted = False
        self._at_once = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._take)

    def _take(self, number: int, _frame: object) -> None:
        self.asked = True
        self.interrupted = self.interrupted or number == signal.SIGINT
        if self._at_once:
            raise SystemExit(0)

    @contextlib.contextmanager
    def at_once(self) -> Iterator[None]:
        """Let a signal end the process by `SystemExit` meanwhile: where it waits for what may never come."""
        self._at_once = True
        try:
            if self.asked:
                raise SystemExit(0)
            yield
        finally:
            self._at_once = False


class Child:
    """A brakebench command as a process of its own.

    It runs in its own session (a Ctrl-C reaches only us), ends when we end, says ready and waits for its release.

    Parameters
    ----------
    name : what people call it.
    arguments : command line behind ``brakebench``.
    error_path : file that takes what it prints.
    output : file descriptor that takes its standard output instead.
    """

    def __init__(self, name: str, arguments: Sequence[str], error_path: Path, output: int | None = None) -> None:
        self.name = name
        self.error_path = error_path
        self._ready, child_end = socket.socketpair()
        command = [sys.executable, "-m", "hil.cli.main", *arguments, "--ready-fd", str(child_end.fileno())]
        try:
            with error_path.open("wb") as words:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=words if output is None else output,
                    stderr=words,
                    pass_fds=(child_end.fileno(),),
                    start_new_session=True,
                )
        finally:
            child_end.close()
        self._terminated = False
        self._used: list[tuple[int, float]] = []  # time, ns, and processor time, s, at its release and its end

    @property
    def share_of_core(self) -> float | None:
        """Processor time over time between its release and when it was asked to stop; None where that is not known."""
        if len(self._used) < 2:
            return None
        (begin_ns, before_s), (end_ns, after_s) = self._used
        return (after_s - before_s) / max((end_ns - begin_ns) * 1e-9, 1e-9)

    def _note_use(self) -> None:
        with contextlib.suppress(OSError, IndexError):  # gone, or a system without /proc
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # utime, stime: proc(5)
            self._used.append((WallClock().now_ns(), seconds))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def ended(self) -> bool:
        """Whether the process is gone."""
        return self._process.poll() is not None

    @property
    def failed(self) -> bool:
        """Whether the process is gone with anything but success."""
        return self._process.poll() not in (None, 0)

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait until the process says ready; False when it ends before or does not within ``timeout_s``."""
        readable, _, _ = select.select([self._ready], [], [], timeout_s)
        return bool(readable) and self._ready.recv(1) == _READY

    def release(self) -> None:
        """Let a process that said ready begin."""
        self._note_use()
        with contextlib.suppress(BrokenPipeError):
            self._ready.send(_GO)

    def why(self) -> str:
        """How the process ended, with its last words."""
        code = self._process.poll()
        if code is None:
            how = "still runs"
        elif code < 0:
            how = f"was killed by {signal.Signals(-code).name}"
        else:
            how = f"ended with exit code {code}"
        words = self.error_path.read_text(errors="replace").strip().splitlines()
        return f"{self.name} (process {self.pid}) {how}" + (f": {words[-1]}" if words else "")

    def last_words(self) -> str:
        """Return the last line of what it printed, without the name of the program; may be empty."""
        words = self.error_path.read_text(errors="replace").strip().splitlines()
        return words[-1].removeprefix("brakebench: ") if words else ""

    def ask_to_stop(self) -> None:
        """Send SIGTERM, once: a process that is shutting down would die of a second one."""
        if not self.ended and not self._terminated:
            if len(self._used) == 1:
                self._note_use()
            self._terminated = True
            self._process.terminate()

    def stop(self) -> None:
        """Make sure that it is gone: SIGTERM, and SIGKILL after a while."""
        self.ask_to_stop()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(STOP_TIMEOUT_NS * 1e-9)
        if not self.ended:
            self._process.kill()
            self._process.wait()
        self._ready.close()


class Piped:
    """A command whose standard output is read while it runs; it hears nothing and says nothing else.

    It ends with us, and at the latest with `close`.

    Parameters
    ----------
    command : program and arguments.
    environment : variables beside our own.
    handed : file descriptors that it may use.
    """

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str] | None = None, handed: Sequence[int] = ()
    ) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **(environment or {})},
            pass_fds=tuple(handed),
            start_new_session=True,
        )
        self._output = self._process.stdout.fileno() if self._process.stdout else -1

    def read(self, size: int, timeout_s: float) -> bytes | None:
        """Up to ``size`` bytes, none at the end; None where nothing came in ``timeout_s``."""
        readable, _, _ = select.select([self._output], [], [], max(timeout_s, 0))
        return os.read(self._output, size) if readable else None

    def close(self) -> int:
        """Kill it where it still runs; the exit code, negative for the signal that ended it."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(0.05)
        self._process.kill()  # nothing happens where it has ended
        code = self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        return code


def say_ready(ready_fd: int | None) -> None:
    """Tell the parent at the other end of ``ready_fd`` (None: there is none), and wait until it lets us begin."""
    if ready_fd is not None:
        with socket.socket(fileno=ready_fd) as parent:
            parent.send(_READY)
            parent.recv(1)


def wait_for_end(children: Sequence[Child], timeout_ns: int = STOP_TIMEOUT_NS) -> None:
    """Give all children the same time to end after they were asked to."""
    clock = WallClock()
    deadline_ns = clock.now_ns() + timeout_ns
    while clock.now_ns() < deadline_ns and not all(child.ended for child in children):
        clock.sleep_until(clock.now_ns() + 5_000_000)


def worker_pool(workers: int) -> ProcessPoolExecutor:
    """Processes that share independent work; each starts afresh and ends when we do."""
    return ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=end_with_parent)


def abandon(pool: Executor) -> None:
    """End the processes of a `worker_pool` at once, whatever they do; what they did is lost."""
    pool.shutdown(wait=False, cancel_futures=True)
    for child in multiprocessing.active_children():
        child.terminate()
