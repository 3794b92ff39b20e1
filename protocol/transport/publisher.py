"""The robot's publications."""

from __future__ import annotations

import logging
import selectors
import time
from typing import Final

import zmq

from protocol.security.keys import KeyPair
from protocol.sockets.endpoints import Endpoint
from protocol.sockets.tcp_listener import TcpListener

TOPIC: Final = b"telemetry"

MAX_SUBSCRIBED: Final = 1024
"""Bytes of subscriptions, and of what ends them, that one connection may send."""

_WINDOW: Final = 1 << 18  # bytes: heartbeats of ZeroMQ, which nobody sees, for most of an hour
_BUDGET: Final = 0.002  # s of one turn
_CHUNK: Final = MAX_SUBSCRIBED  # bytes of one turn: ZeroMQ keeps fifty times as much of each


class Publisher(TcpListener):
    """Publishes at one address.

    Args:
        context: The context; with keys, a ``ZapHandler`` must stand there already.
        selector: Where to register what is waited for.
        place: Where; port 0: any free one.
        pair: The robot's keys, or ``None``.
        share: Of the connections that a server may have, those that may listen.
        log: Where to write about listeners that were cut off.

    Attributes:
        place: Where it really is.

    Raises:
        EndpointError: The address cannot be bound.
    """

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
        super().__init__(
            context,
            selector,
            zmq.XPUB,
            place,
            pair,
            window=_WINDOW,
            chunk=_CHUNK,
            share=share,
            log=log,
        )

    def listen(self) -> None:
        """Receives subscriptions, which ZeroMQ applies; disconnects peers that send too many."""
        for peer, _, _ in self.arrivals(time.monotonic() + _BUDGET):
            if self.received(peer) > MAX_SUBSCRIBED:
                self.cut(peer, f"over {MAX_SUBSCRIBED} bytes of subscriptions")

    def publish(self, frame: bytes) -> None:
        """Sends to all who listen; never waits."""
        self.broadcast([TOPIC, frame])
