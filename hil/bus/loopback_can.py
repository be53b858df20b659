"""The loopback as a python-can interface, for everybody's own tools.

``python -m can.logger -i brakebench -c NAME``, ``python -m can.viewer ...`` or a script's
``can.Bus(interface="brakebench", channel="NAME")`` joins the running bus ``loopback:NAME`` as one more member.
"""

import logging
from collections import deque
from typing import Any

import can

from dbc.frame import BusName, Frame
from hil.bus.bus import BusError
from hil.bus.loopback import LoopbackBus as Member
from hil.bus.rendezvous import base_directory
from hil.rt.clock import monotonic_ns, wall_time_ns

_log = logging.getLogger("can.brakebench")
_FOREVER_S = 3600.0


class LoopbackBus(can.BusABC):
    """python-can's view of a loopback channel: classical data frames, stamped with the time they were sent.

    Parameters
    ----------
    channel : the NAME of ``loopback:NAME``.
    kwargs : python-can's own options; a bit rate means nothing here.
    """

    def __init__(self, channel: Any, can_filters: Any = None, **kwargs: Any) -> None:
        try:
            self._member = Member(str(channel), BusName.VEHICLE)
        except BusError as error:
            raise can.CanInitializationError(str(error)) from error
        self.channel_info = f"brakebench {self._member.name}"
        self._channel = str(channel)
        self._queue: deque[Frame] = deque()
        self._epoch_ns = wall_time_ns() - monotonic_ns()  # fixed, so that stamps keep their distances
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._queue:
            for item in self._member.receive(_FOREVER_S if timeout is None else timeout):
                if isinstance(item, Frame):
                    self._queue.append(item)
                else:
                    _log.warning("%s: %s, %d frames, %s", self.channel_info, item.state, item.number, item.detail)
        if not self._queue:
            return None, False
        frame = self._queue.popleft()
        message = can.Message(
            timestamp=(frame.time_ns + self._epoch_ns) * 1e-9,
            arbitration_id=frame.can_id,
            is_extended_id=frame.extended,
            data=frame.data,
            channel=self._channel,
        )
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one classical data frame; it does not wait.

        Raises
        ------
        can.CanOperationError : a remote, error or CAN FD frame.
        """
        if msg.is_remote_frame or msg.is_error_frame or msg.is_fd:
            raise can.CanOperationError(f"{self.channel_info} carries classical data frames only, got {msg}")
        self._member.send([Frame(BusName.VEHICLE, msg.arbitration_id, bytes(msg.data), 0, msg.is_extended_id)])

    def shutdown(self) -> None:
        """Leave the bus."""
        super().shutdown()
        self._member.close()

    @staticmethod
    def _detect_available_configs() -> list[can.typechecking.AutoDetectedConfig]:
        """Name the channels that have members now."""
        base = base_directory()
        present = sorted({path.parent.name for path in base.glob("*/*.sock")})
        return [{"interface": "brakebench", "channel": name} for name in present]
