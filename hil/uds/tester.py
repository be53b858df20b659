"""A tester: udsoncan's client on one of our buses; every request and answer in words."""

import logging
from collections.abc import Callable
from typing import Any, NamedTuple, cast

from udsoncan.client import Client
from udsoncan.configs import default_client_config
from udsoncan.exceptions import (
    InvalidResponseException,
    NegativeResponseException,
    TimeoutException,
    UnexpectedResponseException,
)
from udsoncan.Request import Request

from hil.errors import BrakebenchError, Verdict
from hil.rt.clock import monotonic_ns
from hil.uds.dtc import ALL_CODES
from hil.uds.known import FOREIGN, Names
from hil.uds.names import (
    NEGATIVE_RESPONSE,
    READ_DATA,
    READ_PERIODICALLY,
    REPEATED,
    RESPONSE_OFFSET,
    STOP_SENDING,
    SUPPRESS_BIT,
    WITH_SUBFUNCTION,
)
from hil.uds.transport import IsoTpConnection
from hil.uds.words import Said, describe, refusal_text, service_text

ANSWER_WITHIN_S = 1.0
"""P2 of the tester where none is given: the 50 ms of ISO 14229-2 and what a gateway or a busy machine adds."""
PENDING_WITHIN_S = 10.0  # P2* of the tester: twice the 5 s of ISO 14229-2
PRESENT_EVERY_S = 2.0
"""Between two requests that keep a session alive: S3 of the client in ISO 14229-2, well before the ECU's 5 s."""
EXTENDED_SESSION = 3
ALL_WITHIN_S = 120.0  # of a request that the ECU holds up with response pending


class RefusedError(BrakebenchError):
    """The ECU answers negatively.

    Attributes
    ----------
    code : of ISO 14229-1.
    """

    exit_code = Verdict.FAILED.exit_code

    def __init__(self, service: int, code: int) -> None:
        super().__init__(f"{service_text(service)} refused: {refusal_text(code)}{_ADVICE.get(code, '')}")
        self.code = code


_ADVICE = {
    0x7E: "; give --session extended",
    0x7F: "; give --session extended",
    0x33: "; give --unlock",
}


class NoAnswerError(BrakebenchError):
    """Nothing came back, or something that is no answer to what was asked."""

    exit_code = Verdict.BROKEN.exit_code


class Exchange(NamedTuple):
    """A request, its answer (empty where none was wanted or came), and the time between, ns."""

    request: bytes
    answer: bytes
    time_ns: int


class FoundDtc(NamedTuple):
    """A trouble code and its status byte."""

    number: int
    status: int


class Tester:
    """Asks one ECU.

    Parameters
    ----------
    connection : to it.
    known : what is known of it by name.
    answer_within_s : how long an answer may take to begin.
    tell : told of every exchange as it has happened.

    Raises
    ------
    RefusedError, NoAnswerError : of every method that asks.
    """

    def __init__(
        self,
        connection: IsoTpConnection,
        known: Names = FOREIGN,
        answer_within_s: float = ANSWER_WITHIN_S,
        tell: Callable[[Exchange], None] = lambda _: None,
    ) -> None:
        self.known = known
        self._connection, self._tell = connection, tell
        for name in ("UdsClient", connection.name):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # all of it comes as an error of ours
        config = {
            **default_client_config,
            "p2_timeout": answer_within_s,
            "p2_star_timeout": max(PENDING_WITHIN_S, answer_within_s),
            "request_timeout": max(ALL_WITHIN_S, answer_within_s),
            "use_server_timing": False,  # what the ECU states leaves nothing for the way
        }
        self._client = Client(connection.open(), config=cast(Any, config))

    def ask(self, payload: bytes) -> bytes:
        """Send a request of a service of the standard, return its positive answer; empty where it wants none."""
        request = Request.from_payload(payload)
        with_sub = payload[:1] and payload[0] in WITH_SUBFUNCTION
        if request.service is None or len(payload) < 1 + bool(with_sub):
            raise BrakebenchError(
                f"{payload.hex(' ').upper()}: no whole request of ISO 14229; its service stands first, such as 3E 00"
            )
        if not with_sub:  # udsoncan takes the second byte of services it does not know more of for one
            request.suppress_positive_response = False
            request.subfunction = 0

        def send() -> Any:
            try:
                with self._client.payload_override(payload):  # as it is, byte by byte
                    return self._client.send_request(request)
            except InvalidResponseException as error:
                # the same services' answers of one byte it takes for cut short
                if not with_sub and error.response.original_payload == bytes((payload[0] + RESPONSE_OFFSET,)):
                    return error.response
                raise

        answer = self._asked(payload, send)
        if answer is None:
            return b""
        got = bytes(answer.original_payload)
        # of several identifiers the ECU may leave out the first
        n = REPEATED.get(payload[0], 0) if payload[0] != READ_DATA or len(payload) == 3 else 0
        if got[1 : 1 + n] != bytes(
            (payload[1] & ~SUPPRESS_BIT, *payload[2 : 1 + n]) if with_sub else payload[1 : 1 + n]
        ):
            raise NoAnswerError(f"{self.say(payload).text}: something else was answered: {got.hex(' ').upper()}")
        return got

    def say(self, answer: bytes) -> Said:
        """An answer in words."""
        return describe(answer, self.known)

    def session(self, number: int) -> bytes:
        """Change the session."""
        return self.ask(bytes((0x10, number)))

    def unlock(self, level: int, key_of: Callable[[bytes], bytes]) -> None:
        """Security access: ask for the seed of a level (from 1), send its key; a seed of zeros is unlocked already."""
        answer = self._asked(bytes((0x27, 2 * level - 1)), lambda: self._client.request_seed(2 * level - 1))
        seed = b"" if answer is None else bytes(answer.service_data.seed)
        if any(seed):
            key = key_of(seed)
            self._asked(bytes((0x27, 2 * level)) + key, lambda: self._client.send_key(2 * level, key))

    def present(self) -> None:
        """Keep the session alive; no answer is wanted."""
        self.ask(bytes((0x3E, 0x80)))

    def measure(self, rate: int, lows: bytes, seconds: float) -> list[tuple[int, bytes]]:
        """Have periodic data sent for a while, in an extended session: time of reception, ns, and data of each frame.

        Parameters
        ----------
        rate : transmission mode of ReadDataByPeriodicIdentifier, 1 slow, 2 medium, 3 fast.
        lows : low bytes of the data identifiers.
        """
        self.session(EXTENDED_SESSION)
        self.ask(
            bytes((READ_PERIODICALLY, STOP_SENDING))
        )  # of another tester that has just ended: it counts among the most at once
        self._connection.take_periodic(0.0)
        self.ask(bytes((READ_PERIODICALLY, rate)) + lows)
        taken: list[tuple[int, bytes]] = []
        try:
            while seconds > 0.0:
                part_s = min(seconds, PRESENT_EVERY_S)
                taken += self._connection.take_periodic(part_s)
                seconds -= part_s
                self.present()
        finally:
            self.ask(bytes((READ_PERIODICALLY, STOP_SENDING)))
        return taken + self._connection.take_periodic(0.0)

    def codes(self, mask: int) -> list[FoundDtc]:
        """Trouble codes of which any bit of the mask is set in the status."""
        answer = self._asked(bytes((0x19, 0x02, mask)), lambda: self._client.get_dtc_by_status_mask(mask))
        return _found(answer)

    def supported(self) -> list[FoundDtc]:
        """All trouble codes that the ECU knows."""
        return _found(self._asked(bytes((0x19, 0x0A)), self._client.get_supported_dtc))

    def clear(self, group: int = ALL_CODES) -> None:
        """Clear one trouble code, a group, or all."""
        request = b"\x14" + group.to_bytes(3, "big")
        self._asked(request, lambda: self._client.clear_dtc(group))

    def _asked(self, payload: bytes, do: Callable[[], Any]) -> Any:
        """Do what asks; its errors become ours, and the exchange is told."""
        begin_ns = monotonic_ns()
        answer = b""
        try:
            response = do()
            if response is not None:
                answer = bytes(response.original_payload)
            return response
        except NegativeResponseException as error:
            code = int(error.response.code or 0)
            answer = bytes((NEGATIVE_RESPONSE, payload[0], code))
            raise RefusedError(payload[0], code) from error
        except TimeoutException as error:
            trouble = "; ".join(self._connection.trouble)
            raise NoAnswerError(
                f"{service_text(payload[0])}: no answer{f' ({trouble})' if trouble else ''}; is the ECU running on "
                "this bus, and are --request-id and --response-id its identifiers?"
            ) from error
        except (InvalidResponseException, UnexpectedResponseException) as error:
            answer = error.response.original_payload or b""
            raise NoAnswerError(f"{service_text(payload[0])}: {error}: {answer.hex(' ')}") from error
        finally:
            self._tell(Exchange(payload, answer, monotonic_ns() - begin_ns))


def _found(answer: Any) -> list[FoundDtc]:
    return [FoundDtc(int(dtc.id), int(dtc.status.get_byte_as_int())) for dtc in answer.service_data.dtcs]
