"""The page's server on real sockets: who gets what, and that nobody who does not read holds anybody up."""

import json
import socket
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from hil.live.assets import assets
from hil.live.mailbox import MOST_WAITING, Mailbox
from hil.live.server import MOST_PAGES, SOCKET, Server, ServerError


@pytest.fixture
def taken():
    return []


@pytest.fixture
def server(taken):
    one = Server(lambda: "hello", lambda text, mailbox: (taken.append(text), mailbox.put(f"heard {text}")))
    yield one
    one.close()


def origin(server):
    return server.url.partition("/?")[0]


def socket_url(server):
    return server.url.replace("http://", "ws://").replace("/?", f"{SOCKET}?")


def page(server, **more):
    return connect(socket_url(server), **{"origin": origin(server), "compression": None, "proxy": None, **more})


def get(server, path, method="GET", host=None):
    """Status, headers in lower case, and body of a plain request."""
    address = urlsplit(server.url)
    with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
        connection.sendall(f"{method} {path} HTTP/1.1\r\nHost: {host or address.netloc}\r\n\r\n".encode())
        answer = b""
        while part := connection.recv(65536):
            answer += part
    head, _, body = answer.partition(b"\r\n\r\n")
    first, *lines = head.decode().split("\r\n")
    return int(first.split()[1]), dict(line.lower().split(": ", 1) for line in lines), body


def test_it_listens_on_this_machine_alone(server):
    assert urlsplit(server.url).hostname == "127.0.0.1"
    assert server._server.socket.getsockname()[0] == "127.0.0.1"


def test_the_page_comes_with_its_token_only_and_loads_nothing_from_elsewhere(server):
    status, headers, body = get(server, server.url.removeprefix(origin(server)))
    assert status == 200
    policy = dict(part.split(" ", 1) for part in headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == "'self'"
    assert policy["connect-src"] == f"ws://{urlsplit(server.url).netloc}{SOCKET}"
    assert policy["frame-ancestors"] == "'none'"
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    named = [word.partition(b'"')[0].decode() for part in (b'src="', b'href="/') for word in body.split(part)[1:]]
    assert len(named) > 5
    for name in named:
        assert get(server, f"/{name.lstrip('/')}")[0] == 200, name
    for path in ("/", "/?token=", "/?token=wrong"):
        assert get(server, path)[0] == 403
    assert get(server, "/../pyproject.toml")[0] == 404


@pytest.mark.parametrize("name", sorted(assets()))
def test_no_file_of_the_page_names_another_machine(name):
    text = assets()[name][1].decode().replace("http://www.w3.org/", "")
    assert "https://" not in text.replace("https://github.com/leeoniya/uPlot", "") or name == "/uplot.js"
    assert "http://" not in text
    assert "innerHTML" not in text or name == "/uplot.js"  # what a log says is text


def test_another_name_for_this_machine_is_refused(server):
    assert get(server, server.url.removeprefix(origin(server)), host="evil.example")[0] == 421


@pytest.mark.parametrize(
    "wrong",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": None},
        {"origin": "http://localhost:1"},
        {"token": "wrong"},
        {"token": ""},
    ],
)
def test_a_socket_is_refused_without_token_and_origin_of_the_page(server, taken, wrong):
    url = socket_url(server)
    if "token" in wrong:
        url = url.partition("token=")[0] + "token=" + wrong["token"]
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(url, origin=wrong.get("origin", origin(server)), compression=None, proxy=None) as other,
    ):
        other.send("pedal")
    assert refused.value.response.status_code == 403
    assert taken == []


def test_the_page_is_greeted_heard_and_answered(server, taken):
    with page(server) as own:
        assert own.recv(timeout=10) == "hello"
        own.send("pedal")
        assert own.recv(timeout=10) == "heard pedal"
    assert taken == ["pedal"]


def test_too_long_a_command_ends_the_page_and_nothing_else(server, taken):
    with page(server) as one, page(server) as two:
        assert one.recv(timeout=10) == two.recv(timeout=10) == "hello"
        one.send("x" * 100_000)
        two.send("still here")
        assert two.recv(timeout=10) == "heard still here"
    assert taken == ["still here"]


def test_there_are_no_more_pages_than_it_can_serve(server):
    with ExitStack() as stack:
        for _ in range(MOST_PAGES):
            one = stack.enter_context(page(server))
            one.recv(timeout=10)
            one.send("in")  # it is counted by the time that it is answered
            one.recv(timeout=10)
        with pytest.raises(InvalidStatus) as refused, page(server):
            pass
        assert refused.value.response.status_code == 503


def test_a_page_that_never_reads_loses_the_oldest_and_holds_nobody_up(server):
    """Ten times what the system's buffers and the mailbox hold goes out; the other page still gets what is new."""
    text = "x" * 100_000
    count = MOST_WAITING + 400
    address = urlsplit(server.url)
    with socket.create_connection((address.hostname, address.port)) as deaf, page(server, max_size=None) as own:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        opening = (
            f"GET {SOCKET}?{address.query} HTTP/1.1\r\nHost: {address.netloc}\r\nOrigin: {origin(server)}\r\n"
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
        )
        deaf.sendall(opening.encode())
        assert b"101" in deaf.recv(12)
        own.recv(timeout=10)
        own.send("in")
        own.recv(timeout=10)
        while server.pages < 2:
            own.send("?")
            own.recv(timeout=10)
        for number in range(count):
            server.send(f"{number} {text}")
            if number % 20 == 0:  # this one keeps up
                while int(own.recv(timeout=10).split()[0]) < number:
                    pass
        assert server.dropped > 100
        server.send("-1 last")
        while own.recv(timeout=10) != "-1 last":
            pass
        server.close()  # does not wait for the deaf one
    assert server.pages == 0


def test_a_mailbox_keeps_the_newest():
    mailbox = Mailbox(most=3)
    for number in range(5):
        mailbox.put(str(number))
    assert mailbox.dropped == 2
    assert [mailbox.take() for _ in range(3)] == ["2", "3", "4"]
    mailbox.put("last")
    mailbox.close()
    assert [mailbox.take(), mailbox.take()] == ["last", None]


def test_the_last_message_still_comes_to_a_page_that_reads(server):
    with page(server) as own:
        own.recv(timeout=10)
        own.send("in")
        own.recv(timeout=10)
        server.send("the end")
        server.close()
        assert own.recv(timeout=10) == "the end"


def test_a_port_that_is_taken_is_named():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(ServerError, match=rf"port {port} of 127\.0\.0\.1: .*--port"):
            Server(lambda: "", lambda text, mailbox: None, port)


def test_the_token_is_another_one_each_time(server):
    other = Server(lambda: json.dumps({}), lambda text, mailbox: None)
    other.close()
    assert len(server.url.partition("token=")[2]) >= 32
    assert server.url.partition("token=")[2] != other.url.partition("token=")[2]
