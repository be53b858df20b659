"""What waits for one page: bounded, the newest wins, and who puts something in never waits."""

from collections import deque
from threading import Condition

MOST_WAITING = 100
"""Messages that wait for a page, some 3 s of them; a page that is slower misses the oldest."""


class Mailbox:
    """A bounded queue between the bench's thread and that of one page.

    Attributes
    ----------
    dropped : messages that the page will never get.
    """

    def __init__(self, most: int = MOST_WAITING) -> None:
        self.dropped = 0
        self._waiting: deque[str] = deque(maxlen=most)
        self._changed = Condition()
        self._closed = False

    def put(self, text: str) -> None:
        """Add a message; drops the oldest one where there is no room."""
        with self._changed:
            self.dropped += len(self._waiting) == self._waiting.maxlen
            self._waiting.append(text)
            self._changed.notify()

    def take(self) -> str | None:
        """Wait for the oldest message; None once the mailbox is closed and empty."""
        with self._changed:
            while not self._waiting and not self._closed:
                self._changed.wait()
            return self._waiting.popleft() if self._waiting else None

    def close(self) -> None:
        """Let nobody wait any longer; what is in it can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
