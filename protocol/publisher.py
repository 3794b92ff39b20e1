"""The robot's publications."""

from __future__ import annotations

import logging
import math
import time
from typing import Final

import zmq

from protocol.endpoints import Endpoint
from protocol.errors import EndpointError
from protocol.keys import KeyPair
from protocol.sockets import listening, real_endpoint

TOPIC: Final = b"telemetry"

_MOMENT: Final = 3.0  # s after which an address that cannot be had again is worth a line


class Publisher:
    """Publishes at one address, to whoever was let in.

    Args:
        context: The context; with keys, a ``Gate`` must stand there already.
        place: Where; port 0: any free one.
        pair: The robot's keys, or ``None``.
        log: Where to write that the address was lost.

    Attributes:
        place: Where it really is.

    Raises:
        EndpointError: The address cannot be bound.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        place: Endpoint,
        pair: KeyPair | None,
        log: logging.Logger,
    ):
        self._context = context
        self._pair = pair
        self._log = log
        self._complain_at = math.inf
        self._socket: zmq.Socket[bytes] | None = listening(context, zmq.PUB, place, pair)
        self.place = real_endpoint(self._socket, place)

    def publish(self, frame: bytes) -> None:
        """Sends to all who listen; never waits."""
        if self._socket is None:
            self._reopen()
        if self._socket is not None:
            self._socket.send_multipart([TOPIC, frame], zmq.NOBLOCK)

    def renew(self) -> None:
        """Drops all who listen: those who are still welcome connect again by themselves."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self._complain_at = time.monotonic() + _MOMENT

    def _reopen(self) -> None:
        try:
            self._socket = listening(self._context, zmq.PUB, self.place, self._pair)
        except EndpointError as error:  # ZeroMQ frees an address a moment after closing it
            if time.monotonic() > self._complain_at:
                self._complain_at = math.inf
                self._log.error("no telemetry: %s", error)
