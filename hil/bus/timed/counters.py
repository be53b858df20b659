"""Error counters of a controller and the states they put it into (ISO 11898-1:2015, 12.1.4; Bosch CAN 2.0, 8)."""

from dbc.frame import LinkState

WARNING, PASSIVE, BUS_OFF = 96, 128, 256  # counts from which a controller is in that state
_STEP_ERROR, _STEP_FIRST = 8, 8
_RECEIVE_FROM_PASSIVE = 127  # "a value between 119 and 127"
_MOST_RECEIVE = 255  # a counter of eight bits that never leaves PASSIVE upwards


class ErrorCounters:
    """Transmit and receive error counter (TEC, REC).

    Attributes
    ----------
    transmit, receive : the counts.
    """

    __slots__ = ("receive", "transmit")

    def __init__(self) -> None:
        self.transmit = 0
        self.receive = 0

    def sent(self) -> None:
        """Count a frame that was sent and acknowledged."""
        if self.transmit:
            self.transmit -= 1

    def received(self) -> None:
        """Count a frame that was received."""
        if self.receive >= PASSIVE:
            self.receive = _RECEIVE_FROM_PASSIVE
        elif self.receive:
            self.receive -= 1

    def transmit_error(self) -> None:
        """Count an error of a frame that the controller was sending."""
        self.transmit = min(BUS_OFF, self.transmit + _STEP_ERROR)

    def receive_error(self, first: bool = False) -> None:
        """Count an error of a frame that it was receiving; ``first``: it still saw a dominant bit behind its flag."""
        self.receive = min(_MOST_RECEIVE, self.receive + 1 + _STEP_FIRST * first)

    def reset(self) -> None:
        """Begin anew, after bus-off."""
        self.transmit = self.receive = 0

    @property
    def state(self) -> LinkState:
        """ERROR_ACTIVE, ERROR_WARNING, ERROR_PASSIVE or BUS_OFF."""
        if self.transmit >= BUS_OFF:
            return LinkState.BUS_OFF
        most = max(self.transmit, self.receive)
        if most >= PASSIVE:
            return LinkState.ERROR_PASSIVE
        return LinkState.ERROR_WARNING if most >= WARNING else LinkState.ERROR_ACTIVE
