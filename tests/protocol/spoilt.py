"""Servers that break one rule each, for the conformance suite to find out.

A ``Fault`` changes frames on their way in or out, or spoils a server that was just made. Everything
else is the healthy server, so what the suite finds is that one fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import msgpack
import pytest
import zmq

from protocol import core, outcomes, publisher, sockets
from protocol.codec import decode
from protocol.core import Action, Send, ServerCore
from protocol.errors import RemoteProtocolError, RobotError
from protocol.lease import Lease
from protocol.messages import Request, parse_request
from protocol.outcomes import Client, Clients, Outcome
from protocol.robot import Robot
from protocol.server import Server

Map = dict[str, Any]
Change = Callable[[Map], Map]
Patch = pytest.MonkeyPatch


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One broken rule.

    Attributes:
        request: What becomes of a message's parts on the way in; ``None``: it is lost.
        reply: What becomes of a frame on the way out: messages of parts.
        spoil: What is done to a server that was just made.
        patch: What is done to the modules, before.
        move: Whether it shows only when the robot moves.
    """

    request: Callable[[list[bytes]], list[bytes] | None] = lambda parts: parts
    reply: Callable[[bytes], list[list[bytes]]] = lambda frame: [[frame]]
    spoil: Callable[[Server], None] = lambda server: None
    patch: Callable[[Patch], None] = lambda patch: None
    move: bool = False


class SpoiltServer(Server):
    """A server with a fault."""

    def __init__(self, robot: Robot, fault: Fault, **options: Any):
        super().__init__(robot, **options)
        self._fault = fault
        fault.spoil(self)

    def _receive(self) -> tuple[list[bytes], str | None]:
        (peer, *parts), user = super()._receive()
        changed = self._fault.request(parts)
        if changed is None:
            raise zmq.Again
        return [peer, *changed], user

    def _send(self, action: Send) -> None:
        for parts in self._fault.reply(action.frame):
            self._router.send_multipart([action.peer, *parts])


# --- ways to change frames ------------------------------------------------------------------------


def loosely(frame: bytes) -> Map:
    try:
        found = msgpack.unpackb(frame, strict_map_key=False)
    except Exception:
        return {}
    return found if isinstance(found, dict) else {}


def replies(kind: str, change: Change) -> Fault:
    """Changes the replies of one type."""

    def reply(frame: bytes) -> list[list[bytes]]:
        found = decode(frame)
        return [[msgpack.packb(change(found))] if found["type"] == kind else [frame]]

    return Fault(reply=reply)


def requests(kind: str, change: Change) -> Fault:
    """Changes the requests of one type."""

    def request(parts: list[bytes]) -> list[bytes]:
        found = loosely(parts[-1])
        return [msgpack.packb(change(found))] if found.get("type") == kind else parts

    return Fault(request=request)


def loses(condition: Callable[[Map], bool]) -> Fault:
    """Loses some requests."""
    return Fault(request=lambda parts: None if condition(loosely(parts[-1])) else parts)


def twice(condition: Callable[[Map], bool]) -> Callable[[Map], bool]:
    """Whether a request with this id was there before, of those that fulfil the condition."""
    seen: set[Any] = set()

    def again(found: Map) -> bool:
        if not condition(found):
            return False
        known = found.get("id") in seen
        seen.add(found.get("id"))
        return known

    return again


def parses(check: Callable[[Mapping[str, Any]], str | None]) -> Fault:
    """Refuses what a check finds fault with."""

    def spoilt(found: Mapping[str, Any]) -> Request:
        if (flaw := check(found)) is not None:
            raise RemoteProtocolError(flaw, request_id=found.get("id"))
        return parse_request(found)

    return Fault(patch=lambda patch: patch.setattr(core, "parse_request", spoilt))


def decodes(lenient: Callable[[bytes], Any]) -> Fault:
    """Decodes frames by something else, which may raise anything."""

    def spoilt(frame: bytes) -> Any:
        try:
            return decode(frame)
        except RemoteProtocolError:
            found = lenient(frame)
            if isinstance(found, dict) and isinstance(found.get("type"), str):
                return found
            raise

    return Fault(patch=lambda patch: patch.setattr(core, "decode", spoilt))


def patches(target: Any, name: str, value: Any, **options: Any) -> Fault:
    """Replaces something in our modules."""
    return Fault(patch=lambda patch: patch.setattr(target, name, value), **options)


def _first_of_several(frame: bytes) -> Any:
    unpacker = msgpack.Unpacker()
    unpacker.feed(frame)
    return unpacker.unpack()


def _text_of_bytes(frame: bytes) -> Any:
    def plain(value: Any) -> Any:
        return value.decode("latin-1") if isinstance(value, bytes) else value

    found = loosely(frame)
    return {plain(key): plain(value) for key, value in found.items()}


def _short(found: Map) -> Map:
    """A frame without the padding that made it too long."""
    return {key: value for key, value in found.items() if key != "padding"}


# --- ways to spoil our modules --------------------------------------------------------------------


def _new_session_each_time(self: Clients, name: str, **options: Any) -> Client:
    found = _welcome(self, name, **options)
    found.session = self._token()
    return found


def _any_session(self: Clients, name: str, *, session: str, user: str | None) -> Client:
    client = self._clients.get(name)
    return _find(self, name, session=client.session if client else session, user=user)


def _unknown_session_uses_ids_up(
    self: Clients, name: str, *, session: str, user: str | None
) -> Client:
    client = self._clients.get(name)
    if client is not None and client.session != session:
        client.highest += 1000
    return _find(self, name, session=session, user=user)


def _nothing_is_remembered(self: Client, request: Request) -> Outcome | None:
    return None


def _nothing_expires(self: Client, request: Request) -> Outcome | None:
    return _recall(self, request) if request.id in self.outcomes else None


def _refusals_are_forgotten(self: Client, request: Request) -> Outcome | None:
    known = self.outcomes.get(request.id)
    if known is not None and known.reply is not None and decode(known.reply)["type"] == "error":
        del self.outcomes[request.id]
        return None
    return _recall(self, request)


def _once_only(
    self: ServerCore, client: Client, outcome: Outcome, now: float
) -> list[Action]:
    if self._lease.holder == client.name:
        raise RobotError("held", f"{client.name} holds the robot.")
    return _acquire(self, client, outcome, now)


def _last_come_first_served(
    self: ServerCore, client: Client, outcome: Outcome, now: float
) -> list[Action]:
    self._lease.free()
    return _acquire(self, client, outcome, now)


def _controller_may_go(self: Clients, name: str, **options: Any) -> Client:
    return _welcome(self, name, **(options | {"keep": None}))


def _never_freed(self: Lease, now: float) -> list[Any]:
    return []


_welcome, _find, _recall = Clients.welcome, Clients.find, Client.recall
_acquire = ServerCore._acquire


def _first_connection_only() -> Fault:
    """Answers go to where a request came from first."""
    first: dict[int, bytes] = {}

    class Faithful(SpoiltServer):
        pass

    def spoil(server: Server) -> None:
        take, send = server._receive, server._send

        def receive() -> Any:
            parts, user = take()
            found = loosely(parts[-1])
            if found.get("type") == "read":
                first.setdefault(found["id"], parts[0])
            return parts, user

        def answer(action: Send) -> None:
            reply = decode(action.frame)
            peer = action.peer
            if reply["type"] == "observation":
                peer = first.get(reply["id"], peer)
            send(replace(action, peer=peer))

        server.__dict__.update(_receive=receive, _send=answer)

    return Fault(spoil=spoil)


def _slow_telemetry(server: Server) -> None:
    server._period *= 3


def _another_port(found: Map) -> Map:
    found["capabilities"]["telemetry"] = "tcp://127.0.0.1:1"
    return found


def _turned(found: Map) -> Map:
    return found | {"retryable": not found["retryable"]}


def _off(found: Map) -> Map:
    return found | {"angles": {name: angle + 0.2 for name, angle in found["angles"].items()}}


FAULTS: dict[str, tuple[str, Fault]] = {
    "answers with a delimiter": ("1.1", Fault(reply=lambda frame: [[b"", frame]])),
    "takes messages of several parts": ("1.2", Fault(request=lambda parts: parts[-1:])),
    "takes long frames": ("1.5", requests("heartbeat", _short)),
    "does not answer long frames": ("1.5", loses(lambda found: "padding" in found)),
    "answers enormous frames": ("1.6", patches(sockets, "MAX_MESSAGE", 1 << 22)),
    "nests without end": ("1.7", decodes(loosely)),
    "takes arrays of any length": ("1.8", decodes(loosely)),
    "takes any number of versions": (
        "1.9",
        requests("hello", lambda found: found | {"versions": found["versions"][:64]}),
    ),
    "shortens names": ("1.10", requests("hello", lambda f: f | {"client": f["client"][:64]})),
    "takes bytes for characters": (
        "1.10",
        parses(lambda f: "long" if len(str(f.get("client")).encode()) > 64 else None),
    ),
    "ignores what follows a frame": ("2.1", decodes(_first_of_several)),
    "takes the last of two keys": ("2.2", decodes(loosely)),
    "takes binary for text": ("2.3", decodes(_text_of_bytes)),
    "takes any integer": ("2.4", decodes(loosely)),
    "takes only its own encoding": (
        "2.5",
        Fault(request=lambda p: p if p[-1] == msgpack.packb(loosely(p[-1])) else [b"\xc1"]),
    ),
    "takes no integer for a float": (
        "2.6",
        parses(
            lambda f: "integer"
            if isinstance(f.get("targets"), dict)
            and any(isinstance(value, int) for value in f["targets"].values())
            else None
        ),
    ),
    "takes a float for an integer": (
        "2.7",
        requests("hello", lambda f: f | {"versions": [int(item) for item in f["versions"]]}),
    ),
    "does not know nil": ("2.8", parses(lambda f: "nil" if None in f.values() else None)),
    "refuses unknown fields": ("2.9", parses(lambda f: "future" if "future" in f else None)),
    "calls unknown types malformed": (
        "2.10",
        replies("error", lambda f: f | {"code": f["code"].replace("unknown_type", "malformed")}),
    ),
    "does not answer garbage": ("2.11", loses(lambda found: "type" not in found)),
    "leaves the id out of errors": (
        "2.12",
        replies("error", lambda f: {key: value for key, value in f.items() if key != "id"}),
    ),
    "chooses another version": ("3.2", replies("welcome", lambda f: f | {"version": 2})),
    "takes any version": ("3.3", requests("hello", lambda f: f | {"versions": [1]})),
    "needs no session": (
        "3.4",
        requests("heartbeat", lambda f: f if "session" in f else f | {"session": "s"}),
    ),
    "makes a session for each hello": ("3.5", patches(Clients, "welcome", _new_session_each_time)),
    "has one session for all": (
        "3.6",
        Fault(spoil=lambda server: setattr(server._core._clients, "_token", lambda: "s")),
    ),
    "takes any session": ("3.8", patches(Clients, "find", _any_session)),
    "remembers few clients": ("3.7", patches(outcomes, "MAX_CLIENTS", 32, move=True)),
    "remembers too many clients": ("3.7", patches(outcomes, "MAX_CLIENTS", 96, move=True)),
    "lets a crowd push the controller out": (
        "3.7",
        patches(Clients, "welcome", _controller_may_go, move=True),
    ),
    "answers where it was asked first": ("3.10", _first_connection_only()),
    "remembers few outcomes": ("4.2", patches(outcomes, "MAX_OUTCOMES", 32)),
    "remembers too many outcomes": ("4.7", patches(outcomes, "MAX_OUTCOMES", 512)),
    "carries a request out again": ("4.4", patches(Client, "recall", _nothing_is_remembered)),
    "does not look at what a request says": (
        "4.6",
        patches(outcomes, "_fingerprint", lambda request: b""),
    ),
    "carries out old ids": ("4.7", patches(Client, "recall", _nothing_expires)),
    "minds the order of keys": ("4.8", patches(outcomes, "_sorted", dict)),
    "tries again what it refused": ("4.9", patches(Client, "recall", _refusals_are_forgotten)),
    "takes refused sessions' ids for used": (
        "4.10",
        patches(Clients, "find", _unknown_session_uses_ids_up),
    ),
    "looks at targets before control": (
        "4.12",
        parses(lambda f: "empty" if f.get("targets") == {} else None),
    ),
    "numbers heartbeats": ("4.14", loses(twice(lambda f: f.get("type") == "heartbeat"))),
    "hides the controller": (
        "5.1",
        replies("status", lambda f: {key: f[key] for key in f if key != "controller"}),
    ),
    "needs no control": ("5.2", patches(ServerCore, "_needs_lease", lambda core, client: None)),
    "gives control once only": ("5.3", patches(ServerCore, "_acquire", _once_only)),
    "gives control to whoever comes": (
        "5.4",
        patches(ServerCore, "_acquire", _last_come_first_served),
    ),
    "does not say who has control": (
        "5.4",
        replies("error", lambda f: f | {"message": "Somebody else."}),
    ),
    "stops only in a session": (
        "5.9",
        loses(lambda f: f.get("type") == "stop" and "session" not in f),
    ),
    "lets anybody clear": (
        "5.11",
        replies("error", lambda f: f | {"code": f["code"].replace("not_controller", "ok")}),
    ),
    "stops once only": ("5.12", loses(twice(lambda f: f.get("type") == "stop"))),
    "says that it is idle after clear": (
        "6.1",
        replies("ok", lambda f: f | {"state": f["state"].replace("holding", "idle")}),
    ),
    "answers twice": ("7.5", Fault(reply=lambda frame: [[frame], [frame]])),
    "counts the ids of answers": ("7.6", replies("status", lambda f: f | {"id": f["id"] // 2})),
    "leaves a field out": ("7.1", replies("ok", lambda f: {"type": "ok", "id": f["id"]})),
    "has a touch too few": ("7.7", replies("observation", lambda f: f | {"touch": f["touch"][1:]})),
    "forgets an angle": (
        "7.7",
        replies("observation", lambda f: f | {"angles": {"hip_left": 0.0}}),
    ),
    "repeats a sequence": ("7.8", replies("observation", lambda f: f | {"sequence": 1})),
    "has errors that can be retried": ("8.1", replies("error", _turned)),
    "makes up codes": ("8.1", replies("error", lambda f: f | {"code": "oops"})),
    "tells tilt in degrees": ("9.1", replies("observation", lambda f: f | {"tilt": [30.0, 0.0]})),
    "has a tilt that cannot be": ("9.1", replies("observation", lambda f: f | {"tilt": [1.5] * 2})),
    "tells clearance in millimetres": (
        "9.2",
        replies("observation", lambda f: f | {"clearance": 42.0}),
    ),
    "calls all clearances saturated": (
        "9.2",
        replies("observation", lambda f: f | {"clearance": 0.1, "clearance_saturated": True}),
    ),
    "runs backwards": ("10.1", replies("status", lambda f: f | {"robot_time": -math.inf})),
    "publishes another topic": ("11.1", patches(publisher, "TOPIC", b"news")),
    "publishes at another address": ("11.3", replies("welcome", _another_port)),
    "publishes too seldom": ("11.2", Fault(spoil=_slow_telemetry)),
    "invents targets": (
        "7.2",
        replace(
            requests("perform", lambda f: f | {"targets": _ALL | f["targets"]}),  # noqa: F821
            move=True,
        ),
    ),
    "clamps targets": (
        "7.3",
        patches(core, "check_targets", lambda joints, targets: None, move=True),
    ),
    "misses its targets": ("7.4", replace(replies("observation", _off), move=True)),
    "calls every end a silence": (
        "5.10",
        replace(
            replies("error", lambda f: f | {"code": f["code"].replace("stop", "silent")}),
            move=True,
        ),
    ),
}
