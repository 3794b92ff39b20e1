"""Who is who to the server core, and for how long; called as functions."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from protocol.errors import RobotError
from protocol.rules.at_most_once import MAX_CLIENTS
from protocol.rules.control import Role
from protocol.rules.robot_interface import Finished, Progressed
from protocol.rules.server_core import MAX_READS, ControllerChanged, ServerCore, Silence, Submit
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import encode
from protocol.wire.messages import Request
from tests.protocol.rules.core_bench import TARGETS, ServerCoreBench, observation, one


def test_a_client_keeps_its_session_and_others_get_another(bench: ServerCoreBench) -> None:
    first = bench.hello("c")
    assert first["version"] == 1
    assert Capabilities.from_map(first["capabilities"]).robot == "fake"
    assert bench.hello("c", peer=b"new connection")["session"] == first["session"]
    assert bench.hello("d")["session"] != first["session"]


def test_sessions_cannot_be_guessed(capabilities: Capabilities) -> None:
    cores = [ServerCore(capabilities, view=ServerCoreBench.view) for _ in range(2)]
    frame = encode({"type": "hello", "id": 0, "client": "c", "versions": [1]})
    sessions = [ServerCoreBench.reply(core.receive(b"p", frame, 0.0))["session"] for core in cores]
    assert sessions[0] != sessions[1]
    assert all(len(session) >= 32 for session in sessions)


@pytest.mark.parametrize(
    ("versions", "code"),
    [([1], None), ([3, 2, 1], None), ([2], "unsupported_version"), ([], "unsupported_version")],
)
def test_versions(bench: ServerCoreBench, versions: list[int], code: str | None) -> None:
    assert bench.reply(bench.send("c", "hello", 0, versions=versions)).get("code") == code


def test_an_unknown_session_is_answered_restarted_and_nothing_moves(bench: ServerCoreBench) -> None:
    bench.control()
    for client, session in (("c", "old"), ("stranger", "session-0")):
        actions = bench.send(client, "perform", 5, targets=TARGETS, session=session)
        assert bench.reply(actions)["code"] == "restarted"
        assert bench.reply(actions)["id"] == 5


def test_the_client_not_heard_of_for_longest_makes_room(bench: ServerCoreBench) -> None:
    bench.control("controller")
    for number in range(MAX_CLIENTS - 1):
        bench.hello(f"viewer-{number}")
    bench.send("viewer-0", "heartbeat", 0)
    bench.hello("viewer-1")
    bench.hello("late")
    assert bench.reply(bench.send("viewer-2", "heartbeat", 0))["code"] == "restarted"
    for client in ("controller", "viewer-0", "viewer-1", "viewer-3", "late"):
        assert bench.reply(bench.send(client, "heartbeat", 0))["type"] == "status"


def test_clients_with_requests_under_way_stay(bench: ServerCoreBench) -> None:
    for number in range(MAX_CLIENTS):
        bench.hello(f"c{number}")
        one(Submit, bench.send(f"c{number}", "read", 1))
    assert bench.hello("late")["code"] == "too_many_clients"
    assert len(bench.core.finish(Finished(ticket=7, reply=observation(1)))) == 1
    assert bench.hello("late")["type"] == "welcome"
    assert bench.reply(bench.send("c6", "read", 1))["code"] == "restarted"


def test_another_user_cannot_take_a_client_over(bench: ServerCoreBench) -> None:
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

    bench = ServerCoreBench(capabilities, authorise=authorise)
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    allowed.clear()
    for kind, fields in (("perform", {"targets": TARGETS}), ("stop", {}), ("heartbeat", {})):
        reply = bench.reply(bench.send("c", kind, 2, **fields))
        assert (reply["code"], reply["message"]) == ("unauthorised", f"None may not {kind}.")


def test_a_user_who_crowds_in_pushes_out_nobody_else(bench: ServerCoreBench) -> None:
    bench.hello("bob", user="bob")  # not heard of for longest
    for number in range(MAX_CLIENTS + 10):
        assert bench.hello(f"eve-{number}", user="eve")["type"] == "welcome"
    assert bench.reply(bench.send("bob", "heartbeat", 0, user="bob"))["type"] == "status"
    gone = bench.reply(bench.send("eve-0", "heartbeat", 0, user="eve"))
    assert gone["code"] == "restarted"


def test_a_user_who_watches_has_few_reads_under_way(bench: ServerCoreBench) -> None:
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


def roles(**role_by_user: Role) -> Callable[[str | None], Role | None]:
    return lambda user: role_by_user.get(user or "")


def test_a_user_who_may_no_longer_control_loses_control(bench: ServerCoreBench) -> None:
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


def test_a_user_who_is_gone_is_forgotten_in_mid_motion(bench: ServerCoreBench) -> None:
    bench.hello("c", user="ann")
    bench.hello("d", user="bob")
    bench.send("c", "acquire", 1, user="ann")
    perform = bench.send("c", "perform", 2, user="ann", targets=TARGETS)
    ticket = one(Submit, perform).ticket
    bench.core.accept(ticket)
    actions = bench.core.review(roles(bob=Role.VIEWER))
    assert actions == [Silence(), ControllerChanged(None)]
    assert "key" in one(Silence, actions).reason
    event = Progressed(ticket=ticket, phase="moving", fraction=0.5, robot_time=1.0)
    assert bench.core.progress(event) == []  # nobody hears it any more
    assert bench.core.finish(Finished(ticket=ticket, reply=observation(2))) == []
    forgotten = bench.reply(bench.send("c", "read", 3, user="ann"))
    assert forgotten["code"] == "restarted"
    assert bench.reply(bench.send("d", "heartbeat", 0, user="bob"))["type"] == "status"


def test_names_cannot_play_tricks_on_a_terminal(bench: ServerCoreBench) -> None:
    bench.hello("c\x1b[2J", software="evil\r\n1")
    bench.send("c\x1b[2J", "acquire", 1)
    bench.hello("d")
    sentence = bench.reply(bench.send("d", "acquire", 1))["message"]
    assert sentence == r"evil\r\n1 (client c\x1b[2J) holds the robot."
