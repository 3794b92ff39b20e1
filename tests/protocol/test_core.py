"""The rules of the wire, tried by calling functions; time passes by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.actions import Action, ControllerChanged, Send, Silence, Submit
from protocol.capabilities import Capabilities
from protocol.codec import decode, encode
from protocol.core import MAX_READS, ServerCore
from protocol.errors import RobotError
from protocol.messages import ErrorReply, Observation, Ok, Perform, Request
from protocol.outcomes import MAX_CLIENTS, MAX_OUTCOMES
from protocol.robot import Finished, Progressed, Snapshot
from protocol.roles import Role
from protocol.states import State

A = TypeVar("A")
TARGETS = {"a": 0.1, "b": -0.1}


def observation(request_id: int, sequence: int = 1) -> Observation:
    return Observation(
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


class Bench:
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
        found = {"type": kind, "id": number, "client": client, **fields}
        if kind not in ("hello", "stop") and "session" not in found:
            found["session"] = self.sessions[client]
        return self.core.receive(peer, encode(found), self.now, user)

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
    (found,) = [action for action in actions if isinstance(action, kind)]
    return found


@pytest.fixture
def bench(capabilities: Capabilities) -> Bench:
    return Bench(capabilities)


# --- sessions -------------------------------------------------------------------------------------


def test_a_client_keeps_its_session_and_others_get_another(bench: Bench) -> None:
    first = bench.hello("c")
    assert first["version"] == 1
    assert Capabilities.of(first["capabilities"]).robot == "fake"
    assert bench.hello("c", peer=b"new connection")["session"] == first["session"]
    assert bench.hello("d")["session"] != first["session"]


def test_sessions_cannot_be_guessed(capabilities: Capabilities) -> None:
    cores = [ServerCore(capabilities, view=Bench.view) for _ in range(2)]
    frame = encode({"type": "hello", "id": 0, "client": "c", "versions": [1]})
    sessions = [Bench.reply(core.receive(b"p", frame, 0.0))["session"] for core in cores]
    assert sessions[0] != sessions[1]
    assert all(len(session) >= 32 for session in sessions)


@pytest.mark.parametrize(
    ("versions", "code"),
    [([1], None), ([3, 2, 1], None), ([2], "unsupported_version"), ([], "unsupported_version")],
)
def test_versions(bench: Bench, versions: list[int], code: str | None) -> None:
    assert bench.reply(bench.send("c", "hello", 0, versions=versions)).get("code") == code


def test_an_unknown_session_is_answered_restarted_and_nothing_moves(bench: Bench) -> None:
    bench.control()
    for client, session in (("c", "old"), ("stranger", "session-0")):
        actions = bench.send(client, "perform", 5, targets=TARGETS, session=session)
        assert bench.reply(actions)["code"] == "restarted"
        assert bench.reply(actions)["id"] == 5


def test_the_client_not_heard_of_for_longest_makes_room(bench: Bench) -> None:
    bench.control("controller")
    for number in range(MAX_CLIENTS - 1):
        bench.hello(f"viewer-{number}")
    bench.send("viewer-0", "heartbeat", 0)
    bench.hello("viewer-1")
    bench.hello("late")
    assert bench.reply(bench.send("viewer-2", "heartbeat", 0))["code"] == "restarted"
    for client in ("controller", "viewer-0", "viewer-1", "viewer-3", "late"):
        assert bench.reply(bench.send(client, "heartbeat", 0))["type"] == "status"


def test_clients_with_requests_under_way_stay(bench: Bench) -> None:
    for number in range(MAX_CLIENTS):
        bench.hello(f"c{number}")
        one(Submit, bench.send(f"c{number}", "read", 1))
    assert bench.hello("late")["code"] == "too_many_clients"
    assert len(bench.core.finish(Finished(ticket=7, reply=observation(1)))) == 1
    assert bench.hello("late")["type"] == "welcome"
    assert bench.reply(bench.send("c6", "read", 1))["code"] == "restarted"


def test_another_user_cannot_take_a_client_over(bench: Bench) -> None:
    assert bench.hello("c", user="ann")["type"] == "welcome"
    session = bench.sessions["c"]
    assert bench.hello("c", user="bob")["code"] == "unauthorised"
    stolen = bench.send("c", "heartbeat", 0, session=session, user="bob")
    assert bench.reply(stolen)["code"] == "unauthorised"


def test_every_request_is_authorised_replays_too(capabilities: Capabilities) -> None:
    allowed = {"hello", "acquire", "perform"}

    def authorise(user: str | None, request: Request) -> None:
        if request.TYPE not in allowed:
            raise RobotError("unauthorised", f"{user} may not {request.TYPE}.")

    bench = Bench(capabilities, authorise=authorise)
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    allowed.clear()
    for kind, fields in (("perform", {"targets": TARGETS}), ("stop", {}), ("heartbeat", {})):
        reply = bench.reply(bench.send("c", kind, 2, **fields))
        assert (reply["code"], reply["message"]) == ("unauthorised", f"None may not {kind}.")


def test_a_user_who_crowds_in_pushes_out_nobody_else(bench: Bench) -> None:
    bench.hello("bob", user="bob")  # not heard of for longest
    for number in range(MAX_CLIENTS + 10):
        assert bench.hello(f"eve-{number}", user="eve")["type"] == "welcome"
    assert bench.reply(bench.send("bob", "heartbeat", 0, user="bob"))["type"] == "status"
    gone = bench.reply(bench.send("eve-0", "heartbeat", 0, user="eve"))
    assert gone["code"] == "restarted"


def test_a_user_who_watches_has_few_reads_under_way(bench: Bench) -> None:
    bench.hello("bob", user="bob")
    bench.hello("bob2", user="bob")
    bench.hello("ann", user="ann")
    bench.send("ann", "acquire", 1, user="ann")
    for number in range(MAX_READS):
        one(Submit, bench.send("bob", "read", number, user="bob"))
    for client in ("bob", "bob2"):
        refused = bench.reply(bench.send(client, "read", 100, user="bob"))
        assert (refused["code"], refused["retryable"]) == ("busy", True)
    for number in range(2, 2 + 2 * MAX_READS):  # the controller is not bounded by that
        one(Submit, bench.send("ann", "read", number, user="ann"))
    bench.core.finish(Finished(ticket=1, reply=observation(0)))
    one(Submit, bench.send("bob2", "read", 101, user="bob"))


def roles(**found: Role) -> Callable[[str | None], Role | None]:
    return lambda user: found.get(user or "")


def test_a_user_who_may_no_longer_control_loses_control(bench: Bench) -> None:
    bench.hello("c", user="ann")
    bench.send("c", "acquire", 1, user="ann")
    controllers = [bench.core.controller]
    assert bench.core.review(roles(ann=Role.CONTROLLER)) == []
    controllers.append(bench.core.controller)
    assert bench.core.review(roles(ann=Role.VIEWER)) == [ControllerChanged(None)]
    controllers.append(bench.core.controller)
    assert controllers == ["c", "c", None]
    assert bench.reply(bench.send("c", "heartbeat", 0, user="ann"))["type"] == "status"
    assert bench.core.review(roles(ann=Role.VIEWER)) == []


def test_a_user_who_is_gone_is_forgotten_in_mid_motion(bench: Bench) -> None:
    bench.hello("c", user="ann")
    bench.hello("d", user="bob")
    bench.send("c", "acquire", 1, user="ann")
    perform = bench.send("c", "perform", 2, user="ann", targets=TARGETS)
    ticket = one(Submit, perform).ticket
    bench.core.accept(ticket)
    actions = bench.core.review(roles(bob=Role.VIEWER))
    assert actions == [Silence(), ControllerChanged(None)]
    event = Progressed(ticket=ticket, phase="moving", fraction=0.5, robot_time=1.0)
    assert bench.core.progress(event) == []  # nobody hears it any more
    assert bench.core.finish(Finished(ticket=ticket, reply=observation(2))) == []
    forgotten = bench.reply(bench.send("c", "read", 3, user="ann"))
    assert forgotten["code"] == "restarted"
    assert bench.reply(bench.send("d", "heartbeat", 0, user="bob"))["type"] == "status"


def test_names_cannot_play_tricks_on_a_terminal(bench: Bench) -> None:
    bench.hello("c\x1b[2J", software="evil\r\n1")
    bench.send("c\x1b[2J", "acquire", 1)
    bench.hello("d")
    sentence = bench.reply(bench.send("d", "acquire", 1))["message"]
    assert sentence == "evil??1 (client c?[2J) holds the robot."


# --- ids ------------------------------------------------------------------------------------------


def test_a_retry_gets_progress_then_the_first_outcome_and_never_moves_again(bench: Bench) -> None:
    bench.control()
    ticket = bench.perform(2)

    def retry(peer: bytes) -> Send:
        (action,) = bench.send("c", "perform", 2, targets=TARGETS, peer=peer)
        assert isinstance(action, Send)
        assert action.peer == peer
        return action

    assert decode(retry(b"second").frame)["type"] == "accepted"
    event = Progressed(ticket=ticket, phase="moving", fraction=0.5, robot_time=2.0)
    assert one(Send, bench.core.progress(event)).peer == b"second"
    assert decode(retry(b"third").frame)["phase"] == "moving"
    end = one(Send, bench.core.finish(Finished(ticket=ticket, reply=observation(2))))
    assert end.peer == b"third"
    assert retry(b"fourth").frame == end.frame


def test_the_order_of_targets_and_the_kind_of_number_do_not_matter(bench: Bench) -> None:
    bench.control()
    first = one(Submit, bench.send("c", "perform", 2, targets={"a": 0.0, "b": 0.5}))
    bench.core.accept(first.ticket)
    again = bench.send("c", "perform", 2, targets={"b": 0.5, "a": 0}, extra=1)
    assert bench.reply(again)["type"] == "accepted"


@pytest.mark.parametrize(
    ("kind", "fields"),
    [("perform", {"targets": {"a": 0.1, "b": 0.2}}), ("read", {}), ("acquire", {})],
)
def test_another_request_with_the_same_id_is_refused(
    bench: Bench, kind: str, fields: dict[str, Any]
) -> None:
    bench.control()
    bench.perform(2)
    assert bench.reply(bench.send("c", kind, 2, **fields))["code"] == "id_reused"


def test_an_overtaken_id_is_never_executed(bench: Bench) -> None:
    bench.control()
    bench.perform(7)
    reply = bench.reply(bench.send("c", "perform", 6, targets=TARGETS))
    assert (reply["code"], reply["id"]) == ("expired", 6)


def test_errors_are_outcomes_too(bench: Bench) -> None:
    bench.hello("c")
    refused = bench.reply(bench.send("c", "perform", 1, targets=TARGETS))
    assert refused["code"] == "not_controller"
    bench.send("c", "acquire", 2)
    assert bench.reply(bench.send("c", "perform", 1, targets=TARGETS)) == refused
    submitted = one(Submit, bench.send("c", "perform", 3, targets=TARGETS))
    error = ErrorReply.of(RobotError("busy", "Busy."), request_id=3)
    bench.core.finish(Finished(ticket=submitted.ticket, reply=error))
    assert bench.reply(bench.send("c", "perform", 3, targets=TARGETS))["code"] == "busy"


def test_outcomes_survive_release_and_are_forgotten_oldest_first(bench: Bench) -> None:
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    bench.send("c", "release", 3)
    last = 2 + MAX_OUTCOMES - 1
    for number in range(4, last + 1):
        bench.send("c", "acquire", number)
    assert bench.reply(bench.send("c", "perform", 2, targets=TARGETS))["type"] == "observation"
    bench.send("c", "acquire", last + 1)
    assert bench.reply(bench.send("c", "perform", 2, targets=TARGETS))["code"] == "expired"
    assert bench.reply(bench.send("c", "release", 3))["type"] == "ok"


def test_a_request_under_way_is_never_forgotten(bench: Bench) -> None:
    bench.control()
    ticket = bench.perform(2)
    for number in range(3, 3 + 3 * MAX_OUTCOMES):
        bench.send("c", "acquire", number)
    bench.core.finish(Finished(ticket=ticket, reply=observation(2)))
    assert bench.reply(bench.send("c", "perform", 2, targets=TARGETS))["type"] == "observation"


def test_too_many_requests_under_way(bench: Bench) -> None:
    bench.hello("c")
    for number in range(MAX_OUTCOMES):
        one(Submit, bench.send("c", "read", number))
    assert bench.reply(bench.send("c", "read", 100))["code"] == "busy"
    bench.core.finish(Finished(ticket=1, reply=observation(0)))
    one(Submit, bench.send("c", "read", 100))


def test_an_answer_with_the_wrong_id_is_a_bug(bench: Bench) -> None:
    bench.control()
    ticket = bench.perform(2)
    with pytest.raises(ValueError, match="request 2 was answered with id 3"):
        bench.core.finish(Finished(ticket=ticket, reply=observation(3)))


steps = st.lists(
    st.tuples(
        st.sampled_from(["send", "send", "lose", "end", "forget"]),
        st.integers(1, 90),
        st.sampled_from([0.1, 0.2]),
    ),
    max_size=120,
)


@given(steps)
@settings(max_examples=60, deadline=None)
def test_no_order_of_frames_executes_an_id_twice(
    capabilities: Capabilities, script: list[tuple[str, int, float]]
) -> None:
    """Frames lost, repeated, reordered, changed; answers early or late."""
    bench = Bench(capabilities)
    bench.control()
    executed: dict[int, dict[str, float]] = {}
    under_way: list[tuple[int, int]] = []
    outcomes: dict[int, bytes] = {}
    for what, number, angle in script:
        if what == "send":
            actions = bench.send("c", "perform", number + 1, targets={"a": angle, "b": 0.0})
            for action in actions:
                if isinstance(action, Submit):
                    assert isinstance(action.request, Perform)
                    assert action.request.id not in executed
                    assert action.request.id > max(executed, default=0)
                    executed[action.request.id] = dict(action.request.targets)
                    bench.core.accept(action.ticket)
                    under_way.append((action.ticket, action.request.id))
                elif isinstance(action, Send):
                    reply = decode(action.frame)
                    if reply["type"] == "observation":
                        assert executed[reply["id"]]["a"] == angle
                        assert outcomes[reply["id"]] == action.frame
        elif what == "end" and under_way:
            ticket, request_id = under_way.pop(number % len(under_way))
            reply_to = observation(request_id, sequence=len(outcomes) + 1)
            (sent,) = bench.core.finish(Finished(ticket=ticket, reply=reply_to))
            outcomes[request_id] = sent.frame
        elif what == "forget":
            bench.hello(f"viewer-{number}")


# --- control --------------------------------------------------------------------------------------


def test_one_controller_at_a_time_and_the_second_is_told_who(bench: Bench) -> None:
    bench.hello("c", software="estimator 1")
    changed = one(ControllerChanged, bench.send("c", "acquire", 1))
    assert changed.client == "c"
    bench.hello("d")
    held = bench.reply(bench.send("d", "acquire", 1))
    assert held["code"] == "held"
    assert "estimator 1 (client c)" in held["message"]
    assert held["retryable"]
    assert bench.reply(bench.send("c", "acquire", 2))["type"] == "ok"  # has it already
    actions = bench.send("c", "release", 3)
    assert one(ControllerChanged, actions).client is None
    assert bench.reply(bench.send("d", "acquire", 1)) == held  # the first outcome stands
    assert one(ControllerChanged, bench.send("d", "acquire", 2)).client == "d"


@pytest.mark.parametrize("kind", ["perform", "hold", "relax", "clear", "release"])
def test_only_the_controller_may(bench: Bench, kind: str) -> None:
    bench.control("c")
    bench.hello("d")
    fields = {"targets": TARGETS} if kind == "perform" else {}
    reply = bench.reply(bench.send("d", kind, 1, **fields))
    assert reply["code"] == "not_controller"
    assert "client c" in reply["message"]


def test_anybody_may_read_and_stop(bench: Bench) -> None:
    bench.control("c")
    bench.hello("d")
    assert one(Submit, bench.send("d", "read", 1)).request.TYPE == "read"
    stop = one(Submit, bench.send("stranger", "stop", 0))
    assert stop.request.TYPE == "stop"
    bench.core.accept(stop.ticket)
    reply = bench.core.finish(Finished(ticket=stop.ticket, reply=Ok(id=0, state="stopped")))
    assert one(Send, reply).peer == b"stranger"


def test_stop_and_heartbeat_need_no_fresh_id(bench: Bench) -> None:
    bench.control()
    bench.perform(9)
    for _ in range(2):
        assert bench.reply(bench.send("c", "heartbeat", 9))["type"] == "status"
        one(Submit, bench.send("c", "stop", 9))


@pytest.mark.parametrize(
    ("targets", "code", "named"),
    [
        ({"a": 0.0}, "bad_targets", "b"),
        ({}, "bad_targets", "a, b"),
        ({"a": 0.0, "b": 0.0, "c": 0.0}, "bad_targets", "c"),
        ({"a": 0.0, "b": 0.6001}, "out_of_range", "b"),
        ({"a": -0.6001, "b": 0.0}, "out_of_range", "a"),
    ],
)
def test_targets_that_do_not_fit_never_reach_the_robot(
    bench: Bench, targets: dict[str, float], code: str, named: str
) -> None:
    bench.control()
    reply = bench.reply(bench.send("c", "perform", 2, targets=targets))
    assert reply["code"] == code
    assert f" {named}" in reply["message"]


def test_a_limit_itself_is_within_reach(bench: Bench) -> None:
    bench.control()
    one(Submit, bench.send("c", "perform", 2, targets={"a": 0.6, "b": -0.6}))


def test_a_silent_controller_is_told_to_the_robot_once_then_loses_control(bench: Bench) -> None:
    bench.control()
    deadlines = [bench.core.deadline]
    assert bench.core.tick(104.9) == []
    assert bench.core.tick(105.0) == [Silence()]
    assert bench.core.tick(129.9) == []
    deadlines.append(bench.core.deadline)
    assert bench.core.tick(130.0) == [ControllerChanged(None)]
    deadlines.append(bench.core.deadline)
    assert deadlines == [105.0, 130.0, None]
    assert bench.core.tick(1000.0) == []


def test_a_stall_of_the_daemon_reports_both(bench: Bench) -> None:
    bench.control()
    assert bench.core.tick(500.0) == [Silence(), ControllerChanged(None)]


def test_any_word_ends_the_silence_and_a_new_one_is_told_again(bench: Bench) -> None:
    bench.control()
    bench.core.tick(106.0)
    bench.now = 129.0
    bench.send("c", "heartbeat", 0)
    assert bench.core.tick(133.9) == []
    assert bench.core.controller == "c"
    assert bench.core.tick(134.0) == [Silence()]


@pytest.mark.parametrize("kind", ["stop", "hello-of-another", "garbage", "old-session"])
def test_other_frames_are_no_sign_of_life(bench: Bench, kind: str) -> None:
    bench.control()
    bench.now = 104.0
    if kind == "stop":
        bench.send("c", "stop", 0)
    elif kind == "hello-of-another":
        bench.hello("d")
    elif kind == "garbage":
        bench.core.receive(b"c", b"\xc1", bench.now)
    else:
        bench.send("c", "heartbeat", 0, session="old")
    assert bench.core.tick(105.0) == [Silence()]


def test_letting_go_in_mid_motion_lets_the_robot_hold(bench: Bench) -> None:
    bench.control()
    bench.perform(2)
    actions = bench.send("c", "release", 3)
    assert actions[:2] == [Silence(), ControllerChanged(None)]


def test_letting_go_at_rest_is_no_silence(bench: Bench) -> None:
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    assert bench.send("c", "release", 3)[0] == ControllerChanged(None)


# --- garbage --------------------------------------------------------------------------------------


@given(frame=st.binary(max_size=100))
def test_garbage_is_answered_and_counted(capabilities: Capabilities, frame: bytes) -> None:
    core = ServerCore(capabilities, view=Bench.view)
    reply = Bench.reply(core.receive(b"p", frame, 0.0))
    assert reply["type"] == "error"
    assert reply["code"] in ("malformed", "unknown_type")
    assert core.garbage == 1


def test_an_oversized_frame_is_answered(bench: Bench) -> None:
    reply = bench.reply(bench.core.receive(b"p", b"x" * 65_537, 0.0))
    assert reply["code"] == "too_large"
    assert "id" not in reply


@given(
    st.dictionaries(
        st.sampled_from(["type", "id", "client", "session", "targets"]),
        st.none()
        | st.integers()
        | st.text()
        | st.floats()
        | st.binary()
        | st.sampled_from(["hello", "perform", "read", "heartbeat"]),
    )
)
def test_maps_of_the_wrong_shape_are_answered(
    capabilities: Capabilities, found: dict[str, Any]
) -> None:
    core = ServerCore(capabilities, view=Bench.view)
    try:
        frame = msgpack.packb(found)
    except (OverflowError, ValueError):
        return
    assert Bench.reply(core.receive(b"p", frame, 0.0))["type"] == "error"


def test_telemetry_names_the_controller(bench: Bench) -> None:
    assert "controller" not in decode(bench.core.publication())
    bench.control()
    assert decode(bench.core.publication())["controller"] == "c"
