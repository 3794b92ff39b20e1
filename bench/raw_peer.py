"""A ZMTP 3 peer on a plain socket, which does what ZeroMQ's own sockets would not.

The NULL mechanism only: without keys anybody can do what is done here; with keys it takes a known
one.
"""

from __future__ import annotations

import ctypes
import socket
import struct
from collections.abc import Iterator

from protocol.sockets.zmq_sockets import Endpoint

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
MORE, LONG, COMMAND = 1, 2, 4


class RawPeer:
    """A connection on which the handshake has been sent.

    Args:
        endpoint: The robot's.
        kind: What it claims to be.
        identity: The routing id that it claims.
    """

    def __init__(self, endpoint: str, kind: bytes = b"DEALER", identity: bytes = b""):
        place = Endpoint.parse(endpoint)
        self.socket = socket.create_connection((place.host, place.port), timeout=10)
        ready = b"\x05READY" + _property(b"Socket-Type", kind) + _property(b"Identity", identity)
        self.socket.sendall(GREETING + frame(ready, COMMAND))
        heard = self._take(len(GREETING))
        assert heard[:1] == b"\xff", heard
        self.receive()  # its READY

    def send(self, body: bytes, flags: int = 0) -> None:
        """Sends one frame."""
        self.socket.sendall(frame(body, flags))

    def receive(self) -> bytes:
        """The body of the next frame."""
        flags = self._take(1)[0]
        size = struct.unpack(">Q", self._take(8))[0] if flags & LONG else self._take(1)[0]
        return self._take(size)

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def _take(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            piece = self.socket.recv(size - len(data))
            if not piece:
                raise ConnectionError("the robot hung up")
            data += piece
        return data


def frame(body: bytes, flags: int = 0) -> bytes:
    """One frame as it goes over TCP."""
    if len(body) > 255:
        return bytes([flags | LONG]) + struct.pack(">Q", len(body)) + body
    return bytes([flags, len(body)]) + body


def guessed_identities(*, sockets: int, connections: int, first: int = 0) -> Iterator[bytes]:
    """What ZeroMQ would call the next peers of a process that never called ``srand``.

    A ROUTER counts its peers from a number of two calls of ``rand``.

    Args:
        sockets: For how many numbers drawn before it.
        connections: For how many peers each.
        first: How many peers have been named before.
    """
    libc = ctypes.CDLL(None)
    libc.srand(1)
    for _ in range(sockets):
        low, high = libc.rand(), libc.rand()
        for number in range(first, first + connections):
            yield b"\0" + struct.pack(">I", ((low | high << 31) + number) & 0xFFFFFFFF)


def _property(name: bytes, value: bytes) -> bytes:
    return bytes([len(name)]) + name + struct.pack(">I", len(value)) + value
