"""A server core with a robot behind it, watched from all sides while it is fed frames.

What must hold, whatever comes:

- nothing is ever raised;
- an invalid frame, by the reading of ``reference``, is answered with one error, of the right code,
  and changes nothing but the count of garbage; a valid one is not counted;
- every answer is a valid reply;
- a numbered request is carried out at most once, and those that need control only for who has it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Iterable
from typing import Any, Final

from protocol.errors import RobotError
from protocol.rules.robot_interface import Finished, Progressed, Snapshot
from protocol.rules.server_core import Action, Send, ServerCore, Silence, Submit
from protocol.rules.transitions import REFUSALS, TRANSITIONS, Event
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from protocol.wire.codec import decode, encode
from protocol.wire.messages import (
    ErrorReply,
    ObservationReply,
    Ok,
    Perform,
    Read,
    RobotRequest,
    SessionRequest,
    State,
    parse_reply,
    parse_telemetry,
)
from tests.fuzz import reference

JOINTS: Final = ("a", "b")
CLIENTS: Final = ("ann", "bob", "eve")


def _capabilities() -> Capabilities:
    return Capabilities(
        robot="model",
        software="model 1",
        config_hash="0",
        base_size=(0.1, 0.1, 0.1),
        base_mass=1.0,
        part_radii=(0.01, 0.01),
        joints=tuple(
            Joint(name=name, lower=-0.5, upper=0.5, speed=1.0, resolution=0.01) for name in JOINTS
        ),
        sensors=(Sensor(modality="touch", unit="bool", count=1, noise=0.0, rate=10.0),),
        telemetry="tcp://127.0.0.1:5751",
        telemetry_rate=1.0,
    )


_CAPABILITIES: Final = _capabilities()


class ModelRobot:
    """The state machine of a robot, and nothing else; motions last until they are ended."""

    def __init__(self) -> None:
        self.state = State.IDLE
        self.sequence = 0
        self.under_way: dict[int, RobotRequest] = {}

    def snapshot(self) -> Snapshot:
        return Snapshot(
            state=self.state,
            robot_time=1.0,
            sequence=self.sequence,
            angles=dict.fromkeys(JOINTS, 0.0),
        )

    def submit(self, ticket: int, request: RobotRequest) -> list[Finished]:
        event = Event(request.TYPE)
        following = TRANSITIONS.get((self.state, event))
        if following is None:
            raise RobotError(REFUSALS[self.state], f"{self.state}.")
        ended = []
        if event in (Event.HOLD, Event.RELAX, Event.STOP):
            ended = self.abort(f"aborted_{event}")
        self.state = following
        if isinstance(request, Perform | Read):
            self.under_way[ticket] = request
            return ended
        return [*ended, Finished(ticket=ticket, reply=Ok(id=request.id, state=self.state))]

    def abort(self, code: str) -> list[Finished]:
        performs = [key for key, job in self.under_way.items() if isinstance(job, Perform)]
        ended = []
        for ticket in performs:
            request = self.under_way.pop(ticket)
            reply = ErrorReply.of(RobotError(code, "Ended."), request_id=request.id)
            ended.append(Finished(ticket=ticket, reply=reply))
            self.state = State.HOLDING
        return ended

    def complete(self) -> list[Finished]:
        ended = []
        for ticket, request in self.under_way.items():
            self.sequence += 1
            reply = ObservationReply(
                id=request.id,
                sequence=self.sequence,
                robot_time=1.0,
                monotonic=1.0,
                angles=dict.fromkeys(JOINTS, 0.0),
                saturated_joints=(),
                touch=(True,),
                clearance_saturated=False,
                settled=True,
                settle_time=0.1,
                samples=1,
            )
            ended.append(Finished(ticket=ticket, reply=reply))
            if isinstance(request, Perform):
                self.state = TRANSITIONS.get((self.state, Event.DONE), self.state)
        self.under_way.clear()
        return ended


class Subject:
    """The core under trial.

    Attributes:
        frames: How many frames it was fed.
        invalid: How many of them were no valid request.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.invalid = 0
        self.now = 0.0
        self.robot = ModelRobot()
        tokens = (f"session-{number}" for number in itertools.count())
        self.core = ServerCore(_CAPABILITIES, view=self.robot.snapshot, token=lambda: next(tokens))
        self._executed: set[tuple[str, str, int]] = set()
        self._state: Hashable | None = None
        for client in CLIENTS:
            self.feed(encode({"type": "hello", "id": 0, "client": client, "versions": [1]}))

    def session(self, client: str) -> str:
        """The session of one of ``CLIENTS``."""
        return f"session-{CLIENTS.index(client)}"

    def feed(self, frame: bytes, peer: bytes = b"peer") -> list[dict[str, Any]]:
        """Feeds a frame; what is answered, decoded."""
        self.frames += 1
        code = reference.verdict(frame)
        garbage = self.core.garbage
        before = self.state() if code is not None else None
        actions = self.core.receive(peer, frame, self.now)
        if code is None:
            assert self.core.garbage == garbage, "a valid frame was counted as garbage"
            self._state = None
            return self._carry_out(actions)
        self.invalid += 1
        assert self.core.garbage == garbage + 1, "an invalid frame was not counted"
        (action,) = actions
        assert isinstance(action, Send)
        assert action.peer == peer
        reply = self._reply(action)
        assert (reply["type"], reply["code"]) == ("error", code), reply
        self._state = None
        assert self.state() == before, "an invalid frame changed the state"
        return [reply]

    def wait(self, seconds: float) -> None:
        """Lets time pass, and sees that a publication is valid."""
        self.now += seconds
        self._state = None
        self._carry_out(self.core.tick(self.now))
        parse_telemetry(decode(self.core.publication()))
        assert self.core.deadline is None or math.isfinite(self.core.deadline)

    def complete(self) -> None:
        """Ends all that is under way."""
        self._state = None
        self._finish(self.robot.complete())

    def progress(self) -> None:
        """All that is under way goes on."""
        self._state = None
        for ticket in self.robot.under_way:
            event = Progressed(ticket=ticket, phase="moving", fraction=0.5, robot_time=1.0)
            for action in self.core.progress(event):
                self._reply(action)

    def state(self) -> Hashable:
        """Everything that a frame could change, in the core and in the robot."""
        if self._state is None:
            core = self.core
            self._state = (
                self.robot.state,
                self.robot.sequence,
                tuple(self.robot.under_way),
                core.controller,
                core.deadline,
                tuple(core._in_flight),
                tuple(
                    (
                        client.name,
                        client.session,
                        client.user,
                        client.software,
                        client.highest,
                        tuple(
                            (
                                key,
                                outcome.fingerprint,
                                outcome.peer,
                                outcome.progress,
                                outcome.reply,
                            )
                            for key, outcome in client.outcomes.items()
                        ),
                    )
                    for client in core._clients
                ),
            )
        return self._state

    def _carry_out(self, actions: Iterable[Action]) -> list[dict[str, Any]]:
        replies = []
        for action in actions:
            if isinstance(action, Send):
                replies.append(self._reply(action))
            elif isinstance(action, Submit):
                replies += self._submit(action)
            elif isinstance(action, Silence):
                self._finish(self.robot.abort("aborted_silent"))
        return replies

    def _submit(self, action: Submit) -> list[dict[str, Any]]:
        request = action.request
        if isinstance(request, SessionRequest):
            key = (request.client, request.session, request.id)
            assert key not in self._executed, "a request was carried out twice"
            self._executed.add(key)
        if request.NEEDS_CONTROL:
            assert self.core.controller == request.client, "carried out without control"
        if isinstance(request, Perform):
            assert request.targets.keys() == set(JOINTS)
            assert all(abs(angle) <= 0.5 + 1e-9 for angle in request.targets.values())
        try:
            ended = self.robot.submit(action.ticket, request)
        except RobotError as error:
            reply = ErrorReply.of(error, request_id=request.id)
            return self._finish([Finished(ticket=action.ticket, reply=reply)])
        accepted = [self._reply(sent) for sent in self.core.accept(action.ticket)]
        return accepted + self._finish(ended)

    def _finish(self, ended: Iterable[Finished]) -> list[dict[str, Any]]:
        return [self._reply(sent) for event in ended for sent in self.core.finish(event)]

    @staticmethod
    def _reply(action: Send) -> dict[str, Any]:
        found = reference.decode(action.frame)
        parse_reply(found)
        return found
