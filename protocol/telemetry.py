"""Listening to what a robot publishes about itself."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from types import TracebackType
from typing import Final, Self

import zmq

from protocol.codec import MAX_MESSAGE, decode
from protocol.endpoints import Endpoint
from protocol.errors import EndpointError, RemoteProtocolError, RobotUnreachableError
from protocol.messages import Telemetry, parse_telemetry

TOPIC: Final = b"telemetry"

_QUEUE: Final = 16


class TelemetrySubscriber:
    """Receives publications; for one thread.

    Subscribe before you need it: what is published before the connection stands is lost.

    Args:
        endpoint: ``RobotClient.telemetry_endpoint``.
        context: ZeroMQ context; default: its own.
        clock: The transport clock, s.

    Attributes:
        garbage: Publications that were no valid telemetry, skipped.

    Raises:
        EndpointError: The address cannot be connected to.
    """

    def __init__(
        self,
        endpoint: str,
        *,
        context: zmq.Context[zmq.Socket[bytes]] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ):
        place = Endpoint.parse(endpoint)
        self.garbage = 0
        self._endpoint = str(place)
        self._clock = clock
        self._own_context = context is None
        self._context = context if context is not None else zmq.Context()
        self._socket: zmq.Socket[bytes] = self._context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RCVHWM, _QUEUE)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE)
        self._socket.setsockopt(zmq.IPV6, int(place.is_ipv6))
        self._socket.setsockopt(zmq.SUBSCRIBE, TOPIC)
        try:
            self._socket.connect(self._endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise EndpointError(f"Cannot subscribe to {endpoint}: {error.strerror}.") from None

    def next(self, timeout: float) -> Telemetry:
        """The newest publication not yet returned; waits up to ``timeout`` s for one.

        Raises:
            RobotUnreachableError: None came.
        """
        end = self._clock() + timeout
        newest: Telemetry | None = None
        while newest is None:
            patience = math.ceil(max(0.0, end - self._clock()) * 1000)
            if not self._socket.poll(patience):
                raise RobotUnreachableError(
                    f"Nothing was published at {self._endpoint} for {timeout:g} s."
                )
            newest = self._drain()
        return newest

    def close(self) -> None:
        """Closes the connection; idempotent."""
        self._socket.close()
        if self._own_context:
            self._context.destroy(linger=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

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
