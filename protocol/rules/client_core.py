"""The client's side of the protocol without sockets, threads or clocks.

A ``ClientCore`` keeps the requests under way: what to send and when, what came back, when to give
up. Requests are repeated under the same id until they are answered, which is safe because the robot
carries out each id at most once. A lost session ends every request: nothing is ever carried over to
a daemon that may not know what the last one did.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import count
from queue import SimpleQueue
from typing import Final, TypeAlias

from protocol.errors import (
    BodyschemaError,
    LocalProtocolError,
    ProtocolError,
    RobotError,
    RobotRestartedError,
    RobotUnreachableError,
)
from protocol.rules.control import HEARTBEAT
from protocol.wire.codec import decode, encode
from protocol.wire.declaration import Message
from protocol.wire.messages import (
    FINAL_REPLIES,
    ErrorReply,
    Heartbeat,
    ObservationReply,
    Perform,
    Read,
    Reply,
    Request,
    SessionRequest,
    Welcome,
    parse_reply,
)

RESEND: Final = 2.0
"""Seconds without a reply to a request after which it is sent again."""

RECONNECT: Final = 3.0
"""Seconds of silence from the robot after which the client reconnects."""

FIRST_LOOSE_ID: Final = 2**52
"""Ids of hello, heartbeat and stop start here, so that they never meet those of other requests."""

LOOK: Final = 1.0
"""Longest time between two calls of ``wake`` while an answer is due, s."""

_MAX_GAP: Final = 2 * LOOK  # a longer gap between two looks at the clock: we were suspended

Answer: TypeAlias = Message | BaseException


class Call:
    """One request under way, shared by the thread that asks and the one that owns the socket.

    Args:
        request: The request.
        patience: Seconds without a reply after which to give up.
        limit: Seconds in all after which to give up; infinite: as long as the robot answers.

    Attributes:
        answers: What came back: accepted, progress…, then the final reply or an exception.
    """

    def __init__(self, request: Request, *, patience: float, limit: float = math.inf):
        self.request = request
        self.frame = encode(request.to_map())
        self.patience = patience
        self.limit = limit
        self.answers: SimpleQueue[Answer] = SimpleQueue()
        self._ended = False
        self.resend = min(RESEND, patience / 3)
        self.heard = self.due = 0.0
        self.stop_at = math.inf
        self.after_sequence = 0

    def __str__(self) -> str:
        return f"{self.request.TYPE} (request {self.request.id})"

    def end(self, answer: Answer) -> None:
        """Puts the final answer; later ones are dropped."""
        if not self._ended:
            self._ended = True
            self.answers.put(answer)


class ClientCore:
    """All requests of one client to one robot.

    Args:
        client: The client's id.
        peer: How messages name the robot.
        now: Present time of the transport clock, s.

    Attributes:
        session: The session in force; ``None`` before hello and after a restart of the daemon.
        garbage: Number of frames that were no valid reply.
        loose_ids: Ids that no request has had, for hello, heartbeat and stop.
    """

    def __init__(self, client: str, *, peer: str, now: float):
        self.session: str | None = None
        self.garbage = 0
        self.loose_ids: Iterator[int] = count(FIRST_LOOSE_ID)
        self._client = client
        self._peer = peer
        self._calls: dict[int, Call] = {}
        self._highest = -1
        self._sequence = 0
        self._heard = now
        self._looked = now
        self._beat_at = now
        self._beat_frame = b""
        self._beat_id = -1

    @property
    def send_at(self) -> float:
        """When ``frames`` next has something to send; infinite: not before the next ``ask``."""
        beat_at = self._beat_at if self.session is not None else math.inf
        return min(beat_at, min((call.due for call in self._calls.values()), default=math.inf))

    @property
    def give_up_at(self) -> float:
        """When ``tick`` next has something to do; infinite: not before the next ``ask``."""
        ends = (min(call.heard + call.patience, call.stop_at) for call in self._calls.values())
        reconnect_at = self._heard + RECONNECT if self._expecting else math.inf
        return min(reconnect_at, min(ends, default=math.inf))

    @property
    def _expecting(self) -> bool:
        return self.session is not None or bool(self._calls)

    def wake(self, now: float) -> None:
        """Call it first after each sleep: time in which the program was suspended is left out."""
        gap = now - self._looked
        self._looked = now
        if gap > _MAX_GAP and self._expecting:
            self._heard += gap
            for call in self._calls.values():
                call.heard += gap
                call.stop_at += gap

    def ask(self, call: Call, now: float) -> None:
        """Begins a call."""
        request = call.request
        if isinstance(request, SessionRequest) and request.session != self.session:
            call.end(self._lost(call))
            return
        if request.id in self._calls:
            call.end(LocalProtocolError(f"{call} is under way already, in another thread."))
            return
        if isinstance(request, Perform | Read) and request.id > self._highest:
            self._highest = request.id  # at or below, the first outcome comes back
            call.after_sequence = self._sequence
        if not self._expecting:
            self._heard = now  # until now, nothing was to be heard
        call.heard = call.due = now
        call.stop_at = now + call.limit
        self._calls[request.id] = call

    def forget(self, call: Call) -> None:
        """Drops a call whose answers nobody waits for any more."""
        if self._calls.get(call.request.id) is call:
            del self._calls[call.request.id]

    def frames(self, now: float) -> list[bytes]:
        """The frames to send now, in the order of the calls; report each with ``sent``."""
        frames = [call.frame for call in self._calls.values() if call.due <= now]
        if self.session is not None and self._beat_at <= now:
            frames.append(self._beat_frame)
        return frames

    def sent(self, frame: bytes, now: float) -> None:
        """Notes that a frame has left."""
        if frame == self._beat_frame:
            self._beat_at = now + HEARTBEAT
        for call in self._calls.values():
            if call.frame == frame:
                call.due = now + call.resend

    def receive(self, frame: bytes, now: float) -> None:
        """Handles one frame from the robot."""
        try:
            reply = parse_reply(decode(frame))
        except ProtocolError:
            self.garbage += 1
            return
        self._heard = now
        call = self._calls.get(reply.id) if reply.id is not None else None
        if isinstance(reply, ErrorReply) and reply.code == "restarted":
            if reply.id == self._beat_id or call is not None:
                self._leave()
            return
        if call is None:
            return  # a heartbeat's answer, or one that came twice
        call.heard = now
        call.due = now + call.resend
        if not isinstance(reply, FINAL_REPLIES):
            call.answers.put(reply)
            return
        self.forget(call)
        if isinstance(reply, Welcome):
            self._enter(reply.session, now)
        call.end(self._final_answer(call, reply))

    def tick(self, now: float) -> bool:
        """Ends calls that took too long; returns whether to reconnect."""
        for call in list(self._calls.values()):
            if now >= call.stop_at:
                sentence = f"{call} has not ended within {call.limit:g} s; it may still go on."
            elif now >= call.heard + call.patience:
                sentence = (
                    f"Nothing was heard about {call} from {self._peer} for {call.patience:g} s: "
                    "no robot daemon runs there, or the link is cut."
                )
            else:
                continue
            self.forget(call)
            call.end(RobotUnreachableError(sentence))
        if not self._expecting or now < self._heard + RECONNECT:
            return False
        self._heard = now
        for call in self._calls.values():
            call.due = now
        self._beat_at = now
        return True

    def fail(self, sentence: str) -> None:
        """Ends every call with a ``RobotUnreachableError``."""
        for call in list(self._calls.values()):
            self.forget(call)
            call.end(RobotUnreachableError(sentence))

    def _final_answer(self, call: Call, reply: Reply | ErrorReply) -> Answer:
        if isinstance(reply, ErrorReply):
            return reply.to_error(self._peer)
        if isinstance(reply, ObservationReply):
            if reply.sequence <= call.after_sequence:
                return RobotError(
                    "stale",
                    f"{call} was answered with observation {reply.sequence}, although "
                    f"{call.after_sequence} was seen before.",
                )
            self._sequence = max(self._sequence, reply.sequence)
        return reply

    def _enter(self, session: str, now: float) -> None:
        if session == self.session:
            return
        if self.session is not None:
            self._leave()
        self.session = session
        self._beat_id = next(self.loose_ids)  # late answers to an old heartbeat do not fit
        beat = Heartbeat(id=self._beat_id, client=self._client, session=session)
        self._beat_frame = encode(beat.to_map())
        self._beat_at = now + HEARTBEAT

    def _leave(self) -> None:
        self.session = None
        self._sequence = 0
        for call in list(self._calls.values()):
            if isinstance(call.request, SessionRequest):
                self.forget(call)
                call.end(self._lost(call))

    def _lost(self, call: Call) -> BodyschemaError:
        return RobotRestartedError(
            f"The daemon at {self._peer} restarted, or forgot this client: whether {call} was "
            "carried out is unknown. Look at the robot, say hello again, and decide."
        )
