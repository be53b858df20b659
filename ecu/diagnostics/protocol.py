"""Words of UDS (ISO 14229-1) that the server uses, and its times."""

from enum import IntEnum

# ISO 14229-2: an answer begins within it; choice: it ends within it, or 0x78 comes first (udsoncan waits for the end)
P2_NS = 50_000_000
P2_STAR_NS = 10_000_000_000  # choice: the longest answer at the longest STmin of 127 ms, see MOST_ANSWER
S3_NS = 5_000_000_000  # ISO 14229-2: S3 server, a session other than the default one ends without requests
LATENESS_NS = 10_000_000  # choice: of P2, for the tick of a busy machine
MOST_REQUEST = MOST_ANSWER = 512  # bytes; 73 consecutive frames of 130 ms (127 ms in ticks of 10 ms): 9.5 s
MOST_PERIODIC = 8  # choice: periodic identifiers at once, 2 ms of a bus of 500 kbit/s
BURST = MOST_PERIODIC + 1  # diagnostic frames a tick at most: one is left for answers; adapters queue 10
NEGATIVE = 0x7F
POSITIVE = 0x40
SUPPRESS = 0x80


class Session(IntEnum):
    """Diagnostic sessions."""

    DEFAULT = 1
    EXTENDED = 3


class Nrc(IntEnum):
    """Negative response codes."""

    SERVICE_NOT_SUPPORTED = 0x11
    SUB_FUNCTION_NOT_SUPPORTED = 0x12
    INCORRECT_LENGTH = 0x13
    RESPONSE_TOO_LONG = 0x14
    CONDITIONS_NOT_CORRECT = 0x22
    REQUEST_SEQUENCE_ERROR = 0x24
    REQUEST_OUT_OF_RANGE = 0x31
    SECURITY_ACCESS_DENIED = 0x33
    INVALID_KEY = 0x35
    EXCEEDED_NUMBER_OF_ATTEMPTS = 0x36
    REQUIRED_TIME_DELAY_NOT_EXPIRED = 0x37
    RESPONSE_PENDING = 0x78
    SUB_FUNCTION_NOT_SUPPORTED_IN_SESSION = 0x7E
    SERVICE_NOT_SUPPORTED_IN_SESSION = 0x7F


SILENT_WHEN_FUNCTIONAL = frozenset(
    {
        Nrc.SERVICE_NOT_SUPPORTED, Nrc.SUB_FUNCTION_NOT_SUPPORTED, Nrc.REQUEST_OUT_OF_RANGE,
        Nrc.SUB_FUNCTION_NOT_SUPPORTED_IN_SESSION, Nrc.SERVICE_NOT_SUPPORTED_IN_SESSION,
    }
)  # fmt: skip
"""What is not said to a request to everybody: another controller may be meant."""


class Refused(Exception):  # noqa: N818  # an answer, no error
    """A negative response."""

    def __init__(self, nrc: Nrc) -> None:
        super().__init__(nrc.name)
        self.nrc = nrc


def expect_length(request: bytes, length: int) -> None:
    """Refuse a request that is not ``length`` bytes long."""
    if len(request) != length:
        raise Refused(Nrc.INCORRECT_LENGTH)
