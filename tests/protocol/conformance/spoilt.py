"""Servers that break one rule each, for the conformance suite to find out.

A ``Fault`` changes frames on their way in or out, or spoils a server that was just made. Everything
else is the healthy server, so what the suite finds is that one fault.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import msgpack
import pytest

from protocol.errors import RemoteProtocolError, RobotError
from protocol.rules import server_core
from protocol.rules.at_most_once import Client, Clients, RememberedRequest
from protocol.rules.control import Lease
from protocol.rules.robot_interface import Robot
from protocol.rules.server_core import Action, Send, ServerCore
from protocol.sockets.tcp_listener import Arrival
from protocol.transport.server import Server
from protocol.wire.codec import decode
from protocol.wire.messages import Request, Stop, parse_request

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

    def _taken(self, arrival: Arrival) -> Iterable[Action]:
        changed = self._fault.request(arrival.parts)
        return [] if changed is None else super()._taken(arrival._replace(parts=changed))

    def _send(self, action: Send) -> None:
        for parts in self._fault.reply(action.frame):
            self._listener.send(action.peer, parts)


# --- ways to change frames ------------------------------------------------------------------------


def loosely(frame: bytes) -> Map:
    try:
        value = msgpack.unpackb(frame, strict_map_key=False)
    except Exception:
        return {}
    return value if isinstance(value, dict) else {}


def replies(kind: str, change: Change) -> Fault:
    """Changes the replies of one type."""

    def reply(frame: bytes) -> list[list[bytes]]:
        message = decode(frame)
        return [[msgpack.packb(change(message))] if message["type"] == kind else [frame]]

    return Fault(reply=reply)


def requests(kind: str, change: Change) -> Fault:
    """Changes the requests of one type."""

    def request(parts: list[bytes]) -> list[bytes]:
        message = loosely(parts[-1])
        plain = [msgpack.packb(message)] == parts  # what is wrong as a frame stays so
        return [msgpack.packb(change(message))] if plain and message.get("type") == kind else parts

    return Fault(request=request)


def loses(condition: Callable[[Map], bool]) -> Fault:
    """Loses some requests."""
    return Fault(request=lambda parts: None if condition(loosely(parts[-1])) else parts)


def twice(condition: Callable[[Map], bool]) -> Callable[[Map], bool]:
    """Whether a client's request with this id came before, of those that fulfil the condition."""
    seen: set[Any] = set()

    def again(message: Map) -> bool:
        if not condition(message):
            return False
        name = message.get("client"), message.get("id")
        known = name in seen
        seen.add(name)
        return known

    return again


def parses(check: Callable[[Mapping[str, Any]], str | None]) -> Fault:
    """Refuses what a check finds fault with."""

    def spoilt(message: Mapping[str, Any]) -> Request:
        if (flaw := check(message)) is not None:
            raise RemoteProtocolError(flaw, request_id=message.get("id"))
        return parse_request(message)

    return Fault(patch=lambda patch: patch.setattr(server_core, "parse_request", spoilt))


def decodes(lenient: Callable[[bytes], Any]) -> Fault:
    """Decodes frames by something else, which may raise anything."""

    def spoilt(frame: bytes) -> Any:
        try:
            return decode(frame)
        except RemoteProtocolError:
            with suppress(Exception):
                message = lenient(frame)
                if isinstance(message["type"], str):
                    return message
            raise

    return Fault(patch=lambda patch: patch.setattr(server_core, "decode", spoilt))


def patches(target: Any, name: str, value: Any, **options: Any) -> Fault:
    """Replaces something in our modules."""
    return Fault(patch=lambda patch: patch.setattr(target, name, value), **options)


def first_of_several(frame: bytes) -> Any:
    unpacker = msgpack.Unpacker()
    unpacker.feed(frame)
    return unpacker.unpack()


def text_of_bytes(frame: bytes) -> Any:
    def plain(value: Any) -> Any:
        return value.decode("latin-1") if isinstance(value, bytes) else value

    message = msgpack.unpackb(frame, raw=True)
    return {plain(key): plain(value) for key, value in message.items()}


def keys_twice_inside(frame: bytes) -> Any:
    """Takes the last of two keys, but for those of the frame's own map."""

    def hook(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
        mapping = dict(pairs)
        if "type" in mapping and len(mapping) < len(pairs):
            raise ValueError
        return mapping

    return msgpack.unpackb(frame, object_pairs_hook=hook)


def short(message: Map) -> Map:
    """A frame without the padding that made it too long."""
    return {key: value for key, value in message.items() if key != "padding"}


# --- ways to spoil our modules --------------------------------------------------------------------


def new_session_each_time(self: Clients, name: str, **options: Any) -> Client:
    client = _welcome(self, name, **options)
    client.session = self._token()
    return client


def any_session(self: Clients, name: str, *, session: str, user: str | None) -> Client:
    client = self._clients.get(name)
    return _find(self, name, session=client.session if client else session, user=user)


def finds_the_client_of_a_stop(server: Server) -> None:
    authorise, clients = server._core._authorise, server._core._clients

    def spoilt(user: str | None, request: Request) -> None:
        authorise(user, request)
        if isinstance(request, Stop) and request.session is not None:
            clients.find(request.client, session=request.session, user=user)

    server._core.__dict__["_authorise"] = spoilt


def unknown_session_uses_ids_up(
    self: Clients, name: str, *, session: str, user: str | None
) -> Client:
    client = self._clients.get(name)
    if client is not None and client.session != session:
        client.highest += 1000
    return _find(self, name, session=session, user=user)


def nothing_is_remembered(self: Client, request: Request) -> RememberedRequest | None:
    return None


def nothing_expires(self: Client, request: Request) -> RememberedRequest | None:
    return _recall(self, request) if request.id in self.outcomes else None


def refusals_are_forgotten(self: Client, request: Request) -> RememberedRequest | None:
    known = self.outcomes.get(request.id)
    if known is not None and known.reply is not None and decode(known.reply)["type"] == "error":
        del self.outcomes[request.id]
        return None
    return _recall(self, request)


def once_only(
    self: ServerCore, client: Client, outcome: RememberedRequest, now: float
) -> list[Action]:
    if self._lease.holder == client.name:
        raise RobotError("held", f"{client.name} holds the robot.")
    return _acquire(self, client, outcome, now)


def last_come_first_served(
    self: ServerCore, client: Client, outcome: RememberedRequest, now: float
) -> list[Action]:
    self._lease.free()
    return _acquire(self, client, outcome, now)


def garbage_ends_control(self: ServerCore, peer: bytes, error: RemoteProtocolError) -> Send:
    self._lease.free()
    return _complain(self, peer, error)


def any_number_under_way(self: Client, request: Request, peer: bytes) -> RememberedRequest:
    outcome = self.outcomes[request.id] = RememberedRequest.of(request, peer)
    self.highest = request.id
    return outcome


def controller_may_go(self: Clients, name: str, **options: Any) -> Client:
    return _welcome(self, name, **(options | {"keep": None}))


def _never_freed(self: Lease, now: float) -> list[Any]:
    return []


_welcome, _find, _recall = Clients.welcome, Clients.find, Client.recall
_acquire, _complain = ServerCore._acquire, ServerCore.complain


def first_connection_only() -> Fault:
    """Answers go to where a request came from first."""
    clients: dict[bytes, str] = {}
    first: dict[tuple[str, int], bytes] = {}

    def spoil(server: Server) -> None:
        take, send = server._taken, server._send

        def taken(arrival: Arrival) -> Iterable[Action]:
            message = loosely(arrival.parts[-1])
            if message.get("type") == "read":
                clients[arrival.peer] = message["client"]
                first.setdefault((message["client"], message["id"]), arrival.peer)
            return take(arrival)

        def answer(action: Send) -> None:
            reply = decode(action.frame)
            peer = action.peer
            if reply["type"] == "observation":
                peer = first.get((clients.get(peer, ""), reply["id"]), peer)
            send(replace(action, peer=peer))

        server.__dict__.update(_taken=taken, _send=answer)

    return Fault(spoil=spoil)
