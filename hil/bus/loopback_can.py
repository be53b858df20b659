"""The loopback as a python-can interface, for everybody's own tools.

``python -m can.logger -i brakebench -c NAME``, ``python -m can.viewer ...`` or a script's
``can.Bus(interface="brakebench", channel="NAME")`` joins the running bus ``loopback:NAME`` as one more member.
"""

import logging
import os
import select
import threading
import weakref
from collections import deque
from typing import Any

import can

from dbc.frame import BusName, Frame
from hil.bus.bus import BusError
from hil.bus.loopback import LoopbackBus as Member
from hil.bus.rendezvous import live_channels
from hil.rt.clock import clocks_ns, monotonic_ns

_log = logging.getLogger("can.brakebench")
_MOST_OWN = 1 << 16  # own frames that wait to be received; beyond it they are lost, as others' are beyond their queue


class LoopbackBus(can.BusABC):
    """python-can's view of a loopback channel: classical data frames, stamped with the time they were sent.

    One thread may receive while others send or shut the bus down.

    Parameters
    ----------
    channel : the NAME of ``loopback:NAME``.
    receive_own_messages : what this bus sends is received too, in its place among the others', with ``is_rx`` False.
    fd, timing : CAN FD is refused; a bit rate means nothing here.
    kwargs : python-can's other options.

    Raises
    ------
    can.CanInitializationError : a bad channel name, no usable directory, or CAN FD asked for.
    """

    def __init__(
        self,
        channel: Any,
        can_filters: Any = None,
        receive_own_messages: bool = False,
        fd: bool = False,
        timing: can.BitTiming | can.BitTimingFd | None = None,
        **kwargs: Any,
    ) -> None:
        if fd or isinstance(timing, can.BitTimingFd):
            raise can.CanInitializationError(
                f"brakebench {channel}: got fd=True, but a loopback carries classical frames of up to 8 bytes only; "
                "open it without fd"
            )
        try:
            self._member = Member(str(channel), BusName.VEHICLE)
        except BusError as error:
            raise can.CanInitializationError(str(error)) from error
        self.channel_info = f"brakebench {self._member.name}"
        self._channel = str(channel)
        self._own = bool(receive_own_messages)
        self._queue: deque[tuple[Frame, bool]] = deque()  # to be received: frame, and whether it came from another
        self._own_sent: list[Frame] = []
        self._own_lost = 0
        self._lock = threading.RLock()  # held while the member or what stands above is used, never while waiting
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)  # own frames, or the end
        # closed with the object, not at shutdown: another thread may be waiting on it
        self._close_wake = weakref.finalize(self, os.close, self._wake)
        self._waiting = select.poll()
        self._waiting.register(self._member.fileno(), select.POLLIN)
        self._waiting.register(self._wake, select.POLLIN)
        _, self._epoch_ns = clocks_ns()  # fixed, so that stamps keep their distances
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline_ns = None if timeout is None else monotonic_ns() + int(timeout * 1e9)
        while True:
            with self._lock:
                self._check_open()
                if not self._queue:
                    self._collect()
                if self._queue:
                    return self._message(*self._queue.popleft()), False
            if deadline_ns is None:
                self._waiting.poll()
                continue
            left_ns = deadline_ns - monotonic_ns()
            if left_ns <= 0:
                return None, False
            self._waiting.poll(left_ns * 1e-6)

    def _collect(self) -> None:
        """Queue what the others sent and what this bus did, by time of sending."""
        arrived: list[tuple[Frame, bool]] = []
        for item in self._member.receive():
            if isinstance(item, Frame):
                arrived.append((item, True))
            else:
                _log.warning("%s: %s, %d frames, %s", self.channel_info, item.state, item.number, item.detail)
        if self._own_sent:
            os.eventfd_read(self._wake)
            arrived += [(frame, False) for frame in self._own_sent]
            self._own_sent.clear()
            if self._own_lost:
                _log.warning("%s: %d own frames lost, nobody received them", self.channel_info, self._own_lost)
                self._own_lost = 0
            arrived.sort(key=lambda one: one[0].time_ns)
        self._queue += arrived

    def _message(self, frame: Frame, is_rx: bool) -> can.Message:
        return can.Message(
            timestamp=(frame.time_ns + self._epoch_ns) * 1e-9,
            arbitration_id=frame.can_id,
            is_extended_id=frame.extended,
            data=frame.data,
            channel=self._channel,
            is_rx=is_rx,
        )

    def _check_open(self) -> None:
        if self._is_shutdown:
            raise can.CanOperationError(f"{self.channel_info} is shut down; open it anew")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one classical data frame; it does not wait.

        Raises
        ------
        can.CanOperationError : a remote, error or CAN FD frame, a bad identifier or length, or a bus that is shut down.
        """
        if msg.is_remote_frame or msg.is_error_frame or msg.is_fd:
            raise can.CanOperationError(f"{self.channel_info} carries classical data frames only, got {msg}")
        with self._lock:
            self._check_open()
            # its own stamp lies before the member's, so that no answer to a frame is received before the frame
            frame = Frame(
                BusName.VEHICLE, msg.arbitration_id, bytes(msg.data), monotonic_ns(), bool(msg.is_extended_id)
            )
            try:
                self._member.send([frame])
            except ValueError as error:
                raise can.CanOperationError(f"{self.channel_info}: {error}") from error
            if self._own and len(self._own_sent) < _MOST_OWN:
                self._own_sent.append(frame)
                os.eventfd_write(self._wake, 1)
            elif self._own:
                self._own_lost += 1

    def shutdown(self) -> None:
        """Leave the bus; a receiver that waits ends with `can.CanOperationError`. Twice is harmless."""
        super().shutdown()
        with self._lock:
            self._member.close()
        if self._close_wake.alive:  # not so where the interpreter ends or collects the bus
            os.eventfd_write(self._wake, 1)

    @staticmethod
    def _detect_available_configs() -> list[can.typechecking.AutoDetectedConfig]:
        """Name the channels that have living members now."""
        return [{"interface": "brakebench", "channel": name} for name in live_channels()]
