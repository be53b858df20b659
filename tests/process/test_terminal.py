"""The view on a real terminal (a pty) beside a bench of real processes."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios

import pytest
from processes import wait_until

pytest.importorskip("rich", reason="the extra live is not installed")
pytestmark = pytest.mark.slow

ENTER, LEAVE, SHOW, HOME = b"\x1b[?1049h", b"\x1b[?1049l", b"\x1b[?25h", b"\x1b[H"


class Terminal:
    """A command on a terminal of its own."""

    def __init__(self, rows, columns, *words, **environment):
        self.seen = b""
        self._fd, inside = pty.openpty()
        fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        kept = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES", "NO_COLOR", "TERM")}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli.main", *words], stdin=inside, stdout=inside, stderr=inside,
            env={**kept, "TERM": "xterm", **environment}, start_new_session=True, preexec_fn=self._controls,
        )  # fmt: skip
        os.close(inside)

    @staticmethod
    def _controls():
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # so that a ^C that is typed is an interrupt

    def read(self):
        while select.select([self._fd], [], [], 0.05)[0]:
            try:
                data = os.read(self._fd, 65536)
            except OSError:  # the other end is closed
                return self.seen
            if not data:
                break
            self.seen += data
        return self.seen

    def screen(self):
        """Text of the last whole screen."""
        frames = self.read().split(LEAVE)[0].split(HOME)
        return re.sub(rb"\x1b\[[0-9;?]*[a-zA-Z]", b"", frames[-2] if len(frames) > 2 else b"").decode()

    def interrupt(self):
        os.write(self._fd, b"\x03")

    def end(self):
        def ended():
            self.read()
            return self.process.poll() is not None

        wait_until(ended, "the view's end")
        self.read()
        os.close(self._fd)
        return self.process.returncode


def lines_of(screen):
    return screen.replace("\r", "").split("\n")


@pytest.fixture
def bench(start, channel):
    return start("run", "downhill", "--bus", channel, "--out", "out")


@pytest.mark.parametrize(("rows", "columns", "more"), [(24, 80, {}), (24, 60, {"LC_ALL": "C", "NO_COLOR": "1"})])
def test_a_run_is_seen_on_a_terminal_and_ctrl_c_leaves_it_clean(bench, channel, rows, columns, more):
    view = Terminal(rows, columns, "watch", "--terminal", "--bus", channel, **more)
    wait_until(lambda: "manoeuvre running" in view.screen() and "BRAKE_PEDAL" in view.screen(), "the run's view")
    wait_until(lambda: re.search(r"fl +-?\d+\.\d +0\.\d{3} +\d+ +\d", view.screen()), "the wheels' values")
    lines = lines_of(view.screen())
    assert len(lines) <= rows
    assert max(map(len, lines)) <= columns
    view.interrupt()
    assert view.end() == 0
    assert view.seen.count(ENTER) == view.seen.count(LEAVE) == 1
    after = view.seen.split(LEAVE)[1]
    assert SHOW in view.seen.split(ENTER)[1]
    assert b"load" in after  # the last view stays
    coloured = re.findall(rb"\x1b\[(?:\d+;)*[349]\d", view.seen)
    assert bool(coloured) != bool(more), coloured[:3]
    bench.send_signal(signal.SIGINT)


def test_a_run_shows_itself_and_its_words_follow(channel, tmp_path):
    out = tmp_path / "out"
    view = Terminal(24, 80, "run", "stop72", "--terminal", "--bus", channel, "--out", str(out))
    wait_until(
        lambda: "manoeuvre running" in view.screen(),
        "the run's view",
    )
    assert view.end() in (0, 4)
    before, _, after = view.seen.partition(LEAVE)
    assert b"driving:" not in before
    assert b"driving:" in after
    assert (out / "report.html").exists()


def test_where_the_output_is_no_terminal_it_is_plain_text(bench, start, channel):
    view = start("watch", "--terminal", "--bus", channel)
    text = ""

    def enough():
        nonlocal text
        text += os.read(view.stdout.fileno(), 65536).decode()
        return text.count("manoeuvre running") >= 2

    wait_until(enough, "two views")
    assert "\x1b" not in text
    assert "\r" not in text
    view.send_signal(signal.SIGTERM)
    assert view.wait(10) == 0
    bench.send_signal(signal.SIGINT)
