"""Serves the page on 127.0.0.1 and talks to it over WebSockets; each page has threads of its own.

Whoever does not know the token gets neither page nor data, and a socket is opened only for the page's own origin: no
other web page, and no other user of the machine, can watch or command the bench.
"""

import contextlib
import hmac
import logging
import secrets
import socket
import struct
from collections.abc import Callable
from http import HTTPStatus
from threading import Lock, Thread
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from hil.errors import BrakebenchError
from hil.live.assets import SECURITY, assets
from hil.live.mailbox import Mailbox
from hil.rt.clock import WallClock

HOST = "127.0.0.1"
SOCKET = "/socket"
MOST_PAGES = 8
_MOST_COMMAND = 4096  # bytes of a command
_OPEN_TIMEOUT_S = 2.0  # a browser opens connections that it may never use
_SEND_TIMEOUT_S = 30  # a page that takes nothing for so long is let go; it comes back by itself
_FAREWELL_NS = 500_000_000  # for the last message of all pages; one that stands still has to do without

Greet = Callable[[], str]
Take = Callable[[str, Mailbox], None]


class ServerError(BrakebenchError):
    """The page cannot be served."""


class Server:
    """The page's server.

    Parameters
    ----------
    greet : gives the first message to a page.
    take : takes a page's commands, and the mailbox that its answer goes to; called from the page's thread.
    port : 0 for any that is free.

    Attributes
    ----------
    url : of the page, with the token.

    Raises
    ------
    ServerError : the port is taken.
    """

    def __init__(self, greet: Greet, take: Take, port: int = 0) -> None:
        self._greet, self._take = greet, take
        self._token = secrets.token_urlsafe(24)
        self._lock = Lock()
        self._pages: dict[ServerConnection, Mailbox] = {}
        self._senders: dict[ServerConnection, Thread] = {}
        try:
            listener = socket.create_server((HOST, port))
        except OSError as error:
            raise ServerError(f"port {port} of {HOST}: {error.strerror}; take another with --port") from error
        self._host = f"{HOST}:{listener.getsockname()[1]}"
        self._origin = f"http://{self._host}"
        self.url = f"{self._origin}/?token={self._token}"
        self._headers = {
            name: value.replace("{socket}", f"ws://{self._host}{SOCKET}") for name, value in SECURITY.items()
        }
        logger = logging.getLogger("brakebench.live")
        logger.setLevel(logging.CRITICAL)  # a browser that goes away is nothing to tell
        self._server = serve(
            self._serve_page,
            sock=listener,
            origins=[self._origin],  # type: ignore[list-item]  # Origin is a NewType of str
            compression=None,
            process_request=self._answer,
            server_header=None,
            open_timeout=_OPEN_TIMEOUT_S,
            max_size=_MOST_COMMAND,
            logger=logger,
        )
        self._thread = Thread(target=self._server.serve_forever, name="live server", daemon=True)
        self._thread.start()

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    @property
    def dropped(self) -> int:
        """Messages that the open pages were too slow for."""
        with self._lock:
            return sum(mailbox.dropped for mailbox in self._pages.values())

    def send(self, text: str) -> None:
        """Send a message to all pages; never waits for one."""
        with self._lock:
            for mailbox in self._pages.values():
                mailbox.put(text)

    def close(self) -> None:
        """Let all pages go once they have the last message, and without it those that take nothing any longer."""
        with self._lock:
            pages, senders = list(self._pages), list(self._senders.values())
            for mailbox in self._pages.values():
                mailbox.close()
        clock = WallClock()
        deadline_ns = clock.now_ns() + _FAREWELL_NS
        for sender in senders:
            sender.join(max(0, deadline_ns - clock.now_ns()) * 1e-9)
        for page in pages:
            with contextlib.suppress(OSError):
                page.socket.shutdown(socket.SHUT_RDWR)
        self._server.shutdown()
        self._thread.join()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer everything but a socket's opening that is ours; None lets that go on."""
        parts = urlsplit(request.path)
        if request.headers.get_all("Host") != [self._host]:  # a name that somebody has resolve to us
            return self._refusal(HTTPStatus.MISDIRECTED_REQUEST, f"expected the host {self._host}")
        given = parse_qs(parts.query).get("token", [""])[-1]
        known = hmac.compare_digest(given.encode(), self._token.encode())
        if parts.path == SOCKET:
            if not known:
                return self._refusal(HTTPStatus.FORBIDDEN, "expected the token of the page's address")
            if request.headers.get_all("Origin") != [self._origin]:
                return self._refusal(HTTPStatus.FORBIDDEN, f"expected the origin {self._origin}")
            if self.pages >= MOST_PAGES:
                return self._refusal(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_PAGES} pages are open; close one")
            return None
        if parts.path not in assets():
            return self._refusal(HTTPStatus.NOT_FOUND, "there is no such file")
        if parts.path == "/" and not known:
            return self._refusal(HTTPStatus.FORBIDDEN, "open the page by the whole address that brakebench printed")
        return self._response(HTTPStatus.OK, *assets()[parts.path])

    def _refusal(self, status: HTTPStatus, why: str) -> Response:
        return self._response(status, "text/plain; charset=utf-8", f"brakebench: {why}\n".encode())

    def _response(self, status: HTTPStatus, kind: str, body: bytes) -> Response:
        headers = Headers(self._headers)
        headers["Content-Type"] = kind
        headers["Content-Length"] = str(len(body))
        headers["Connection"] = "close"
        return Response(status.value, status.phrase, headers, body)

    def _serve_page(self, page: ServerConnection) -> None:
        mailbox = Mailbox()
        page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", _SEND_TIMEOUT_S, 0))
        with contextlib.suppress(ConnectionClosed):
            page.send(self._greet())
            sender = Thread(target=_send_all, args=(page, mailbox), name="live page", daemon=True)
            with self._lock:
                self._pages[page], self._senders[page] = mailbox, sender
            sender.start()
            try:
                for text in page:
                    if isinstance(text, str):
                        self._take(text, mailbox)
            finally:
                with self._lock:
                    del self._pages[page], self._senders[page]
                mailbox.close()


def _send_all(page: ServerConnection, mailbox: Mailbox) -> None:
    """Send what comes into a mailbox until it is closed or the page is gone."""
    with contextlib.suppress(ConnectionClosed):
        while (text := mailbox.take()) is not None:
            page.send(text)
