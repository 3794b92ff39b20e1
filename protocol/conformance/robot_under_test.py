"""The robot under test, and clients that talk to it."""

from __future__ import annotations

import itertools
import secrets
import time
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Final

import zmq

from protocol.conformance.raw_connection import (
    Failed,
    Map,
    RawConnection,
    Skipped,
    SuiteSettings,
    Unanswered,
    expect,
    pack,
    said,
)
from protocol.security.keys import ClientKeys
from protocol.system.process import Closable
from protocol.wire.capabilities import Capabilities

LOOSE_ID: Final = 2**52
"""First id of requests that are not numbered; larger than the ids of numbered ones."""
_CALM: Final = ("idle", "holding")
_BEAT: Final = 0.5  # s between signs of life while something takes longer


class TrialClient:
    """One client, with its own connection.

    Args:
        robot: The robot under test.
        name: The client's id.
        connection: The client's connection.
    """

    def __init__(self, robot: RobotUnderTest, name: str, connection: RawConnection):
        self.name = name
        self.connection = connection
        self.session = ""
        self._robot = robot
        self._numbers, self._loose = robot.counters(name)

    def hello(self, **fields: Any) -> Map:
        """Sends hello and returns the reply."""
        offer = {"versions": [1], "software": "conformance"} | fields
        reply = self.ask("hello", **offer)
        if reply["type"] == "welcome":
            self.session = reply["session"]
        return reply

    def number(self) -> int:
        """The next id for a numbered request."""
        return next(self._numbers)

    def loose(self) -> int:
        """The next id for hello, heartbeat or stop."""
        return next(self._loose)

    def request(self, kind: str, **fields: Any) -> Map:
        """A request, not sent; ``None`` leaves a field out.

        Raises:
            Skipped: Requests of this kind do not work at all, as an earlier check has found out.
        """
        if (reason := self._robot.dead.get(kind)) is not None:
            raise Skipped(reason)
        is_loose = kind in ("hello", "heartbeat", "stop")
        message: Map = {"type": kind, "id": self.loose() if is_loose else None, "client": self.name}
        if kind != "hello" and (self.session or kind != "stop"):
            message["session"] = self.session
        message |= fields
        if message["id"] is None and "id" not in fields:
            message["id"] = self.number()
        return {key: value for key, value in message.items() if value is not None}

    def send(self, kind: str, **fields: Any) -> Map:
        """Sends a request, and returns the request."""
        request = self.request(kind, **fields)
        self.connection.send(request)
        return request

    def ask(self, kind: str, **fields: Any) -> Map:
        """Sends a request and returns the final reply."""
        return self.answer_to(self.request(kind, **fields))[1]

    def answer_to(
        self, request: Mapping[str, Any], *, patience: float | None = None
    ) -> tuple[list[Map], Map]:
        """Sends a request; returns the replies in between, and the final one."""
        self.connection.send(request)
        return self.connection.final(request["id"], patience=patience)

    def ask_raw(self, frame: bytes, *request_ids: int | None) -> Map | None:
        """Sends a frame, then a hello; returns the frame's answer with one of these ids, if any."""
        self.connection.send_parts(frame, ids=request_ids)
        hello = self.send("hello", versions=[1])
        answer = self.connection.reply(hello["id"])
        expect(answer is not None, "After that, the robot does not answer any more.")
        for patience in (0.0, self.connection.grace):
            for request_id in request_ids:
                if (reply := self.connection.reply(request_id, patience=patience)) is not None:
                    return reply
        if None not in request_ids:
            self.connection.expect_ids()
        return None

    def refused(self, code: str, what: str, kind: str, **fields: Any) -> None:
        """Expects that a request is refused; ``what`` names it in the sentence."""
        request = self.request(kind, **fields)
        self.expect_raw(pack(request), (code,), (request["id"],), what)

    def expect_raw(
        self, frame: bytes, codes: Collection[str], ids: Collection[int | None], what: str
    ) -> None:
        """Expects that a frame is answered with one of these types or error codes and ids."""
        reply = self.ask_raw(frame, *ids)
        expect(
            reply is not None and reply.get("code", reply["type"]) in codes,
            f"{what}: answered with {said(reply)} instead of {' or '.join(codes)}.",
        )

    def expect(self, code: str, kind: str, **fields: Any) -> Map:
        """Expects a reply of this type, or an error of this code."""
        reply = self.ask(kind, **fields)
        expect(
            code in (reply["type"], reply.get("code")),
            f"{kind} was answered with {said(reply)} instead of {code}.",
        )
        return reply

    def status(self) -> Map:
        """The robot's status."""
        reply = self.ask("heartbeat")
        expect(reply["type"] == "status", f"A heartbeat was answered with {said(reply)}.", "5.5")
        return reply

    def harmless(self, number: int, **fields: Any) -> Map:
        """Asks what does nothing, a release without control, and returns the reply."""
        reply = self.ask("release", id=number, **fields)
        if reply.get("code") == "unauthorised":
            raise Skipped("This key is a viewer's.")
        return reply

    def wait_for(self, request_id: int) -> tuple[list[Map], Map]:
        """Waits, with heartbeats, for the end of a motion; returns what ``answer_to`` does."""
        start = last_beat = time.monotonic()
        interim: list[Map] = []
        while (now := time.monotonic()) < start + self._robot.settings.motion:
            if now >= last_beat + _BEAT:  # however much the robot tells, we are heard of
                self.status()
                last_beat = now
            reply = self.connection.answer(request_id, patience=last_beat + _BEAT - now)
            if reply is None:
                continue
            if reply["type"] not in ("accepted", "progress"):
                return interim, reply
            interim.append(reply)
        raise Unanswered(f"A motion did not end within {self._robot.settings.motion:g} s.")


class RobotUnderTest(Closable):
    """The robot under test, as the checks see it.

    Use it as a context manager: it closes every connection.

    Attributes:
        noted: What was wrong with answers that could be used all the same, by clause.
        dead: Kinds of request that do not work at all, and why no check needs to try them again.
    """

    def __init__(self, settings: SuiteSettings):
        self.settings = settings
        self.noted: defaultdict[str, list[str]] = defaultdict(list)
        self.dead: dict[str, str] = {}
        # A robot remembers 64 clients: few names, used again and again, push nobody else out.
        self.use_new_names()
        self._counters: dict[str, tuple[Iterator[int], Iterator[int]]] = {}
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._connections: list[RawConnection] = []
        self._connections_made = 0

    def close(self) -> None:
        """Closes every connection."""
        self.context.destroy(linger=0)

    def connection(self) -> RawConnection:
        """A new connection."""
        connection = self.connection_with(self.settings.keys)
        self._connections.append(connection)
        return connection

    def connection_with(self, keys: ClientKeys | None) -> RawConnection:
        """A new connection with other keys, or with none; the caller closes it."""
        self._connections_made += 1
        number = self._connections_made
        return RawConnection(self.context, self.settings, keys, self.noted, number)

    def client(self, name: str | None = None) -> TrialClient:
        """A client that has said hello, on a connection of its own."""
        client = self.stranger(name)
        reply = client.hello()
        expect(reply["type"] == "welcome", f"hello was answered with {said(reply)}.", "3.2")
        return client

    def stranger(self, name: str | None = None) -> TrialClient:
        """A client that has not said hello."""
        if name is None:
            self._used += 1
            name = f"conformance-{self._token}-{self._used}"
        return TrialClient(self, name, self.connection())

    def counters(self, name: str) -> tuple[Iterator[int], Iterator[int]]:
        """The ids of a client, for numbered requests and for the others; they only grow."""
        new_counters = (itertools.count(1), itertools.count(LOOSE_ID))
        return self._counters.setdefault(name, new_counters)

    def capabilities(self) -> Capabilities:
        """What the robot says about itself."""
        return Capabilities.from_map(self.stranger().hello()["capabilities"])

    def use_new_names(self) -> None:
        """Names later clients anew: what a robot remembers of the earlier ones is uncertain."""
        self._token = secrets.token_hex(8)
        self._used = 0

    def close_connections(self) -> None:
        """Closes all connections that a check has left open; its clients' names are free again."""
        self._used = 0
        while self._connections:
            self._connections.pop().close()

    @contextmanager
    def controlled(self) -> Iterator[TrialClient]:
        """A client in control of the robot, which is at rest before and after."""
        client = self.client()
        status = client.status()
        if status["state"] not in _CALM:
            raise Skipped(f"The robot is {status['state']}, and was left so.")
        if status.get("controller") is not None:
            raise Skipped(f"The robot is held by {status['controller']}.")
        reply = client.ask("acquire")
        if reply.get("code") == "unauthorised":
            raise Skipped("This key is a viewer's.")
        sentence = f"acquire of a free robot was answered with {said(reply)}."
        expect(reply["type"] == "ok", sentence, "5.3")
        try:
            yield client
        finally:
            with suppress(Failed, Skipped):  # what went wrong before is what counts
                if client.status()["state"] == "stopped":
                    client.ask("clear")
            with suppress(Failed, Skipped):
                client.ask("release")
