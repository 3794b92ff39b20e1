"""A connection that sends arbitrary frames, checks every reply, and shows frames to people."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import msgpack
import zmq

from protocol.errors import ERROR_CODES, RemoteProtocolError
from protocol.security.keys import ClientKeys
from protocol.sockets.zmq_sockets import connected
from protocol.wire.codec import decode
from protocol.wire.messages import FINAL_REPLIES, parse_reply

Map = dict[str, Any]

GRACE: Final = 0.3
"""Seconds that an answer may come late, although a later request was answered already."""

FINAL: Final = frozenset(kind.TYPE for kind in FINAL_REPLIES)
"""Types of the replies that end a request."""


@dataclass(frozen=True, kw_only=True)
class SuiteSettings:
    """Where the robot is, and what the suite may do.

    Attributes:
        uri: Address of the robot.
        keys: The suite's keys, or ``None``.
        move: Whether the robot may be moved, and other clients be disturbed.
        slow: Whether to try what takes half a minute.
        far: Whether joints may be moved to the ends of their ranges.
        other_keys: Keys of another client, or ``None``.
        shut_down: Makes the robot's daemon end; ``None``: it may not end.
        patience: Seconds to wait for an answer that must come.
        motion: Seconds that one interaction may take.
        clock: Measures the silences that ``slow`` needs, s.
        trace: Called with each message that is sent or received, in words; ``None``: not traced.
    """

    uri: str
    keys: ClientKeys | None = None
    move: bool = False
    slow: bool = False
    far: bool = False
    other_keys: ClientKeys | None = None
    shut_down: Callable[[], object] | None = None
    patience: float = 3.0
    motion: float = 120.0
    clock: Callable[[], float] = time.monotonic
    trace: Callable[[str], None] | None = None


class Failed(Exception):  # noqa: N818 - a result, not an error of ours
    """A clause does not hold.

    Args:
        sentence: What the robot did instead.
        clause: The clause that does not hold, where it is another one than the check tries.
    """

    def __init__(self, sentence: str, clause: str | None = None):
        super().__init__(sentence)
        self.clause = clause


class Skipped(Exception):  # noqa: N818
    """A clause could not be tried; the message says why."""


def expect(condition: bool, sentence: str, clause: str | None = None) -> None:
    """Raises ``Failed`` with the sentence and clause, unless the condition holds."""
    if not condition:
        raise Failed(sentence, clause)


class Unanswered(Failed):
    """A request was not answered, or its final reply is missing."""


class RawConnection:
    """One DEALER connection.

    Args:
        context: ZeroMQ context.
        settings: Where the robot is, and how long to wait.
        keys: The client's keys, or ``None``.
        noted: Where to note what is wrong with an answer that can be used all the same, by clause.
        number: Number of the connection in the trace.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        settings: SuiteSettings,
        keys: ClientKeys | None,
        noted: defaultdict[str, list[str]],
        number: int,
    ):
        self._settings = settings
        self._noted = noted
        self._number = number
        self._sent_ids: Counter[int | None] = Counter()  # ids of what was sent
        self._final_ids: Counter[int | None] = Counter()  # ids of the final replies
        self._unread: list[Map] = []  # replies that nobody has asked for yet
        self.socket = connected(context, zmq.DEALER, settings.uri, keys, {zmq.IMMEDIATE: 1})
        self.socket.setsockopt(zmq.SNDTIMEO, math.ceil(settings.patience * 1000))

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def send(self, message: Mapping[str, Any]) -> None:
        """Sends a map, whatever is in it."""
        self.send_parts(pack(message), ids=(message.get("id"),))

    def send_parts(self, *parts: bytes, ids: Iterable[int | None] = (None,)) -> None:
        """Sends one message of these parts; its answers may have one of these ids, or none."""
        self._sent_ids.update(ids)
        self._trace("sent", parts)
        try:
            self.socket.send_multipart(list(parts))
        except zmq.Again:
            raise Failed("The connection does not come about, or is stuck.") from None

    def reply(self, request_id: int | None, *, patience: float | None = None) -> Map | None:
        """The next reply with this id (``None``: without one), or ``None`` where none comes."""
        return self.first_of((request_id,), patience=patience)

    def first_of(
        self, request_ids: Collection[int | None], *, patience: float | None = None
    ) -> Map | None:
        """The next reply with one of these ids, or ``None`` where none comes."""
        end = time.monotonic() + (self._settings.patience if patience is None else patience)
        while True:
            for reply in self._unread:
                if reply.get("id") in request_ids:
                    self._unread.remove(reply)
                    return reply
            remaining = end - time.monotonic()
            if remaining <= 0 or not self.socket.poll(math.ceil(remaining * 1000)):
                return None
            received = self._receive()
            if not self._came_before(received):
                self._unread.append(received)

    def final(self, request_id: int, *, patience: float | None = None) -> tuple[list[Map], Map]:
        """The replies to a request: those in between, and the final one.

        A request that was accepted may take as long as a motion.
        """
        interim: list[Map] = []
        while (reply := self.answer(request_id, patience=patience)) is not None:
            if reply["type"] in FINAL:
                return interim, reply
            interim.append(reply)
            patience = self._settings.motion
        for stray in self._unread:
            reply_id = stray.get("id")
            sentence = f"An answer ({said(stray)}) has the id {reply_id}, which no request had."
            expect(reply_id is None or reply_id in self._sent_ids, sentence, "7.6")
        raise Unanswered(f"A request (id {request_id}) was not answered to its end.")

    def answer(self, request_id: int, *, patience: float | None = None) -> Map | None:
        """The next reply to a valid request, if any; an error without an id is taken for one."""
        end = time.monotonic() + (self._settings.patience if patience is None else patience)
        while (remaining := end - time.monotonic()) > 0:
            if (reply := self.reply(request_id, patience=min(remaining, self.grace))) is not None:
                return reply
            self.expect_ids()
        return self.reply(request_id, patience=0)

    def expect_ids(self) -> None:
        """Expects that no error without an id has come."""
        stray = self.reply(None, patience=0)
        if stray is not None:
            sentence = f"An error ({said(stray)}) does not carry its id."
            self._noted["2.12"].append(sentence)
            raise Failed(sentence, "2.12")

    @property
    def grace(self) -> float:
        """``GRACE``; less once it is known that errors come without their ids."""
        return GRACE / 20 if self._noted["2.12"] else GRACE

    def _receive(self) -> Map:
        parts = self.socket.recv_multipart()
        self._trace("received", parts)
        expect(len(parts) == 1, f"An answer has {len(parts)} parts instead of one.", "1.1")
        try:
            reply = decode(parts[0])
        except RemoteProtocolError as error:
            raise Failed(f"An answer is no frame: {error}", "2.1") from None
        try:
            parse_reply(reply)
        except RemoteProtocolError as error:
            raise Failed(f"An answer is no valid reply: {error}", "7.1") from None
        if reply["type"] == "error":
            self._judge(reply)
        return reply

    def _trace(self, what: str, parts: Sequence[bytes]) -> None:
        if self._settings.trace is not None:
            self._settings.trace(shown(f"connection {self._number} {what}", parts))

    def _came_before(self, reply: Map) -> bool:
        """Whether a reply is one final reply more than there were requests with its id."""
        reply_id = reply.get("id")
        if reply_id not in self._sent_ids or reply["type"] not in FINAL:
            return False
        if reply_id is None and not self._noted["7.5"]:
            return False  # one that lacks its id, more likely
        self._final_ids[reply_id] += 1
        if self._final_ids[reply_id] <= self._sent_ids[reply_id]:
            return False
        self._noted["7.5"].append(f"An answer ({said(reply)}) came once more")
        return True

    def _judge(self, error: Map) -> None:
        kind = ERROR_CODES.get(error["code"])
        if kind is None:
            raise Failed(f"An error has the code {error['code']:.60}, which is not known.", "8.1")
        if kind.retryable != error["retryable"]:
            self._noted["8.1"].append(f"{error['code']} has retryable {error['retryable']}")


def pack(message: Mapping[str, Any]) -> bytes:
    """A map as MessagePack, without any check."""
    frame: bytes = msgpack.packb(message)
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
    """A short description of a reply, for use in a sentence."""
    if reply is None:
        return "nothing"
    return str(reply["code"]) if reply["type"] == "error" else str(reply["type"])


_LONGEST: Final = 4096
"""Bytes of a frame that are shown, and characters of its decoded content."""


def shown(heading: str, parts: Sequence[bytes]) -> str:
    """Formats a message: for each part a line of hex and a line with the decoded content."""
    lines = []
    for number, part in enumerate(parts, 1):
        title = heading if len(parts) == 1 else f"{heading} part {number} of {len(parts)}"
        lines += [f"{title}: {len(part)} bytes {_cut(part.hex(), 2)}", f"    {_meaning(part)}"]
    return "\n".join(lines)


def _meaning(part: bytes) -> str:
    try:
        return _cut(plain(decode(part)), 1)
    except RemoteProtocolError as error:
        return f"{_leniently(part)}no frame: {error}"


def _leniently(part: bytes) -> str:
    """The content of bytes that are MessagePack but no valid frame."""
    try:
        value = msgpack.unpackb(part, strict_map_key=False)
    except Exception:
        return ""
    return f"{_cut(plain(value), 1)}; " if isinstance(value, Mapping) else ""


def plain(value: Any) -> str:
    """Formats a value as JSON; what JSON cannot express, as Python does."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{plain(key)}: {plain(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(plain, value)) + "]"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return repr(value)


def _cut(text: str, each: int) -> str:
    longest = _LONGEST * each
    return text if len(text) <= longest else f"{text[:longest]}…"
