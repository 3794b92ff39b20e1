"""A server core without sockets, and short words for what clients do with it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeVar

from protocol.rules.robot_interface import Snapshot
from protocol.rules.server_core import Action, Send, ServerCore, Submit
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import decode, encode
from protocol.wire.messages import ObservationReply, State

A = TypeVar("A")
TARGETS = {"a": 0.1, "b": -0.1}


def observation(request_id: int, sequence: int = 1) -> ObservationReply:
    return ObservationReply(
        id=request_id,
        sequence=sequence,
        robot_time=1.0,
        monotonic=1.0,
        angles=TARGETS,
        saturated_joints=(),
        clearance_saturated=False,
        settled=True,
        settle_time=0.1,
        samples=1,
    )


class ServerCoreBench:
    """A core, and short words for what clients do with it."""

    def __init__(self, capabilities: Capabilities, **options: Any):
        self.now = 100.0
        tokens = (f"session-{number}" for number in range(10_000))
        self.core = ServerCore(capabilities, view=self.view, token=lambda: next(tokens), **options)
        self.sessions: dict[str, str] = {}

    @staticmethod
    def view() -> Snapshot:
        return Snapshot(state=State.IDLE, robot_time=1.0, sequence=0, angles=TARGETS)

    def send(self, client: str, kind: str, number: int, **fields: Any) -> list[Action]:
        user = fields.pop("user", None)
        peer = fields.pop("peer", client.encode())
        message = {"type": kind, "id": number, "client": client, **fields}
        if kind not in ("hello", "stop") and "session" not in message:
            message["session"] = self.sessions[client]
        return self.core.receive(peer, encode(message), self.now, user)

    def hello(self, client: str, **fields: Any) -> dict[str, Any]:
        reply = self.reply(self.send(client, "hello", 2**52, versions=[1], **fields))
        self.sessions[client] = reply.get("session", "none")
        return reply

    def control(self, client: str = "c") -> None:
        self.hello(client)
        assert self.reply(self.send(client, "acquire", 1))["type"] == "ok"

    def perform(self, number: int, client: str = "c") -> int:
        """Begins a motion; returns its ticket."""
        ticket = one(Submit, self.send(client, "perform", number, targets=TARGETS)).ticket
        assert self.reply(self.core.accept(ticket))["type"] == "accepted"
        return ticket

    @staticmethod
    def reply(actions: Iterable[Action]) -> dict[str, Any]:
        return decode(one(Send, actions).frame)


def one(kind: type[A], actions: Iterable[Any]) -> A:
    (action,) = [action for action in actions if isinstance(action, kind)]
    return action
