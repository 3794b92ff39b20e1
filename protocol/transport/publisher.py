"""The robot's publications."""

from __future__ import annotations

import time
from typing import Final

import zmq

from protocol.sockets.tcp_listener import TcpListener

TOPIC: Final = b"telemetry"

MAX_SUBSCRIBED: Final = 1024
"""Bytes of subscriptions, and of what ends them, that one connection may send."""

_BUDGET: Final = 0.002  # s of one turn


class Publisher(TcpListener):
    """Publishes at one address."""

    KIND = zmq.XPUB
    WINDOW = 1 << 18  # heartbeats of ZeroMQ, which nobody sees, for most of an hour
    CHUNK = MAX_SUBSCRIBED  # ZeroMQ keeps fifty times as much of each

    def listen(self) -> None:
        """Receives subscriptions, which ZeroMQ applies; disconnects peers that send too many."""
        for peer, _, _ in self.arrivals(time.monotonic() + _BUDGET):
            if self.received(peer) > MAX_SUBSCRIBED:
                self.cut(peer, f"over {MAX_SUBSCRIBED} bytes of subscriptions")

    def publish(self, frame: bytes) -> None:
        """Sends to all who listen; never waits."""
        self.broadcast([TOPIC, frame])
