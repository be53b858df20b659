"""The bytes of a message, taken from the front."""

from hil.errors import BrakebenchError, Verdict


class CutShortError(BrakebenchError):
    """A message has fewer bytes than its service needs."""

    exit_code = Verdict.BROKEN.exit_code

    def __init__(self) -> None:
        super().__init__("the answer is cut short: it has fewer bytes than its service needs")


class Payload:
    """What is left of a message.

    Raises
    ------
    CutShortError : where fewer bytes are left than are taken.
    """

    def __init__(self, data: bytes) -> None:
        self.left = data

    def take(self, n: int) -> bytes:
        """Take ``n`` bytes."""
        if len(self.left) < n:
            raise CutShortError
        taken, self.left = self.left[:n], self.left[n:]
        return taken

    def number(self, n: int = 1) -> int:
        """Take a number of ``n`` bytes, big endian."""
        return int.from_bytes(self.take(n), "big")

    def rest(self) -> bytes:
        """Take all."""
        return self.take(len(self.left))
