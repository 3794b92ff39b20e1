"""What checks share: connections, clients in a session, and a robot to be left as it was found."""

from __future__ import annotations

import itertools
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, Final

import zmq

from protocol.capabilities import Capabilities
from protocol.conformance.expectations import Broken, Untried, expect
from protocol.conformance.line import GRACE, Line, Map, said
from protocol.keys import ClientKeys

LOOSE_ID: Final = 2**52
_CALM: Final = ("idle", "holding")
_BEAT: Final = 0.5  # s between signs of life while something takes longer


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the suite may do.

    Attributes:
        uri: Where the robot is.
        keys: The suite's keys, or ``None``.
        move: Whether the robot may be moved, and other clients be disturbed.
        slow: Whether to try what takes half a minute.
        patience: Seconds to wait for an answer that must come.
        motion: Seconds that one interaction may take.
        clock: Measures the silences that ``slow`` needs, s.
    """

    uri: str
    keys: ClientKeys | None = None
    move: bool = False
    slow: bool = False
    patience: float = 3.0
    motion: float = 120.0
    clock: Callable[[], float] = time.monotonic


class Party:
    """One client, with its own connection.

    Args:
        bench: The bench.
        name: The client's id.
        line: Its connection.
    """

    def __init__(self, bench: Bench, name: str, line: Line):
        self.name = name
        self.line = line
        self.session = ""
        self._bench = bench
        self._numbers, self._loose = bench.counters(name)

    def hello(self, **fields: Any) -> Map:
        """Says hello; what comes back."""
        found = {"versions": [1], "software": "conformance"} | fields
        reply = self.ask("hello", **found)
        if reply["type"] == "welcome":
            self.session = reply["session"]
        return reply

    def number(self) -> int:
        """A fresh id for a numbered request."""
        return next(self._numbers)

    def loose(self) -> int:
        """An id for hello, heartbeat and stop."""
        return next(self._loose)

    def request(self, kind: str, **fields: Any) -> Map:
        """A request, not sent; ``None`` leaves a field out."""
        loose = kind in ("hello", "heartbeat", "stop")
        found: Map = {"type": kind, "id": self.loose() if loose else None, "client": self.name}
        if kind not in ("hello", "stop"):
            found["session"] = self.session
        found |= fields
        if found["id"] is None and "id" not in fields:
            found["id"] = self.number()
        return {key: value for key, value in found.items() if value is not None}

    def ask(self, kind: str, **fields: Any) -> Map:
        """The final reply to a request."""
        return self.answer_to(self.request(kind, **fields))[1]

    def answer_to(
        self, request: Mapping[str, Any], *, patience: float | None = None
    ) -> tuple[list[Map], Map]:
        """Sends a request; the replies in between, and the final one."""
        self.line.send(request)
        return self.line.final(request["id"], patience=patience)

    def ask_raw(self, frame: bytes, *request_ids: int | None) -> Map | None:
        """Sends a frame, then a hello; the answer to the frame with one of these ids, if any."""
        self.line.send_parts(frame)
        after = self.request("hello", versions=[1])
        self.line.send(after)
        answer = self.line.reply(after["id"])
        expect(answer is not None, "After that, the robot does not answer any more.")
        for patience in (0.0, GRACE):
            for request_id in request_ids:
                if (found := self.line.reply(request_id, patience=patience)) is not None:
                    return found
        return None

    def refused(self, frame: bytes, code: str, request_id: int | None, what: str) -> None:
        """Expects that a frame is answered with an error; ``what`` names it in the sentence."""
        found = self.ask_raw(frame, request_id)
        if found is None and request_id is not None:
            stray = self.line.reply(None, patience=0)
            expect(stray is None, f"{what}: the answer ({said(stray)}) does not carry its id.")
        expect(
            found is not None and found["type"] == "error" and found["code"] == code,
            f"{what}: answered with {said(found)} instead of {code}.",
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
        return self.expect("status", "heartbeat")

    def harmless(self, number: int, **fields: Any) -> Map:
        """The reply to a numbered request that does nothing: a release without control."""
        reply = self.ask("release", id=number, **fields)
        if reply.get("code") == "unauthorised":
            raise Untried("This key is a viewer's.")
        return reply

    def wait_for(self, request_id: int) -> tuple[list[Map], Map]:
        """The replies to a motion of this client that was sent, with heartbeats in between."""
        end = time.monotonic() + self._bench.settings.motion
        between: list[Map] = []
        while time.monotonic() < end:
            found = self.line.reply(request_id, patience=_BEAT)
            if found is None:
                self.status()
            elif found["type"] in ("accepted", "progress"):
                between.append(found)
            else:
                return between, found
        raise Broken(f"A motion did not end within {self._bench.settings.motion:g} s.")


class Bench:
    """The robot under trial, as the checks see it.

    Use it as a context manager: it closes every connection.

    Attributes:
        wrong_errors: Errors, over all connections so far, that were not as in the table.
    """

    def __init__(self, settings: Settings):
        self.settings = settings
        self.wrong_errors: list[str] = []
        self._stack = ExitStack()
        # A robot remembers 64 clients: few names, used again and again, push nobody else out.
        self._token = secrets.token_hex(8)
        self._used = 0
        self._counters: dict[str, tuple[Iterator[int], Iterator[int]]] = {}
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._stack.callback(self.context.destroy, linger=0)
        self._lines: list[Line] = []

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def line(self) -> Line:
        """A new connection."""
        settings = self.settings
        found = Line(
            self.context, settings.uri, settings.keys, settings.patience, self.wrong_errors
        )
        self._lines.append(found)
        return found

    def party(self, name: str | None = None) -> Party:
        """A client that has said hello, on a connection of its own."""
        found = self.stranger(name)
        reply = found.hello()
        expect(reply["type"] == "welcome", f"hello was answered with {said(reply)}.")
        return found

    def stranger(self, name: str | None = None) -> Party:
        """A client that has not said hello."""
        if name is None:
            self._used += 1
            name = f"conformance-{self._token}-{self._used}"
        return Party(self, name, self.line())

    def counters(self, name: str) -> tuple[Iterator[int], Iterator[int]]:
        """The ids of a client, for numbered requests and for the others; they only grow."""
        fresh = (itertools.count(1), itertools.count(LOOSE_ID))
        return self._counters.setdefault(name, fresh)

    def capabilities(self) -> Capabilities:
        """What the robot says about itself."""
        return Capabilities.of(self.stranger().hello()["capabilities"])

    def close_lines(self) -> None:
        """Closes all connections that a check has left open; its clients' names are free again."""
        self._used = 0
        while self._lines:
            self._lines.pop().close()

    @contextmanager
    def controlled(self) -> Iterator[Party]:
        """A client in control of a robot that is calm; leaves it calm and free."""
        party = self.party()
        status = party.status()
        if status["state"] not in _CALM:
            raise Untried(f"The robot is {status['state']}, and was left so.")
        if status.get("controller") is not None:
            raise Untried(f"The robot is held by {status['controller']}.")
        reply = party.ask("acquire")
        if reply.get("code") == "unauthorised":
            raise Untried("This key is a viewer's.")
        expect(reply["type"] == "ok", f"acquire of a free robot was answered with {said(reply)}.")
        try:
            yield party
        finally:
            if party.status()["state"] == "stopped":
                party.ask("clear")
            party.ask("release")
