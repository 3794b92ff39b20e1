"""What a robot publishes about itself, and how to listen to it."""

from __future__ import annotations

import math
import os
import time
from typing import Final

import zmq

from protocol.errors import RemoteProtocolError, RobotUnreachableError
from protocol.security.keys import KeyDirectory
from protocol.sockets.tcp_listener import TcpListener
from protocol.sockets.zmq_sockets import Endpoint, connected
from protocol.system.process import Closable
from protocol.wire.codec import decode
from protocol.wire.messages import Telemetry, parse_telemetry

_QUEUE: Final = 16  # publications that may wait for us


class TelemetrySubscriber(Closable):
    """Receives publications; one thread may use it.

    Subscribe before you need it: what is published before the connection stands is lost.

    Args:
        endpoint: ``RobotClient.telemetry_endpoint``.
        keys: The key directory, where the robot asks for keys.

    Attributes:
        garbage: Number of publications that were no valid telemetry, and were skipped.

    Raises:
        EndpointError: The address cannot be connected to.
        KeysError: The key directory cannot be used.
    """

    def __init__(self, endpoint: str, *, keys: str | os.PathLike[str] | None = None):
        self.garbage = 0
        self._endpoint = str(Endpoint.parse(endpoint))
        client_keys = KeyDirectory(keys).client_keys() if keys is not None else None
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        try:
            self._socket = connected(
                self._context,
                zmq.SUB,
                self._endpoint,
                client_keys,
                {zmq.RCVHWM: _QUEUE, zmq.SUBSCRIBE: TOPIC},
            )
        except BaseException:
            self._context.destroy(linger=0)
            raise

    def next(self, timeout: float) -> Telemetry:
        """The newest publication not yet returned; waits up to ``timeout`` s for one.

        Raises:
            RobotUnreachableError: No publication came.
        """
        end = time.monotonic() + timeout
        newest: Telemetry | None = None
        while newest is None:
            patience = math.ceil(max(0.0, end - time.monotonic()) * 1000)
            if not self._socket.poll(patience):
                raise RobotUnreachableError(
                    f"Nothing was published at {self._endpoint} for {timeout:g} s."
                )
            newest = self._drain()
        return newest

    def close(self) -> None:
        """Closes the connection; idempotent."""
        self._socket.close()
        self._context.destroy(linger=0)

    def _drain(self) -> Telemetry | None:
        newest: Telemetry | None = None
        while True:
            try:
                frames = self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return newest
            try:
                newest = parse_telemetry(decode(frames[-1]))
            except RemoteProtocolError:
                self.garbage += 1


TOPIC: Final = b"telemetry"

MAX_SUBSCRIBED: Final = 1024
"""Most bytes of subscriptions and unsubscriptions that one connection may send."""

_BUDGET: Final = 0.002  # s for subscriptions in one turn


class Publisher(TcpListener):
    """Publishes at one address."""

    KIND = zmq.XPUB
    WINDOW = 1 << 18  # room for ZeroMQ's heartbeats, which are no messages, for most of an hour
    CHUNK = MAX_SUBSCRIBED  # ZeroMQ keeps fifty times as much of each

    def listen(self) -> None:
        """Receives subscriptions, which ZeroMQ applies; disconnects peers that send too many."""
        for peer, _, _ in self.arrivals(time.monotonic() + _BUDGET):
            if self.received(peer) > MAX_SUBSCRIBED:
                self.cut(peer, f"over {MAX_SUBSCRIBED} bytes of subscriptions")

    def publish(self, frame: bytes) -> None:
        """Sends a frame to all subscribers; never waits."""
        self.broadcast([TOPIC, frame])
