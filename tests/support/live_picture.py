"""Takes docs/live.png: the live page of a bench that runs, pads of one wheel halved from the page.

``python tests/support/live_picture.py [FILE.png [WIDTHxHEIGHT [dark]]]`` in a clone with the extras ``live`` and
``figures`` and Debian's chromium.
"""

import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import chromium
from PIL import Image

ROOT = Path(__file__).parents[2]
SCENARIO = """title = "Long stop, braked by motors and pads"
blending = 0.3
[start]
speed_mps = 40.0
[driver]
pedal = [[0.5, 0.0], [1.0, 0.45]]
[end]
duration_s = 60.0
"""
_COLOURS = 128  # of the palette: text stays sharp at a third of the size


def take(path: Path, width: int, height: int, dark: bool) -> None:
    """Run a bench, command it from its page, and save what the page shows."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        (here / "stop.toml").write_text(SCENARIO)
        command = [sys.executable, "-m", "hil.cli.main", "run", "stop.toml", "--live", "--realtime", "--out", "out"]
        run = subprocess.Popen(command, cwd=here, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            words = here / "out" / "live.txt"
            while not (words.exists() and words.read_text()):
                assert run.poll() is None, "the bench did not start"
                time.sleep(0.1)
            with chromium.opened(words.read_text().strip(), here) as page:
                page.wait("typeof store !== 'undefined' && store.now > 5")
                page.run("byId('fault-pad_friction').nextElementSibling.value = 'fr'")
                page.run("byId('fault-pad_friction').click()")
                page.run("byId('window').value = '20'")
                start = page.run("store.now")
                page.wait(f"store.now > {start} + 8")
                page.picture(path, width, height, dark)
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()
    with Image.open(path) as image:
        image.convert("RGB").crop((0, 0, width, height)).quantize(_COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    size = words[1] if len(words) > 1 else "1400x1450"
    across, down = (int(text) for text in size.split("x"))
    take(Path(words[0]) if words else ROOT / "docs" / "live.png", across, down, "dark" in words[2:])
