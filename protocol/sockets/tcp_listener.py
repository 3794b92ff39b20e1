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
"""Connections of a server: their descriptors stay below 1024, beyond which ``select`` fails."""

TOTAL: Final = 8 << 20
"""What ZeroMQ may keep for all connections of a listener together, bytes."""

_FILES: Final = 4  # descriptors that a connection takes
_RESERVE: Final = 48  # descriptors for everything else
_ACCEPTED: Final = 8  # connections in one turn
_BACKLOG: Final = 100  # connections that wait in the kernel
_PATIENCE: Final = 1.0  # s that ZeroMQ may take to reach for the other end of a pipe
_FEW: Final = 1 << 16  # bytes: what a connection may hold without anybody adding up
_CREDENTIALS: Final = struct.Struct("3i")  # process, user, group
_EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_IDLE: Final = 30  # s, then TCP looks whether the peer is still there


class Arrival(NamedTuple):
    """A message that came: on which connection, from whose key, in which parts."""

    peer: bytes
    user: str | None
    parts: list[bytes]


class TcpListener:
    """A listener, and its connections; for the thread that polls the selector.

    Args:
        context: The context; with keys, a ``ZapHandler`` must stand there already.
        selector: Where the listener registers; its owner calls what is registered, with the events.
        place: Where; port 0: any free one.
        pair: The robot's keys, or ``None``.
        share: Of the connections that a server may have, those that come in here.
        log: Where to write about connections that were cut.

    Attributes:
        KIND: ROUTER or XPUB; subclasses fill it in, like those that follow.
        WINDOW: What ZeroMQ may keep for one connection, bytes.
        CHUNK: Bytes of one connection that a turn hands to ZeroMQ at most.
        place: Where it really is.

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
        """At most one message of each connection, in turn.

        Args:
            until: When to leave the others for the next turn, monotonic, s.
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
        """Sends a message to a peer; drops it where that is gone or does not read."""
        connection = self._connections.get(peer)
        if connection is not None:
            connection.send(parts)

    def received(self, peer: bytes) -> int:
        """Bytes of all messages that came on a connection."""
        return self._connections[peer].received

    def broadcast(self, parts: Sequence[bytes]) -> None:
        """Sends a message to all who want it."""
        for connection in self._connections.values():
            connection.send(parts)

    def dismiss(self, unwelcome: Callable[[str | None], bool]) -> None:
        """Hangs up on whoever's key is not welcome any more."""
        for connection in tuple(self._connections.values()):
            if unwelcome(connection.user):
                self._close(connection)

    def cut(self, peer: bytes, why: str) -> None:
        """Hangs up on a peer that misbehaves."""
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
        for _ in range(_ACCEPTED):
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
        elif connection.held > _FEW and sum(one.held for one in self._connections.values()) > TOTAL:
            most = max(self._connections.values(), key=lambda one: one.held)
            self.cut(most.number, f"over {TOTAL} bytes of unfinished messages of all connections")

    def _report(self, peer: str, why: str) -> None:
        self._cut += 1
        if self._cut & (self._cut - 1) == 0:  # at 1, 2, 4, …: a flood cannot fill the log
            self._log.warning("cut off %s: %s (%d so far)", peer, why, self._cut)

    def _weakest(self) -> TcpConnection:
        """The connection to close when there are too many.

        Whoever has sent no message yet; else of those with most connections of one key; of these
        the one that was not heard for longest.
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
    """The near end of a Unix-domain socket, at whose other end is a ZeroMQ socket.

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
            who = pipe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            if _CREDENTIALS.unpack(who)[0] == os.getpid():
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
        made = kept_from_children(socket.socket(family, kind, number))
        try:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if place.is_ipv6:
                made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            made.bind(address)
            made.listen(_BACKLOG)
            made.setblocking(False)
        except BaseException:
            made.close()
            raise
    except (OSError, UnicodeError) as error:  # the latter of a host's name that cannot be one
        why = getattr(error, "strerror", None) or "there is no such host"
        raise EndpointError(
            f"Cannot serve at {place}: {why}. Stop what uses it, or choose another address."
        ) from None
    return made


def _port(listener: socket.socket) -> int:
    return int(listener.getsockname()[1])


def _capacity() -> int:
    """Connections for which there are file descriptors."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST if soft == resource.RLIM_INFINITY else min(MOST, (soft - _RESERVE) // _FILES)


def _user_of(frame: Any) -> str | None:
    with suppress(zmq.ZMQError):
        return str(frame.get("User-Id"))
    return None  # it passed no ZAP handler, which cannot be: it will be refused
