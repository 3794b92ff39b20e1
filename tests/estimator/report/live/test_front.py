"""Who may see a live page, and what they can do to it; with real sockets."""

from __future__ import annotations

import http.client
import logging
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext
from threading import Thread
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidMessage, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.sync.server import ServerConnection, serve
from websockets.typing import Origin, Subprotocol

from estimator.report.live.front import CONNECTIONS, LARGEST, Front

if TYPE_CHECKING:
    from estimator.report.live.live_page import LivePage

VERSION = "7.0"
TICKED = {"type": "GuiUpdateMessage", "uuid": "5e0", "updates": {"value": True}}
DROPPED: dict[str, Any] = {
    "camera": {"type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0]},
    "upload": {"type": "FileTransferStartUpload", "size_bytes": 1 << 40, "part_count": 1 << 20},
    "share": {"type": "ShareUrlRequest"},
    "other property": {**TICKED, "updates": {"value": True, "removed": True}},
    "no truth": {**TICKED, "updates": {"value": "x" * 3000}},
    "no name": {**TICKED, "uuid": None},
    "no map": [TICKED],
    "further field": {**TICKED, "excluded_self_client": 0},
}


class Viser:
    """Takes viser's place: keeps what reaches it, and greets."""

    def __init__(self) -> None:
        self.heard: list[object] = []
        self._server = serve(
            self._listen, "127.0.0.1", 0, subprotocols=[Subprotocol(f"viser-v{VERSION}")]
        )
        self.address: tuple[str, int] = self._server.socket.getsockname()
        Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()

    def _listen(self, connection: ServerConnection) -> None:
        for message in connection:
            assert isinstance(message, bytes)
            self.heard.append(msgpack.unpackb(message))
            connection.send(b"heard")


@pytest.fixture(scope="module")
def viser() -> Iterator[Viser]:
    with closing(Viser()) as viser:
        yield viser


@contextmanager
def front(viser: Viser) -> Iterator[int]:
    """A front before viser; its port."""
    listening = socket.create_server(("127.0.0.1", 0))
    names = ["localhost", "Crawler.lab", "127.0.0.1"]
    with Front(listening, viser.address, version=VERSION, names=names):
        yield listening.getsockname()[1]


@pytest.fixture(scope="module")
def port(viser: Viser) -> Iterator[int]:
    with front(viser) as port:
        yield port


@contextmanager
def visit(
    port: int, host: str = "localhost", origin: str | None = "http://localhost:{port}"
) -> Iterator[Connection]:
    """A websocket to the front, which a page of ``origin`` opens to ``host``."""
    connection = socket.create_connection(("127.0.0.1", port))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # many small messages
    with connect(
        f"ws://{host}:{port}",
        sock=connection,
        origin=None if origin is None else Origin(origin.format(port=port)),
        subprotocols=[Subprotocol(f"viser-v{VERSION}")],
        compression=None,
        max_size=None,
    ) as socket_:
        yield socket_


def tick(connection: Connection) -> None:
    connection.send(msgpack.packb(TICKED))
    assert connection.recv(timeout=60) == b"heard"


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "[::1]", "10.1.2.3", "crawler.lab"])
def test_the_own_page_is_served_by_each_name_of_the_computer(port: int, host: str) -> None:
    with visit(port, host, f"http://{host}:{port}") as connection:
        tick(connection)


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("localhost", None),
        ("localhost", "null"),
        ("localhost", "http://evil.example"),
        ("localhost", "http://localhost"),  # another program's page, on another port
        ("localhost", "http://localhost:{port}.evil.example"),
        ("localhost", "http://127.0.0.1:{port}"),
        ("localhost", "https://localhost:{port}"),
        ("evil.example", "http://evil.example:{port}"),  # a name made to mean this computer
        ("localhost.evil.example", "http://localhost.evil.example:{port}"),
        ("127.0.0.1.evil.example", "http://127.0.0.1.evil.example:{port}"),
    ],
)
def test_a_page_of_another_site_is_refused(port: int, host: str, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused, visit(port, host, origin):
        pass
    foreign = host != "localhost"
    assert refused.value.response.status_code == (421 if foreign else 403)
    if foreign:
        assert b"by an IP address, or as crawler.lab, localhost." in refused.value.response.body


@pytest.mark.parametrize(
    "lines",
    [
        [],
        ["Host: evil.example"],
        ["Host: localhost", "Host: evil.example"],
        ["Host: [::1"],
        ["Host: localhost@evil.example"],
    ],
)
def test_no_file_is_served_under_another_name(port: int, lines: list[str]) -> None:
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.sendall("\r\n".join(["GET / HTTP/1.1", *lines, "", ""]).encode())
        answer = http.client.HTTPResponse(connection)
        answer.begin()
        assert answer.status == 421


def test_only_that_a_box_was_ticked_reaches_viser(port: int, viser: Viser) -> None:
    viser.heard.clear()
    with visit(port) as connection:
        for message in DROPPED.values():
            connection.send(msgpack.packb(message))
        connection.send("text")
        connection.send(msgpack.packb(TICKED)[:-1])
        connection.send(msgpack.packb(TICKED) * 2)
        tick(connection)
    assert viser.heard == [TICKED]


@settings(deadline=None, max_examples=30)
@given(messages=st.lists(st.binary(max_size=200) | st.text(max_size=50), max_size=20))
def test_garbage_does_nothing(port: int, viser: Viser, messages: list[bytes | str]) -> None:
    viser.heard.clear()
    with visit(port) as connection:
        for message in messages:
            connection.send(message)
        tick(connection)
    assert viser.heard == [TICKED]


def send_until_closed(connection: Connection, message: bytes) -> None:
    """Sends, and takes in what comes until the connection is closed, which raises."""
    connection.send(message)
    while True:
        connection.recv(timeout=120)


@pytest.mark.parametrize("size", [LARGEST + 1, 45 << 20])
def test_a_large_message_ends_its_connection_and_no_other(port: int, size: int) -> None:
    with visit(port) as other:
        with visit(port) as connection, pytest.raises(ConnectionClosed) as closed:
            send_until_closed(connection, bytes(size))
        assert closed.value.rcvd is None or closed.value.rcvd.code == 1009
        tick(other)


def test_visitors_that_are_too_many_are_closed_at_once(viser: Viser) -> None:
    closed = (InvalidMessage, ConnectionClosed, OSError)
    with front(viser) as port:
        with ExitStack() as visitors:
            for _ in range(CONNECTIONS):
                visitors.enter_context(socket.create_connection(("127.0.0.1", port)))
            with pytest.raises(closed), visit(port):
                pass
        until = time.monotonic() + 60
        while True:  # who has gone no longer counts, as soon as the front has noticed
            try:
                with visit(port) as connection:
                    tick(connection)
                    return
            except closed:
                assert time.monotonic() < until


def test_a_visitor_who_does_not_answer_cannot_keep_a_page_open(viser: Viser) -> None:
    lines = [
        "GET / HTTP/1.1",
        "Host: localhost",
        "Origin: http://localhost",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        f"Sec-WebSocket-Protocol: viser-v{VERSION}",
    ]
    silent, asks_nothing = socket.socket(), socket.socket()
    with silent, asks_nothing:
        with front(viser) as port:
            asks_nothing.connect(("127.0.0.1", port))
            silent.connect(("127.0.0.1", port))
            silent.sendall("\r\n".join([*lines, "", ""]).encode())
            assert silent.recv(4096).startswith(b"HTTP/1.1 101 ")
            ended = time.monotonic()
        assert time.monotonic() - ended < 8  # the library waits for 10 s


def test_nothing_that_a_visitor_sends_is_printed(
    live: LivePage, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    import viser

    at = urlsplit(live.uri)
    assert at.port is not None
    for garbage in (b"", b"\0\xff\r\n\r\n", b"GET \xff HTTP/1.1\r\nHost: localhost\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", at.port)) as connection:
            connection.sendall(garbage)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(1 << 16):
                pass
    for version in ("0.0", viser.__version__):
        with (
            pytest.raises(InvalidStatus) if version == "0.0" else nullcontext(),
            connect(
                live.uri.replace("http", "ws", 1),
                origin=Origin(live.uri),
                subprotocols=[Subprotocol(f"viser-v{version}")],
                max_size=None,
                max_queue=None,
            ) as page,
        ):
            for message in (*DROPPED.values(), TICKED):
                page.send(msgpack.packb(message))
            page.send("text")
            assert page.ping().wait(120)
    live.close()
    assert capfd.readouterr() == ("", "")
    assert not [one for one in caplog.records if one.levelno >= logging.WARNING]
