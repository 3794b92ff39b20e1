"""A raw connection: sends anything, and takes nothing for granted."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

import msgpack
import zmq

from protocol.codec import decode
from protocol.conformance.expectations import Broken
from protocol.errors import ERROR_CODES, RemoteProtocolError
from protocol.keys import ClientKeys
from protocol.messages import FINAL_REPLIES, parse_reply
from protocol.sockets import connected

Map = dict[str, Any]

GRACE: Final = 0.3
"""Seconds that an answer may come late, although a later request was answered already."""

_FINAL: Final = frozenset(kind.TYPE for kind in FINAL_REPLIES)


class Line:
    """One DEALER connection.

    Args:
        context: ZeroMQ context.
        uri: Where the robot is.
        keys: Who connects, or ``None``.
        patience: Seconds to wait for an answer that must come.
        wrong_errors: Where to note errors that are not as in the table of ``SPEC.md``.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        uri: str,
        keys: ClientKeys | None,
        patience: float,
        wrong_errors: list[str],
    ):
        self.patience = patience
        self._wrong_errors = wrong_errors
        self._heard: list[Map] = []  # replies that nobody has asked for yet
        self.socket = connected(context, zmq.DEALER, uri, keys, {zmq.IMMEDIATE: 1})
        self.socket.setsockopt(zmq.SNDTIMEO, math.ceil(patience * 1000))

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def send(self, found: Mapping[str, Any]) -> None:
        """Sends a map, whatever is in it."""
        self.send_parts(pack(found))

    def send_parts(self, *parts: bytes) -> None:
        """Sends one message of these parts."""
        try:
            self.socket.send_multipart(list(parts))
        except zmq.Again:
            raise Broken("The connection does not come about, or is stuck.") from None

    def reply(self, request_id: int | None, *, patience: float | None = None) -> Map | None:
        """The next reply with this id (``None``: without one), or ``None`` where none comes."""
        end = time.monotonic() + (self.patience if patience is None else patience)
        while True:
            for found in self._heard:
                if found.get("id") == request_id:
                    self._heard.remove(found)
                    return found
            left = end - time.monotonic()
            if left <= 0 or not self.socket.poll(math.ceil(left * 1000)):
                return None
            self._heard.append(self._receive())

    def final(self, request_id: int, *, patience: float | None = None) -> tuple[list[Map], Map]:
        """The replies to a request: those in between, and the final one."""
        between: list[Map] = []
        while (found := self.reply(request_id, patience=patience)) is not None:
            if found["type"] in _FINAL:
                return between, found
            between.append(found)
        raise Broken(f"A request (id {request_id}) was not answered to its end.")

    def _receive(self) -> Map:
        parts = self.socket.recv_multipart()
        if len(parts) != 1:
            raise Broken(f"An answer has {len(parts)} parts instead of one.")
        try:
            found = decode(parts[0])
            parse_reply(found)
        except RemoteProtocolError as error:
            raise Broken(f"An answer is no valid reply: {error}") from None
        if found["type"] == "error":
            self._judge(found)
        return found

    def _judge(self, error: Map) -> None:
        kind = ERROR_CODES.get(error["code"])
        if kind is None:
            self._wrong_errors.append(f"{error['code']} is no code of the table")
        elif kind.retryable != error["retryable"]:
            self._wrong_errors.append(f"{error['code']} has retryable {error['retryable']}")


def pack(found: Mapping[str, Any]) -> bytes:
    """A map as MessagePack, without any check."""
    frame: bytes = msgpack.packb(found)
    return frame


def pack_wide(value: Any) -> bytes:
    """A value in the longest encoding that MessagePack has for it, keys in reverse order."""
    if isinstance(value, bool) or value is None:
        return pack_small(value)
    if isinstance(value, int):
        return b"\xd3" + value.to_bytes(8, "big", signed=True)
    if isinstance(value, str):
        data = value.encode()
        return b"\xdb" + len(data).to_bytes(4, "big") + data
    if isinstance(value, Mapping):
        items = [pack_wide(item) for pair in reversed(list(value.items())) for item in pair]
        return b"\xdf" + len(value).to_bytes(4, "big") + b"".join(items)
    if isinstance(value, Sequence):
        return b"\xdd" + len(value).to_bytes(4, "big") + b"".join(map(pack_wide, value))
    return pack_small(value)


def pack_small(value: Any) -> bytes:
    """A value on its own; floats take four bytes."""
    data: bytes = msgpack.packb(value, use_single_float=True)
    return data


def said(reply: Mapping[str, Any] | None) -> str:
    """A reply in a few words, for a sentence."""
    if reply is None:
        return "nothing"
    return str(reply["code"]) if reply["type"] == "error" else str(reply["type"])
