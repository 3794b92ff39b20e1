"""A TCP listener that gives each connection a ZeroMQ socket of its own."""

from __future__ import annotations

import errno
import itertools
import logging
import os
import resource
import secrets
import selectors
import socket
import struct
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, ClassVar, Final, NamedTuple

import zmq

from protocol.errors import EndpointError
from protocol.security.keys import KeyPair
from protocol.sockets.tcp_connection import TcpConnection
from protocol.sockets.zmq_sockets import Endpoint, serving
from protocol.system.process import kept_from_children

MOST: Final = 240
"""Most connections of a server: descriptors stay below 1024, beyond which ``select`` fails."""

TOTAL: Final = 8 << 20
"""Most bytes that ZeroMQ may hold for all connections of a listener together."""

_FILES: Final = 4  # descriptors that a connection takes
_RESERVE: Final = 48  # descriptors for everything else
_MAX_ACCEPTS: Final = 8  # most connections accepted in one turn
_BACKLOG: Final = 100  # connections that wait in the kernel
_PATIENCE: Final = 1.0  # s that ZeroMQ may take to connect to the other end of a pipe
_LIGHT: Final = 1 << 16  # bytes that a connection may hold before the total is added up
_CREDENTIALS: Final = struct.Struct("3i")  # ids of process, user, group
_EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_IDLE: Final = 30  # s of silence, then TCP checks whether the peer is still there


class Arrival(NamedTuple):
    """A message that came: its connection's number, the key that sent it, and its parts."""

    peer: bytes
    user: str | None
    parts: list[bytes]


class TcpListener:
    """A listening socket and its connections; only the thread that polls the selector may use it.

    Args:
        context: ZeroMQ context; with keys, a ``ZapHandler`` must exist in it already.
        selector: Where the listener registers; its owner calls what is registered, with the events.
        place: Address to listen at; port 0: any free one.
        pair: The robot's keys, or ``None``.
        share: Share of this listener in the connections that a server may have.
        log: Log for connections that were cut.

    Attributes:
        KIND: Type of the ZeroMQ sockets, ROUTER or XPUB; subclasses set it and the next two.
        WINDOW: Most bytes that ZeroMQ may hold for one connection.
        CHUNK: Most bytes of one connection that one turn hands to ZeroMQ.
        place: Address that it listens at, with the port that was chosen.

    Raises:
        EndpointError: The address cannot be bound.
    """

    KIND: ClassVar[int]
    WINDOW: ClassVar[int]
    CHUNK: ClassVar[int]

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        selector: selectors.BaseSelector,
        place: Endpoint,
        pair: KeyPair | None,
        *,
        share: float,
        log: logging.Logger,
    ):
        self._context = context
        self._selector = selector
        self._pair = pair
        self._log = log
        self._cut = 0
        self._most = max(1, round(share * _capacity()))
        self._connections: dict[bytes, TcpConnection] = {}
        self._numbers = itertools.count(1)
        self._ready: deque[TcpConnection] = deque()
        self._listener = _bound(place)
        self.place = Endpoint("*" if place.is_wildcard else place.host, _port(self._listener))
        selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def __len__(self) -> int:
        return len(self._connections)

    @property
    def waiting(self) -> bool:
        """Whether ``arrivals`` may have something."""
        return bool(self._ready)

    def arrivals(self, until: float) -> Iterator[Arrival]:
        """Yields at most one message of each connection, in turn.

        Args:
            until: When to leave the other connections for the next turn, monotonic, s.
        """
        for _ in range(len(self._ready)):
            connection = self._ready.popleft()
            frames = connection.receive()
            if frames is None:
                connection.waiting = False
                if connection.ended:
                    self._close(connection)
                continue
            self._ready.append(connection)
            if self._pair is not None:
                connection.user = _user_of(frames[-1])
            yield Arrival(connection.number, connection.user, [frame.bytes for frame in frames])
            if time.monotonic() >= until:
                return

    def send(self, peer: bytes, parts: Sequence[bytes]) -> None:
        """Sends a message to a peer; drops it if the peer is gone or does not read."""
        connection = self._connections.get(peer)
        if connection is not None:
            connection.send(parts)

    def received(self, peer: bytes) -> int:
        """Bytes of all messages that came on a connection."""
        return self._connections[peer].received

    def broadcast(self, parts: Sequence[bytes]) -> None:
        """Sends a message to all peers; a publisher's socket passes it to subscribers only."""
        for connection in self._connections.values():
            connection.send(parts)

    def dismiss(self, unwelcome: Callable[[str | None], bool]) -> None:
        """Closes the connections made with keys that ``unwelcome`` is true of."""
        for connection in tuple(self._connections.values()):
            if unwelcome(connection.user):
                self._close(connection)

    def cut(self, peer: bytes, why: str) -> None:
        """Closes the connection of a peer that misbehaves, and logs why."""
        connection = self._connections[peer]
        self._close(connection)
        self._report(connection.peer, why)

    def close(self, linger: int) -> None:
        """Ends all connections; what was sent has ``linger`` ms to leave."""
        self._selector.unregister(self._listener)
        self._listener.close()
        end = time.monotonic() + linger / 1000
        for connection in self._connections.values():
            connection.close(linger)
        for connection in self._connections.values():
            connection.flush(max(0.001, end - time.monotonic()))
        self._connections.clear()

    # --- connections ------------------------------------------------------------------------------

    def _accept(self, mask: int) -> None:
        del mask
        for _ in range(_MAX_ACCEPTS):
            try:
                tcp, address = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in _EXHAUSTED and self._connections:
                    self._close(self._weakest())
                return
            if len(self) >= self._most:
                self._close(self._weakest())
            try:
                self._open(kept_from_children(tcp), f"{address[0]}:{address[1]}")
            except (OSError, zmq.ZMQError) as error:  # it is gone already, or there is no room
                tcp.close()
                self._report(address[0], str(error))

    def _open(self, tcp: socket.socket, peer: str) -> None:
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        tcp.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, _IDLE)
        wire = serving(self._context, self.KIND, self._pair, peer)
        try:
            pipe = _piped(wire)
        except BaseException:
            wire.close(0)
            raise
        number = next(self._numbers).to_bytes(8, "big")
        self._connections[number] = TcpConnection(
            number,
            peer,
            self._selector,
            tcp=tcp,
            pipe=pipe,
            wire=wire,
            chunk=self.CHUNK,
            on_signal=self._signalled,
            on_bytes=self._weigh,
        )

    def _signalled(self, connection: TcpConnection) -> None:
        if not connection.waiting:
            connection.waiting = True
            self._ready.append(connection)

    def _weigh(self, connection: TcpConnection) -> None:
        """Disconnects peers that send messages without an end."""
        if connection.held > self.WINDOW:
            self.cut(connection.number, f"over {self.WINDOW} bytes without the end of a message")
        elif connection.held > _LIGHT and sum(c.held for c in self._connections.values()) > TOTAL:
            worst = max(self._connections.values(), key=lambda one: one.held)
            self.cut(worst.number, f"over {TOTAL} bytes of unfinished messages of all connections")

    def _report(self, peer: str, why: str) -> None:
        self._cut += 1
        if self._cut & (self._cut - 1) == 0:  # at 1, 2, 4, …: a flood cannot fill the log
            self._log.warning("cut off %s: %s (%d so far)", peer, why, self._cut)

    def _weakest(self) -> TcpConnection:
        """The connection to close when there are too many.

        One that has sent no message yet; if all have, one of the key with most connections; among
        these the one that has been silent for longest.
        """
        places = Counter(one.user for one in self._connections.values())
        return min(
            self._connections.values(),
            key=lambda one: (one.proven, one.proven and -places[one.user], one.heard),
        )

    def _close(self, connection: TcpConnection) -> None:
        self._connections.pop(connection.number, None)
        connection.close()


def _piped(wire: zmq.Socket[bytes]) -> socket.socket:
    """Returns the near end of a Unix-domain socket that the ZeroMQ socket is connected to.

    It has a name for a moment, in Linux's abstract namespace, which leaves no files.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        name = f"bodyschema-{secrets.token_hex(16)}"
        listener.bind(f"\0{name}")
        listener.listen(1)
        listener.settimeout(_PATIENCE)
        wire.connect(f"ipc://@{name}")
        while True:
            pipe, _ = listener.accept()
            credentials = pipe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            if _CREDENTIALS.unpack(credentials)[0] == os.getpid():
                return pipe
            pipe.close()  # a stranger on this computer, who was quicker


def _bound(place: Endpoint) -> socket.socket:
    try:
        family, kind, number, _, address = socket.getaddrinfo(
            None if place.host == "*" else place.host,
            place.port,
            family=socket.AF_INET6 if place.is_ipv6 else socket.AF_INET,
            type=socket.SOCK_STREAM,
            flags=socket.AI_PASSIVE,
        )[0]
        listener = kept_from_children(socket.socket(family, kind, number))
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if place.is_ipv6:
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            listener.bind(address)
            listener.listen(_BACKLOG)
            listener.setblocking(False)
        except BaseException:
            listener.close()
            raise
    except (OSError, UnicodeError) as error:  # UnicodeError: the host's name cannot be encoded
        reason = getattr(error, "strerror", None) or "there is no such host"
        raise EndpointError(
            f"Cannot serve at {place}: {reason}. Stop what uses it, or choose another address."
        ) from None
    return listener


def _port(listener: socket.socket) -> int:
    return int(listener.getsockname()[1])


def _capacity() -> int:
    """Returns how many connections there are file descriptors for, at most ``MOST``."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST if soft == resource.RLIM_INFINITY else min(MOST, (soft - _RESERVE) // _FILES)


def _user_of(frame: Any) -> str | None:
    with suppress(zmq.ZMQError):
        return str(frame.get("User-Id"))
    return None  # it passed no ZAP handler, which cannot be: it will be refused
