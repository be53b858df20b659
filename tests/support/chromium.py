"""A page in headless Chromium, driven over its debugging port (Chrome DevTools Protocol)."""

import base64
import contextlib
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from websockets.sync.client import ClientConnection, connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
    "--remote-debugging-port=0", "--enable-precise-memory-info",
)  # fmt: skip
_PATIENCE_S = 60.0


class Page:
    """One tab."""

    def __init__(self, connection: ClientConnection, pid: int) -> None:
        self._connection = connection
        self._number = 0
        self.pid = pid
        self.complaints: list[str] = []
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol; errors of the page meanwhile are collected in ``complaints``."""
        self._number += 1
        self._connection.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._connection.recv(timeout=_PATIENCE_S))
            if message.get("id") == self._number:
                assert "error" not in message, message
                return message["result"]
            if message.get("method") == "Runtime.exceptionThrown":
                self.complaints.append(message["params"]["exceptionDetails"]["exception"].get("description", "thrown"))
            if message.get("method") == "Log.entryAdded" and message["params"]["entry"]["level"] == "error":
                self.complaints.append(message["params"]["entry"]["text"])

    def run(self, script: str) -> Any:
        """Value of an expression in the page; may be a promise."""
        got = self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in got, got["exceptionDetails"]
        return got["result"].get("value")

    def wait(self, condition: str) -> Any:
        """Wait until an expression in the page is true, and return it."""
        deadline = time.monotonic() + _PATIENCE_S
        while not (value := self.run(condition)):
            assert time.monotonic() < deadline, f"{condition}: not true in time; {self.complaints[:3]}"
            time.sleep(0.05)
        return value

    def picture(self, path: Path, width: int, height: int, dark: bool = False) -> None:
        """Save a picture of the page in a window of this size."""
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.ask("Emulation.setEmulatedMedia", features=scheme)
        self.size(width, height)
        time.sleep(0.5)
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", captureBeyondViewport=True)["data"]))

    def size(self, width: int, height: int) -> None:
        """Give the window a size."""
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )

    def press(self, key: str, code: int = 0) -> None:
        """Press and release a key."""
        text = {"Enter": "\r", " ": " "}.get(key, "")
        more = {"text": text} if text else {}
        self.ask("Input.dispatchKeyEvent", type="keyDown", key=key, windowsVirtualKeyCode=code, **more)
        self.ask("Input.dispatchKeyEvent", type="keyUp", key=key, windowsVirtualKeyCode=code)


@contextlib.contextmanager
def opened(url: str, folder: Path) -> Iterator[Page]:
    """Open an address in a browser of its own."""
    assert CHROMIUM is not None
    profile = folder / "profile"
    # drawing without a graphics card must not take the processor from the bench
    command = [
        "nice",
        "-n",
        "10",
        CHROMIUM,
        *_FLAGS,
        f"--user-data-dir={profile}",
        "--window-size=1400,1000",
        "about:blank",
    ]
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        said = profile / "DevToolsActivePort"
        deadline = time.monotonic() + _PATIENCE_S
        while not (said.exists() and said.read_text().count("\n")):
            assert browser.poll() is None, "Chromium ended at once"
            assert time.monotonic() < deadline, "Chromium did not start"
            time.sleep(0.05)
        port = said.read_text().splitlines()[0]
        with urlopen(f"http://127.0.0.1:{port}/json") as answer:
            target = next(one for one in json.load(answer) if one["type"] == "page")
        with connect(target["webSocketDebuggerUrl"], max_size=None, compression=None) as connection:
            page = Page(connection, browser.pid)
            page.ask("Page.navigate", url=url)
            yield page
    finally:
        browser.kill()
        browser.wait()
