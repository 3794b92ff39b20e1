"""Diagnoses why nobody answers at an address, step by step.

A client that gets no answer cannot know why: ZeroMQ connects again and again without a word. This
module knocks by hand instead. It reads the greeting with which every ZeroMQ peer begins, which
tells whether keys are asked for, and watches one handshake. It sends the robot no request.
"""

from __future__ import annotations

import math
import socket
import sys
import time
from dataclasses import dataclass
from enum import Enum
from typing import Final

import zmq

from protocol.security.keys import ClientKeys
from protocol.sockets.zmq_sockets import Endpoint, unconnected

_GREETING: Final = 64  # bytes of ZMTP 3: signature 10, version 2, mechanism 20, as-server, filler
_SIGNATURE: Final = b"\xff" + bytes(8) + b"\x7f"
_NULL: Final = b"NULL"
_CURVE: Final = b"CURVE"
_EVENTS: Final = (
    zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
)


class Obstacle(Enum):
    """What keeps a client from a robot."""

    NO_HOST = "no host"  # the name is unknown, or no network leads there
    NO_LISTENER = "no listener"  # the computer is there, and nothing listens at the port
    NO_ANSWER = "no answer"  # nothing comes back: switched off, or a firewall
    NO_ZEROMQ = "no ZeroMQ"  # something else listens there
    KEYS_WANTED = "keys wanted"  # the robot asks for keys, the client has none
    NO_KEYS_THERE = "no keys there"  # the client has keys, the robot does without
    OTHER_ROBOT = "other robot"  # what is there does not have the key that the client expects
    UNKNOWN_KEY = "unknown key"  # the robot does not know the client's key


@dataclass(frozen=True)
class Diagnosis:
    """The result of a probe; without an obstacle, the connection itself is fine."""

    obstacle: Obstacle | None
    sentence: str

    @property
    def fine(self) -> bool:
        """Whether nothing keeps the client from connecting."""
        return self.obstacle is None


def probe(uri: str, keys: ClientKeys | None = None, *, patience: float = 2.0) -> Diagnosis:
    """Finds out how far a connection to a robot comes.

    Args:
        uri: ``tcp://host:port``.
        keys: The client's keys, if any.
        patience: Seconds to wait at each of the two steps.

    Raises:
        EndpointError: ``uri`` is no address.
    """
    place = Endpoint.parse(uri)
    mechanism = _knock(place, patience)
    if isinstance(mechanism, Diagnosis):
        return mechanism
    if mechanism not in (_NULL, _CURVE):
        return Diagnosis(
            Obstacle.NO_ZEROMQ, f"What listens at {place} is no robot daemon: it speaks no ZeroMQ."
        )
    if mechanism != (_NULL if keys is None else _CURVE):
        return _mismatch(place, keys)
    return _shake_hands(place, keys, patience)


def _knock(place: Endpoint, patience: float) -> bytes | Diagnosis:
    """The security mechanism in the peer's greeting, or why there is none."""
    try:
        mechanism = _mechanism(place, patience)
    except ConnectionRefusedError:
        obstacle = Obstacle.NO_LISTENER
        sentence = f"Nothing listens at {place}: no robot daemon runs."
    except TimeoutError:
        obstacle = Obstacle.NO_ANSWER
        sentence = (
            f"{place} does not answer: no robot daemon runs there, it is switched off, or a "
            "firewall is in between."
        )
    except OSError as error:
        obstacle = Obstacle.NO_HOST
        sentence = f"{place} cannot be reached: {error.strerror or error}."
    else:
        if mechanism is not None:
            return mechanism
        obstacle = Obstacle.NO_ANSWER
        sentence = (
            f"{place} accepts connections, but says nothing: it is no robot daemon, or it hangs."
        )
    return Diagnosis(obstacle, sentence)


def _mechanism(place: Endpoint, patience: float) -> bytes | None:
    """The security mechanism in the peer's greeting; empty: no such greeting; ``None``: silence.

    Raises:
        OSError: There is no connection.
    """
    end = time.monotonic() + patience
    opening = _SIGNATURE + b"\x03\x00"  # no mechanism: at a wrong one, a peer hangs up unanswered
    with socket.create_connection((place.host, place.port), timeout=patience) as stream:
        greeting = b""
        while len(greeting) < _GREETING:
            stream.settimeout(max(end - time.monotonic(), 0.001))
            try:
                if not greeting:
                    stream.sendall(opening)
                data = stream.recv(_GREETING - len(greeting))
            except TimeoutError:
                return None
            except OSError:
                data = b""
            if not data:
                return b""
            greeting += data
            if greeting[0] != _SIGNATURE[0] or (len(greeting) > 9 and greeting[9] != _SIGNATURE[9]):
                return b""
    return greeting[12:32].rstrip(b"\0")


def _shake_hands(place: Endpoint, keys: ClientKeys | None, patience: float) -> Diagnosis:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    try:
        dealer = unconnected(context, zmq.DEALER, place, keys, {zmq.IMMEDIATE: 1})
        watch = dealer.get_monitor_socket(_EVENTS)  # before there is anything to be missed
        try:
            dealer.connect(str(place))
            ready = watch.poll(math.ceil(patience * 1000))
            # The event stands first; pyzmq's own reader of it would load asyncio and TLS, 5 MB.
            event = int.from_bytes(watch.recv_multipart()[0][:2], sys.byteorder) if ready else None
        finally:
            dealer.disable_monitor()
            watch.close()
    finally:
        context.destroy(linger=0)
    if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
        return Diagnosis(None, f"{place} can be reached.")
    if event == zmq.EVENT_HANDSHAKE_FAILED_AUTH:
        return Diagnosis(
            Obstacle.UNKNOWN_KEY,
            f"The robot at {place} does not know this key: its owner must add it there, with "
            "robotd keys add.",
        )
    if keys is not None and event is not None:
        return Diagnosis(
            Obstacle.OTHER_ROBOT,
            f"What is at {place} does not have the key that is known here as the robot's: it is "
            "another robot, or it got a new key.",
        )
    return Diagnosis(Obstacle.NO_ANSWER, f"{place} accepts connections, but does not answer.")


def _mismatch(place: Endpoint, keys: ClientKeys | None) -> Diagnosis:
    if keys is None:
        return Diagnosis(
            Obstacle.KEYS_WANTED,
            f"The robot at {place} asks for a key: make one with robotd keys new, let the robot's "
            "owner add it, and give --keys DIR.",
        )
    return Diagnosis(
        Obstacle.NO_KEYS_THERE,
        f"The robot at {place} does without keys, so nothing shows that it is the one that is "
        "known here: leave --keys out, if that is meant.",
    )
