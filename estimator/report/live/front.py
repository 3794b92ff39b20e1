"""The server between a live page and the network: who is served, and what may reach viser.

viser serves a websocket whatever page asks for it (its Origin), keeps messages of up to 50 MiB and
prints a traceback for each that it cannot read. So viser listens on a loopback address drawn at
random, which nobody else knows, and this front on the address that people are told. It passes on

- to the browser: all that viser sends;
- to viser: that a box was ticked, which is all that our page has to say. Whatever else a client
  sends (its camera, uploads, a request to share the page, garbage) is dropped; a message of more
  than ``LARGEST`` bytes ends its connection before it is kept.

A request is answered only where its Host is this computer, and a websocket only where its Origin
is that Host (RFC 6455, 10.2). So no page of another web site can read a run, not even one whose
name was made to mean this computer (DNS rebinding).
"""

from __future__ import annotations

import asyncio
import http.client
import ipaddress
import logging
import secrets
import socket
import threading
from collections.abc import Collection
from contextlib import closing, suppress
from http import HTTPStatus
from typing import Final, Literal
from urllib.parse import quote, urlsplit

import msgspec
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.http11 import Request, Response
from websockets.typing import Data, Subprotocol

from protocol.system.process import Closable

LARGEST: Final = 4096  # bytes of a message from a browser; that a box was ticked takes about 100
CONNECTIONS: Final = 32  # at a time, of all visitors; a browser opens two or three
_FILE_TIMEOUT: Final = 10.0  # s, in which viser answers a request for a file

_log: Final = logging.getLogger(__name__)


def private_loopback() -> str:
    """A loopback address that cannot be guessed: all of 127/8 is loopback (RFC 1122, 3.2.1.3)."""
    return ".".join(["127", *(str(1 + secrets.randbelow(254)) for _ in range(3))])


class Front(Closable):
    """Serves a page of viser to those who may see it; a context manager.

    Args:
        listening: Socket on which the page is served; closed together with the front.
        viser: Host and port of viser.
        version: Version of viser; the page of another version is refused.
        names: Host names by which the page may be asked for, beside IP addresses.
    """

    def __init__(
        self,
        listening: socket.socket,
        viser: tuple[str, int],
        *,
        version: str,
        names: Collection[str],
    ) -> None:
        self._listening = listening
        self._viser = viser
        self._protocol = Subprotocol(f"viser-v{version}")
        self._names = sorted({name.lower() for name in names if not _is_address(name)})
        self._visits: set[ServerConnection] = set()
        self._loop = asyncio.new_event_loop()
        self._end = asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends all connections."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        async with serve(
            self._pass_on,
            sock=self._listening,
            process_request=self._answer,
            subprotocols=[self._protocol],
            create_connection=_counted_connections(self._visits),
            compression=None,
            max_size=LARGEST,
            logger=_log,
        ):
            await self._end.wait()
            for visit in tuple(self._visits):  # one that does not answer would delay the end
                visit.transport.abort()

    async def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Returns the answer to a request, or ``None`` where a websocket is to be opened."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or not self._is_here(hosts[0]):
            sentence = f"Ask for this page by an IP address, or as {', '.join(self._names)}.\n"
            return connection.respond(HTTPStatus.MISDIRECTED_REQUEST, sentence)
        if "Upgrade" not in request.headers:
            return await asyncio.to_thread(self._file, request)
        if origins != [f"http://{hosts[0]}"]:
            return connection.respond(HTTPStatus.FORBIDDEN, "Not for pages of another site.\n")
        return None

    def _is_here(self, host: str) -> bool:
        """Whether a Host header has a name of ours, or an IP address, which DNS cannot redirect."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        return name in self._names or _is_address(name)

    def _file(self, request: Request) -> Response:
        """Returns what viser answers to a request for a file."""
        encodings = ", ".join(request.headers.get_all("Accept-Encoding"))
        with closing(http.client.HTTPConnection(*self._viser, timeout=_FILE_TIMEOUT)) as viser:
            path = quote(request.path, safe="/%?=&", errors="replace")
            viser.request("GET", path, headers={"Accept-Encoding": encodings})
            answer = viser.getresponse()
            headers = Headers(answer.getheaders())
            return Response(answer.status, answer.reason, headers, answer.read())

    async def _pass_on(self, visitor: ServerConnection) -> None:
        """Passes messages on until either side hangs up."""
        host, port = self._viser
        async with connect(
            f"ws://{host}:{port}",
            subprotocols=[self._protocol],
            compression=None,
            max_size=None,
            proxy=None,
            logger=_log,
        ) as viser:

            async def down() -> None:
                async for message in viser:
                    await visitor.send(message)

            async def up() -> None:
                async for message in visitor:
                    if (ticked := _box_ticked(message)) is not None:
                        await viser.send(ticked)

            relays = [asyncio.create_task(relay()) for relay in (down, up)]
            try:
                await asyncio.wait(relays, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for relay in relays:
                    relay.cancel()
                for relay in relays:
                    with suppress(asyncio.CancelledError, ConnectionClosed):
                        await relay


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _counted_connections(visits: set[ServerConnection]) -> type[ServerConnection]:
    """Class of connections, kept in a set while they last, closed at once if there are too many."""

    class Visit(ServerConnection):
        """The connection of a visitor."""

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(transport)
            visits.add(self)
            if len(visits) > CONNECTIONS:
                self.transport.abort()

        def connection_lost(self, exc: Exception | None) -> None:
            visits.discard(self)
            super().connection_lost(exc)

    return Visit


class _BoxTicked(
    msgspec.Struct, tag_field="type", tag="GuiUpdateMessage", forbid_unknown_fields=True
):
    """The message of a checkbox, as viser writes it."""

    uuid: str
    updates: dict[Literal["value"], bool]


def _box_ticked(message: Data) -> bytes | None:
    """The message of a ticked box, encoded anew for viser; ``None``: any other message."""
    if isinstance(message, str):
        return None
    try:
        return msgspec.msgpack.encode(msgspec.msgpack.decode(message, type=_BoxTicked))
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None


def _is_our_fault(record: logging.LogRecord) -> bool:
    """Whether a record tells of a failure of our own, not of something that a visitor did wrong."""
    error = record.exc_info[1] if record.exc_info else None
    handler_failed = record.getMessage() == "connection handler failed"  # as websockets says it
    return handler_failed and not isinstance(error, WebSocketException | OSError)


_log.addFilter(_is_our_fault)
