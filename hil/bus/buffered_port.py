"""A serial port read in pieces: python-can's slcan reads single bytes, a system call or two and the GIL for each."""

from typing import Any

_OWN = ("_port", "_buffer", "_at")


class BufferedPort:
    """pyserial's port with a buffer in front of its ``read``; everything else is the port's.

    Without it, slcan falls behind a bus of a thousand frames a second on a busy machine, and hears them ever later.
    """

    def __init__(self, port: Any) -> None:
        self._port = port
        self._buffer = b""
        self._at = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _OWN:
            object.__setattr__(self, name, value)
        else:  # a time-out, such as slcan sets for writing
            setattr(self._port, name, value)

    @property
    def buffered(self) -> int:
        """Bytes that are here, and no longer at the port."""
        return len(self._buffer) - self._at

    @property
    def in_waiting(self) -> int:
        """Bytes to be read."""
        return self.buffered or int(self._port.in_waiting)

    def read(self, size: int = 1) -> bytes:
        """Read up to ``size`` bytes: what is here, else what the port has."""
        if not self.buffered:
            self._buffer, self._at = self._port.read(max(size, self._port.in_waiting)), 0
        found = self._buffer[self._at : self._at + size]
        self._at += len(found)
        return bytes(found)

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._buffer, self._at = b"", 0
        self._port.reset_input_buffer()
