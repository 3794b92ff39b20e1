"""Addresses of robots, and ZeroMQ sockets with bounded queues, with or without keys."""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import zmq

from protocol.errors import EndpointError
from protocol.security.keys import ClientKeys, KeyPair
from protocol.wire.codec import MAX_MESSAGE

DEFAULT_PORT: Final = 5750
DEFAULT_BIND: Final = f"tcp://127.0.0.1:{DEFAULT_PORT}"

_PATTERN: Final = re.compile(
    r"tcp://(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^\[\]/:\s]+)(:(?P<port>[^/\s]+))?"
)
_WILDCARDS: Final = ("*", "0.0.0.0", "::")


@dataclass(frozen=True)
class Endpoint:
    """A host and a port; port 0 means any free one."""

    host: str
    port: int

    @classmethod
    def parse(cls, uri: str) -> Endpoint:
        """Reads ``tcp://host[:port]``; without a port it is 5750, and ``*`` means any free one.

        Raises:
            EndpointError: ``uri`` is no such address.
        """
        match = _PATTERN.fullmatch(uri)
        if match is None:
            raise EndpointError(
                f"{uri!r} is no address: write tcp://HOST:PORT, like {DEFAULT_BIND}."
            )
        port = match["port"] or str(DEFAULT_PORT)
        if port == "*":
            port = "0"
        if not (port.isascii() and port.isdigit() and int(port) <= 65_535):
            raise EndpointError(f"{uri!r} has the port {port!r}: write a number up to 65535.")
        host = match["host"].strip("[]")
        try:
            host.encode("idna")  # as the system's resolver is asked
        except UnicodeError:
            raise EndpointError(
                f"{uri!r} has the host {host!r}: write 1 to 63 characters between dots."
            ) from None
        return cls(host, int(port))

    @property
    def is_wildcard(self) -> bool:
        """Whether it stands for every address of the computer."""
        return self.host in _WILDCARDS

    @property
    def is_ipv6(self) -> bool:
        """Whether the host is a numerical IPv6 address."""
        return ":" in self.host

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def next_port(self) -> Endpoint:
        """Default endpoint of telemetry: port + 1, or any free one if this port is any free one.

        Raises:
            EndpointError: There is no port above this one.
        """
        if self.port == 65_535:
            raise EndpointError("Port 65535 leaves none for telemetry: name its address as well.")
        return Endpoint(self.host, self.port + 1 if self.port else 0)

    def seen_from(self, uri: str) -> Endpoint:
        """This endpoint for a client that reached the robot at ``uri``: no wildcard host."""
        return Endpoint(Endpoint.parse(uri).host, self.port) if self.is_wildcard else self

    def __str__(self) -> str:
        host = f"[{self.host}]" if self.is_ipv6 else self.host
        return f"tcp://{host}:{self.port or '*'}"


_ZAP_DOMAIN: Final = b"bodyschema"
_OUTGOING: Final = 256  # frames that may wait for a slow peer, then some are dropped
_INCOMING: Final = 16  # frames of one peer that may wait for us; then its TCP connection stalls
_HANDSHAKE: Final = 10_000  # ms in which a connection must show that it speaks ZeroMQ, with a key
_NEVER: Final = 3_600_000  # ms; -1 would throw away what came before the end of a connection


def permitted(uri: str, *, keys: bool, insecure: bool) -> Endpoint:
    """Returns the endpoint to bind to, if that is safe.

    Args:
        uri: ``tcp://host:port``.
        keys: Whether only those with a key can connect.
        insecure: Whether to permit it without keys all the same.

    Raises:
        EndpointError: Anybody on other computers could move the robot.
    """
    place = Endpoint.parse(uri)
    if not (place.is_loopback or keys or insecure):
        raise EndpointError(
            f"Other computers can reach {place}, and without keys anybody there could move the "
            f"robot: give --keys DIR, bind to {DEFAULT_BIND}, or say --insecure."
        )
    return Endpoint("127.0.0.1", place.port) if place.host == "localhost" else place


def serving(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, pair: KeyPair | None, peer: str
) -> zmq.Socket[bytes]:
    """Returns a server's socket for one peer, not connected yet.

    Args:
        context: ZeroMQ context; with keys, a ``ZapHandler`` must exist in it already.
        kind: ROUTER or XPUB.
        pair: The robot's keys; ``None``: everybody may connect.
        peer: Address of the peer, for the ``ZapHandler``.
    """
    options: dict[int, Any] = {
        zmq.SNDHWM: _OUTGOING,
        zmq.RCVHWM: _INCOMING,
        zmq.HANDSHAKE_IVL: _HANDSHAKE,
        zmq.RECONNECT_IVL: _NEVER,
        zmq.ROUTING_ID: peer.encode(),
    }
    if kind == zmq.XPUB:
        options[zmq.XPUB_VERBOSER] = 1
    if pair is not None:
        options |= {
            zmq.CURVE_SERVER: 1,
            zmq.CURVE_SECRETKEY: pair.secret.encode(),
            zmq.ZAP_DOMAIN: _ZAP_DOMAIN,
            zmq.ZAP_ENFORCE_DOMAIN: 1,  # without an answer of the ZAP handler, nobody connects
        }
    return _new_socket(context, kind, options)


def connected(
    context: zmq.Context[zmq.Socket[bytes]],
    kind: int,
    uri: str,
    keys: ClientKeys | None,
    options: Mapping[int, Any],
) -> zmq.Socket[bytes]:
    """Returns a client's socket, connecting; a wrong address is noticed at once, a wrong key not.

    Args:
        context: ZeroMQ context.
        kind: DEALER or SUB.
        uri: ``tcp://host:port``.
        keys: The client's keys, and the robot's public one; ``None``: the robot has no keys.
        options: More socket options.

    Raises:
        EndpointError: The address cannot be connected to.
    """
    place = Endpoint.parse(uri)
    client = unconnected(context, kind, place, keys, options)
    try:
        client.connect(str(place))
    except zmq.ZMQError as error:
        client.close()
        raise EndpointError(f"Cannot connect to {place}: {error.strerror}.") from None
    return client


def unconnected(
    context: zmq.Context[zmq.Socket[bytes]],
    kind: int,
    place: Endpoint,
    keys: ClientKeys | None,
    options: Mapping[int, Any],
) -> zmq.Socket[bytes]:
    """Returns a client's socket with its options, not connected yet."""
    if keys is not None:
        options = dict(options) | {
            zmq.CURVE_SERVERKEY: keys.robot.encode(),
            zmq.CURVE_PUBLICKEY: keys.own.public.encode(),
            zmq.CURVE_SECRETKEY: keys.own.secret.encode(),
        }
    return _new_socket(context, kind, {zmq.IPV6: int(place.is_ipv6), **options})


def _new_socket(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, options: Mapping[int, Any]
) -> zmq.Socket[bytes]:
    new: zmq.Socket[bytes] = context.socket(kind)
    new.setsockopt(zmq.LINGER, 0)
    new.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE)
    for option, value in options.items():
        new.setsockopt(option, value)
    return new


class Waker:
    """A pair of sockets with which any thread ends a poll; poll ``fileno`` for reading."""

    def __init__(self) -> None:
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)

    def fileno(self) -> int:
        """Returns the file descriptor to poll."""
        return self._far.fileno()

    def wake(self) -> None:
        """Ends the present or the next poll; never blocks, harmless after ``close``."""
        try:
            self._near.send(b"\0")
        except OSError:
            return  # full: it will wake anyway; closed: nobody sleeps any more

    def rest(self, events: int = 0) -> None:
        """Discards the calls of ``wake`` so far; the polling thread calls it before it works."""
        del events
        try:
            while self._far.recv(4096):
                pass
        except BlockingIOError:
            return

    def close(self) -> None:
        """Frees the sockets."""
        self._near.close()
        self._far.close()
