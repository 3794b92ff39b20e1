"""The client's rules, tried by calling functions; time passes by hand."""

from __future__ import annotations

from typing import Any

import pytest

from protocol.errors import (
    ERROR_CODES,
    LocalProtocolError,
    RobotError,
    RobotRestartedError,
    RobotUnreachableError,
)
from protocol.rules.client_core import FIRST_LOOSE_ID, Answer, Call, ClientCore
from protocol.wire.codec import decode, encode
from protocol.wire.declaration import Message
from protocol.wire.messages import (
    Accepted,
    ErrorReply,
    Hello,
    ObservationReply,
    Ok,
    Perform,
    Progress,
    Read,
    Request,
    Stop,
    Welcome,
)

BEAT = FIRST_LOOSE_ID  # of the first session's heartbeats
LOOSE = FIRST_LOOSE_ID + 100


class ClientCoreBench:
    """A client core; the test plays the robot."""

    def __init__(self, capabilities: Any):
        self.now = 100.0
        self.capabilities = capabilities
        self.core = ClientCore("c", peer="tcp://robot:1", now=self.now)

    def ask(self, request: Request, *, patience: float = 10.0, **options: Any) -> Call:
        call = Call(request, patience=patience, **options)
        self.core.ask(call, self.now)
        return call

    def send(self) -> list[dict[str, Any]]:
        """What goes out now."""
        frames = self.core.frames(self.now)
        for frame in frames:
            self.core.sent(frame, self.now)
        return [decode(frame) for frame in frames]

    def step(self, seconds: float, by: float = 0.5) -> list[tuple[float, str]]:
        """Lets time pass; what went out when, and ``reconnect`` where that was called for."""
        end = self.now + seconds
        steps: list[tuple[float, str]] = []
        while self.now < end:
            self.now += by
            self.core.wake(self.now)
            if self.core.tick(self.now):
                steps.append((self.now, "reconnect"))
            steps += [(self.now, frame["type"]) for frame in self.send()]
        return steps

    def answer(self, message: Message) -> None:
        self.core.receive(encode(message.to_map()), self.now)

    def open(self, session: str = "s") -> None:
        self.ask(Hello(id=LOOSE, client="c", versions=(1,)))
        self.send()
        self.answer(
            Welcome(
                id=LOOSE,
                version=1,
                session=session,
                robot_time=0.0,
                capabilities=self.capabilities,
            )
        )


def perform(number: int, session: str = "s") -> Perform:
    return Perform(id=number, client="c", session=session, targets={"a": 0.0})


def read(number: int) -> Read:
    return Read(id=number, client="c", session="s")


def observation(number: int, sequence: int) -> ObservationReply:
    return ObservationReply(
        id=number,
        sequence=sequence,
        robot_time=0.0,
        monotonic=0.0,
        angles={},
        saturated_joints=(),
        clearance_saturated=False,
        settled=True,
        settle_time=0.0,
        samples=1,
    )


def answers(call: Call) -> list[Answer]:
    return [call.answers.get_nowait() for _ in range(call.answers.qsize())]


@pytest.fixture
def bench(capabilities: Any) -> ClientCoreBench:
    return ClientCoreBench(capabilities)


@pytest.fixture
def opened(bench: ClientCoreBench) -> ClientCoreBench:
    bench.open()
    return bench


def test_the_words_of_a_motion_arrive_in_order(opened: ClientCoreBench) -> None:
    call = opened.ask(perform(1))
    assert [frame["type"] for frame in opened.send()] == ["perform"]
    progress = Progress(id=1, phase="moving", fraction=0.5, robot_time=1.0)
    for message in (Accepted(id=1), progress, observation(1, 1), observation(1, 1)):
        opened.answer(message)
    assert answers(call) == [Accepted(id=1), progress, observation(1, 1)]


def test_a_heartbeat_goes_out_every_second_from_hello_on(opened: ClientCoreBench) -> None:
    assert opened.send() == []
    beats = []
    for _ in range(5):
        beats += opened.step(1.0)
        opened.answer(Ok(id=BEAT, state="idle"))
    assert beats == [(101.0 + second, "heartbeat") for second in range(5)]


def test_nothing_is_said_unasked_before_hello(bench: ClientCoreBench) -> None:
    assert bench.step(20.0) == []


def test_an_unanswered_request_is_repeated_with_the_same_frame(opened: ClientCoreBench) -> None:
    opened.ask(perform(1), patience=60.0)
    first = opened.send()
    opened.step(1.5)
    opened.now += 0.5
    again = [frame for frame in opened.send() if frame["type"] == "perform"]
    assert again == first


def test_progress_postpones_the_repetition(opened: ClientCoreBench) -> None:
    opened.ask(perform(1), patience=60.0)
    opened.send()
    opened.step(1.5)
    opened.answer(Accepted(id=1))
    assert "perform" not in [kind for _, kind in opened.step(1.5)]
    assert "perform" in [kind for _, kind in opened.step(0.5)]


def test_frames_that_could_not_leave_stay_due_in_the_order_of_asking(
    opened: ClientCoreBench,
) -> None:
    opened.ask(perform(1))
    opened.ask(perform(2))
    opened.now += 0.1
    assert [decode(frame)["id"] for frame in opened.core.frames(opened.now)] == [1, 2]
    assert opened.core.send_at <= opened.now


def test_silence_about_a_request_ends_it(opened: ClientCoreBench) -> None:
    call = opened.ask(perform(1), patience=10.0)
    opened.step(9.5)
    assert answers(call) == []
    opened.step(0.5)
    (error,) = answers(call)
    assert isinstance(error, RobotUnreachableError)
    assert "perform (request 1)" in str(error)
    assert "tcp://robot:1" in str(error)


def test_a_motion_may_take_longer_than_the_patience_but_not_than_the_limit(
    opened: ClientCoreBench,
) -> None:
    call = opened.ask(perform(1), patience=3.0, limit=20.0)
    for _ in range(9):
        opened.step(2.0)
        opened.answer(Accepted(id=1))
    opened.step(1.5)
    assert answers(call) == [Accepted(id=1)] * 9
    opened.step(0.5)
    (error,) = answers(call)
    assert isinstance(error, RobotUnreachableError)
    assert "within 20 s" in str(error)


def test_without_any_word_the_connection_is_made_anew_every_three_seconds(
    opened: ClientCoreBench,
) -> None:
    opened.ask(perform(1), patience=60.0)
    opened.send()
    happened = opened.step(7.0)
    assert [moment for moment, kind in happened if kind == "reconnect"] == [103.0, 106.0]
    for moment in (103.0, 106.0):  # and everything is said again at once
        assert {(moment, "perform"), (moment, "heartbeat")} <= set(happened)


def test_being_suspended_is_not_the_robots_silence(opened: ClientCoreBench) -> None:
    call = opened.ask(perform(1), patience=10.0)
    opened.send()
    opened.now += 3600.0
    opened.core.wake(opened.now)
    assert not opened.core.tick(opened.now)
    assert answers(call) == []


def test_a_long_rest_before_hello_costs_no_patience(bench: ClientCoreBench) -> None:
    bench.now += 3600.0
    bench.core.wake(bench.now)
    call = bench.ask(Stop(id=LOOSE, client="c"), patience=10.0)
    assert not bench.core.tick(bench.now)
    bench.step(10.0)
    assert isinstance(answers(call)[0], RobotUnreachableError)


@pytest.mark.parametrize("through", ["heartbeat", "request"])
def test_a_lost_session_ends_everything_and_nothing_is_repeated(
    opened: ClientCoreBench, through: str
) -> None:
    moving, reading = opened.ask(perform(1)), opened.ask(read(2))
    opened.send()
    lost = RobotError("restarted", "Unknown.")
    number = BEAT if through == "heartbeat" else 2
    opened.answer(ErrorReply.of(lost, request_id=number))
    for call, name in ((moving, "perform (request 1)"), (reading, "read (request 2)")):
        (error,) = answers(call)
        assert isinstance(error, RobotRestartedError)
        assert name in str(error)
    assert opened.step(10.0) == []
    refused = opened.ask(perform(3))
    assert isinstance(answers(refused)[0], RobotRestartedError)
    assert opened.step(3.0) == []
    opened.open("another")
    assert opened.core.session == "another"
    stale = opened.ask(perform(4))  # made for the old session
    assert isinstance(answers(stale)[0], RobotRestartedError)


def test_an_answer_to_a_heartbeat_of_the_last_session_does_not_end_this_one(
    opened: ClientCoreBench,
) -> None:
    opened.step(1.5)
    opened.open("another")  # before the new daemon has answered the heartbeat
    lost = RobotError("restarted", "Unknown.")
    opened.answer(ErrorReply.of(lost, request_id=BEAT))
    assert opened.core.session == "another"
    opened.now += 1.5
    (beat,) = opened.send()
    assert beat["session"] == "another"
    opened.answer(ErrorReply.of(lost, request_id=beat["id"]))
    assert opened.core.session is None


def test_stop_survives_a_lost_session(opened: ClientCoreBench) -> None:
    stop = opened.ask(Stop(id=LOOSE, client="c"))
    opened.answer(ErrorReply.of(RobotError("restarted", "Unknown."), request_id=BEAT))
    assert [frame["type"] for frame in opened.send()] == ["stop"]
    opened.answer(Ok(id=LOOSE, state="stopped"))
    assert answers(stop) == [Ok(id=LOOSE, state="stopped")]


def test_an_observation_seen_before_is_stale_for_a_new_request(opened: ClientCoreBench) -> None:
    first = opened.ask(perform(1))
    opened.answer(observation(1, 5))
    assert answers(first) == [observation(1, 5)]
    for number, sequence in ((2, 5), (3, 4)):
        again = opened.ask(read(number))
        opened.answer(observation(number, sequence))
        (error,) = answers(again)
        assert isinstance(error, RobotError)
        assert error.code == "stale"
    fresh = opened.ask(read(4))
    opened.answer(observation(4, 6))
    assert answers(fresh) == [observation(4, 6)]


def test_a_repeated_request_may_bring_its_old_observation(opened: ClientCoreBench) -> None:
    for number, sequence in ((1, 1), (2, 2), (1, 1)):
        call = opened.ask(perform(number))
        opened.answer(observation(number, sequence))
        assert answers(call) == [observation(number, sequence)]


def test_one_id_cannot_be_under_way_twice(opened: ClientCoreBench) -> None:
    first, second = opened.ask(perform(1)), opened.ask(perform(1))
    assert isinstance(answers(second)[0], LocalProtocolError)
    opened.core.forget(second)
    opened.answer(observation(1, 1))
    assert answers(first) == [observation(1, 1)]


def test_errors_come_as_exceptions(opened: ClientCoreBench) -> None:
    call = opened.ask(perform(1))
    sent = RobotError("busy", "The robot moves.", advice="Wait.")
    opened.answer(ErrorReply.of(sent, request_id=1))
    (error,) = answers(call)
    assert isinstance(error, RobotError)
    assert (error.code, error.message, error.advice) == ("busy", "The robot moves.", "Wait.")
    assert error.retryable


@pytest.mark.parametrize(
    "code", [code for code, kind in ERROR_CODES.items() if "URI" in kind.advice]
)
def test_a_command_in_an_advice_names_the_robot(opened: ClientCoreBench, code: str) -> None:
    call = opened.ask(perform(1))
    opened.answer(ErrorReply.of(RobotError(code, "No."), request_id=1))
    (error,) = answers(call)
    assert isinstance(error, RobotError)
    assert "python -m protocol tcp://robot:1 " in error.advice


@pytest.mark.parametrize("retryable", [True, False])
def test_an_error_code_of_a_later_version_is_taken_by_its_retryable(
    opened: ClientCoreBench, retryable: bool
) -> None:
    call = opened.ask(Read(id=1, client="c", session="s"))
    reply = ErrorReply(id=1, code="overheated", message="Hot.", advice="Wait.", retryable=retryable)
    opened.answer(reply)
    error = call.answers.get_nowait()
    assert isinstance(error, RobotError)
    assert (error.code, str(error), error.retryable) == ("overheated", "Hot. Wait.", retryable)


def test_answers_nobody_waits_for_and_garbage_change_nothing(opened: ClientCoreBench) -> None:
    call = opened.ask(perform(1))
    opened.answer(observation(99, 1))
    opened.answer(ErrorReply.of(RobotError("malformed", "What?"), request_id=None))
    for frame in (b"", b"\xc1", encode({"type": "ok", "id": 1}), encode({"type": "dance"})):
        opened.core.receive(frame, opened.now)
    assert opened.core.garbage == 4
    assert answers(call) == []
