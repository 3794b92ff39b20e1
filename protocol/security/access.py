"""Access control: the list of known clients, read again whenever it has changed.

ZeroMQ asks about a key only when a connection is made, so a connection says nothing about whether
its key is still welcome. Every request is therefore checked against the list as it is at that
moment. A list that cannot be read any more lets nobody do anything but stop the robot.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from typing import Final

import zmq
from zmq.utils import z85

from protocol.errors import KeysError, RobotError
from protocol.rules.control import MAY, Role
from protocol.security.keys import ROBOT, KeyDirectory, KnownPeer
from protocol.wire.messages import Heartbeat, Hello, Request, Stop

_MEND_ADVICE: Final = "Ask the robot's owner to mend it."
_STOP_REQUESTS: Final = (Hello, Heartbeat, Stop)  # what it takes to stop the robot with our client
_RETRY_INTERVAL: Final = 0.5  # s between two looks at a list that cannot be read


class Access:
    """The clients that a key directory knows, by key.

    Args:
        keys: The robot's key directory.
        log: Log for changes of the list, and for faults in it.

    Attributes:
        version: Number that grows with each change of the list.

    Raises:
        KeysError: The list cannot be read.
    """

    def __init__(self, keys: KeyDirectory, log: logging.Logger):
        self._keys = keys
        self._log = log
        self._stamp = keys.stamp()
        self._listed = bool(self._stamp)  # an editor may move the list away for a moment
        self._peers = self._read()
        self._flaw: str | None = None
        self._look_at = math.inf  # monotonic, s; finite while there is a flaw
        self.version = 0
        if not self._peers:
            log.warning("no client is known in %s: nobody can connect", keys.path)

    def refresh(self) -> int:
        """Reads the list again if it has changed; returns ``version``."""
        stamp = self._keys.stamp()
        if stamp == self._stamp and time.monotonic() < self._look_at:
            return self.version
        self._stamp = stamp
        try:
            peers = self._read()
        except KeysError as error:
            if self._flaw != str(error):
                self._log.error("%s Until it is mended, clients may only stop the robot.", error)
                self.version += 1
            self._flaw = str(error)
            self._look_at = time.monotonic() + _RETRY_INTERVAL
            return self.version
        if peers != self._peers or self._flaw is not None:
            names = ", ".join(f"{peer.name} ({peer.role})" for peer in peers.values())
            self._log.info("the list of clients has changed: %s", names or "nobody")
            self.version += 1
        self._peers, self._flaw, self._listed = peers, None, bool(stamp)
        self._look_at = math.inf
        return self.version

    def admits(self, key: str) -> bool:
        """Whether somebody with this key may connect."""
        self.refresh()
        return key in self._peers

    def name_of(self, user: str) -> str:
        """The name of whoever has this key; of a stranger the key itself."""
        peer = self._peers.get(user)
        return user if peer is None else peer.name

    def role_of(self, user: str | None) -> Role | None:
        """The role of whoever has this key; while the list cannot be read, at most viewer."""
        peer = self._peers.get(user or "")
        if peer is None:
            return None
        return Role(peer.role) if self._flaw is None else Role.VIEWER

    def authorise(self, user: str | None, request: Request) -> None:
        """Refuses a request that the user's role does not allow.

        Args:
            user: The key with which the connection was made.
            request: The request to check.

        Raises:
            RobotError: ``unauthorised``.
        """
        self.refresh()
        peer = self._peers.get(user or "")
        if peer is None:
            raise RobotError("unauthorised", "The robot does not know this key (any more).")
        if self._flaw is not None and not isinstance(request, _STOP_REQUESTS):
            raise RobotError(
                "unauthorised", "The robot cannot read its list of clients.", advice=_MEND_ADVICE
            )
        if request.TYPE not in MAY[Role(peer.role)]:
            raise RobotError(
                "unauthorised", f"{peer.name} is a {peer.role} here and may not {request.TYPE}."
            )

    def _read(self) -> Mapping[str, KnownPeer]:
        peers = self._keys.known(must_exist=self._listed)
        return {peer.public: peer for peer in peers if peer.role != ROBOT}


_ADDRESS: Final = "inproc://zeromq.zap.01"  # where libzmq asks, within one context
_VERSION: Final = b"1.0"
_PARTS: Final = 9  # routing id, delimiter, version, request, domain, address, identity, CURVE, key


class ZapHandler:
    """Accepts the keys that ``admits`` approves; for the thread that polls the sockets.

    Args:
        context: The context of the sockets to be guarded; the handler must exist before they do.
        admits: Whether a key, in Z85, is welcome; the key becomes the ``User-Id`` of each frame.
        log: Log for connections that were refused.

    Attributes:
        refused: Number of connections that were refused.
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
        """File descriptor to poll for reading; after that, ``answer`` has to be called."""
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
            place = peer.decode("ascii", "replace")  # the routing id that our socket got
            self._log.warning(
                "turned away: unknown key %s from %s (%d so far)", key, place, self.refused
            )
