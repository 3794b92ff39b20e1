"""The ZAP handler (ZeroMQ RFC 27): accepts or refuses the key of each new connection."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

import zmq
from zmq.utils import z85

_ADDRESS: Final = "inproc://zeromq.zap.01"  # where libzmq asks, within one context
_VERSION: Final = b"1.0"
_PARTS: Final = 9  # routing id, delimiter, version, request, domain, address, identity, CURVE, key


class ZapHandler:
    """Accepts the keys that ``admits`` approves; for the thread that polls the sockets.

    Args:
        context: The context of the sockets to be guarded; the handler must exist before they do.
        admits: Whether a key, in Z85, is welcome. It becomes the ``User-Id`` of each frame.
        log: Where to write about strangers.

    Attributes:
        refused: Connections that were turned away.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        admits: Callable[[str], bool],
        log: logging.Logger,
    ):
        self.refused = 0
        self._admits = admits
        self._log = log
        self._socket: zmq.Socket[bytes] = context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.bind(_ADDRESS)

    def fileno(self) -> int:
        """What to poll for reading; after that, ``answer`` has to be called."""
        return int(self._socket.getsockopt(zmq.FD))

    def answer(self, events: int = 0) -> None:
        """Answers all questions that wait."""
        del events
        while True:
            try:
                parts = self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            if len(parts) == _PARTS and parts[2] == _VERSION:
                self._decide(parts)

    def _decide(self, parts: list[bytes]) -> None:
        routing, _, _, request, _, _, peer, mechanism, credentials = parts
        key = z85.encode(credentials).decode() if mechanism == b"CURVE" else ""
        if self._admits(key):
            verdict = [b"200", b"OK", key.encode()]
        else:
            verdict = [b"400", b"this key is not welcome", b""]
            self._report(key, peer)
        self._socket.send_multipart([routing, b"", _VERSION, request, *verdict, b""])

    def _report(self, key: str, peer: bytes) -> None:
        self.refused += 1
        if self.refused & (self.refused - 1) == 0:  # at 1, 2, 4, …: a flood cannot fill the log
            place = peer.decode("ascii", "replace")  # what our socket is named after
            self._log.warning(
                "turned away: unknown key %s from %s (%d so far)", key, place, self.refused
            )
