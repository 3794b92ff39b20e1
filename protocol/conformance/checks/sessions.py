"""Sections 3 and 4: sessions, and request ids, each of which is carried out at most once."""

from __future__ import annotations

import time
from typing import Final

from protocol.conformance.raw_connection import (
    FINAL,
    GRACE,
    Failed,
    Map,
    Skipped,
    expect,
    said,
)
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient

PLACES: Final = 64
"""Clients that a robot remembers."""


@check("3.2")
def versions(robot: RobotUnderTest) -> None:
    """Version 1 is chosen where it is offered."""
    stranger = robot.stranger()
    for offered in ([1], [7, 1, 3]):
        reply = stranger.hello(versions=offered)
        expect(reply["type"] == "welcome", f"versions {offered} were answered with {said(reply)}.")
        expect(reply["version"] == 1, f"From {offered}, version {reply['version']} was chosen.")


@check("3.3")
def unsupported_versions(robot: RobotUnderTest) -> None:
    """Versions that are not spoken are unsupported_version."""
    stranger = robot.stranger()
    for offered in ([999], []):
        stranger.expect("unsupported_version", "hello", versions=offered)


@check("3.4")
def session_is_needed(robot: RobotUnderTest) -> None:
    """Requests without client or session are malformed."""
    client = robot.client()
    for kind in ("heartbeat", "read", "release"):
        for missing in ("session", "client"):
            client.refused("malformed", f"{kind} without {missing}", kind, **{missing: None})


@check("3.5")
def same_client(robot: RobotUnderTest) -> None:
    """A client keeps its session, over hellos and connections."""
    first = robot.client()
    session = first.session
    first.hello()
    expect(first.session == session, "A second hello brought another session.")
    second = robot.client(first.name)
    expect(second.session == session, "A new connection brought another session.")
    second.status()
    first.status()


@check("3.6", after=("3.8",))
def other_client(robot: RobotUnderTest) -> None:
    """Another client has another session, and no right to this one."""
    first, second = robot.client(), robot.client()
    expect(first.session != second.session, "Two clients have the same session.")
    second.expect("restarted", "heartbeat", session=first.session)


@check("3.7", need=Need.MOTION)
def a_crowd(robot: RobotUnderTest) -> None:
    """64 clients are remembered, and a 65th pushes out the one not heard of for longest."""
    first = robot.client()
    for number in range(PLACES - 1):
        robot.client(f"{first.name}-crowd-{number}")
    first.status()
    for number in range(PLACES - 1):
        robot.client(f"{first.name}-crowd-{number}")  # heard of again: first is the oldest now
    latecomer = robot.client(f"{first.name}-late")
    first.expect("restarted", "heartbeat")
    latecomer.status()


@check("3.7", need=Need.MOTION, after=("5.1",))
def a_crowd_and_the_controller(robot: RobotUnderTest) -> None:
    """A crowd never pushes out the controller."""
    with robot.controlled() as controller:
        for number in range(PLACES + 1):
            robot.client(f"{controller.name}-crowd-{number}")
        expect(
            controller.status().get("controller") == controller.name,
            "A crowd of clients took control away.",
        )


@check("3.8")
def unknown_session(robot: RobotUnderTest) -> None:
    """A request in an unknown session is restarted, and nothing else."""
    client = robot.client()
    for kind in ("heartbeat", "read"):
        client.expect("restarted", kind, session="no such session")
    stranger = robot.stranger()
    stranger.session = client.session
    stranger.expect("restarted", "heartbeat")


def _answer_on(
    robot: RobotUnderTest, client: TrialClient, request: Map, *, instead: TrialClient
) -> Map:
    """The final reply on one connection; on another, which asked before, it would be wrong."""
    client.connection.send(request)
    strayed = False
    end = time.monotonic() + robot.settings.motion
    while time.monotonic() < end:
        reply = client.connection.reply(request["id"], patience=GRACE)
        if reply is not None and reply["type"] in FINAL:
            return reply
        if reply is None and strayed:
            break
        stray = instead.connection.reply(request["id"], patience=0.001)
        strayed = strayed or (stray is not None and stray["type"] in FINAL)
    raise Failed(f"It went to {'the connection that had asked before' if strayed else 'nobody'}.")


@check("3.10", after=("4.4",))
def answers_follow(robot: RobotUnderTest) -> None:
    """The answer goes to the connection from which the request last came."""
    first = robot.client()
    second = robot.client(first.name)
    read = first.send("read")
    expect(first.connection.reply(read["id"]) is not None, "A read was not answered.")
    observation = _answer_on(robot, second, read, instead=first)
    _, repeat = second.answer_to(read)
    expect(repeat == observation, f"Asked again, the robot answered {said(repeat)}, not as before.")


MEMORY: Final = 64
"""Outcomes that a robot remembers for each client."""


@check("4.2", after=("4.4",))
def memory(robot: RobotUnderTest) -> None:
    """The last 64 outcomes of a client are remembered."""
    client = robot.client()
    number = client.number()
    outcome = client.harmless(number)
    for _ in range(MEMORY - 1):
        client.harmless(client.number())
    repeat = client.harmless(number)
    expect(repeat == outcome, f"The 64th last outcome came back as {said(repeat)}.")


@check("4.4")
def first_outcome(robot: RobotUnderTest) -> None:
    """The same request again brings the first outcome."""
    client = robot.client()
    read = client.request("read")
    outcomes = [client.answer_to(read)[1] for _ in range(3)]
    expect(outcomes[1:] == outcomes[:-1], "A read under the same id brought another answer.")
    if outcomes[0]["type"] != "observation":
        raise Skipped(f"A read is answered with {said(outcomes[0])} now.")
    newer = client.expect("observation", "read")
    expect(
        newer["sequence"] > outcomes[0]["sequence"], "A repeated read was carried out once more."
    )


@check("4.6", after=("4.4",))
def reused(robot: RobotUnderTest) -> None:
    """Another request under a remembered id is id_reused."""
    client = robot.client()
    number = client.number()
    client.harmless(number)
    client.expect("id_reused", "read", id=number)
    client.expect("id_reused", "acquire", id=number)


@check("4.7", after=("4.4",))
def out_of_order(robot: RobotUnderTest) -> None:
    """A smaller id that was not seen before is out of order, and nothing is executed."""
    client = robot.client()
    skipped = client.number()
    client.harmless(client.number())
    sequence = client.status()["sequence"]
    client.expect("out_of_order", "read", id=skipped)
    client.expect("out_of_order", "release", id=skipped)
    expect(client.status()["sequence"] == sequence, "A read out of order was carried out.")


@check("4.7", after=("4.4",))
def forgotten(robot: RobotUnderTest) -> None:
    """An id that was pushed out of the memory is expired, never executed again."""
    client = robot.client()
    read = client.request("read")
    client.answer_to(read)
    sequence = client.status()["sequence"]
    for _ in range(MEMORY + 1):
        client.harmless(client.number())
    _, repeat = client.answer_to(read)
    expect(
        repeat.get("code") == "expired",
        f"After 65 later outcomes, a read came back as {said(repeat)} instead of expired.",
    )
    expect(client.status()["sequence"] == sequence, "A forgotten read was carried out again.")


@check("4.8", after=("4.4", "4.6"))
def the_same(robot: RobotUnderTest) -> None:
    """The order of keys, and 1 against 1.0, make no other request; another value does."""
    client = robot.client()
    number = client.number()
    first = client.ask("perform", id=number, targets={"no joint": 1, "none": 0.5})
    if first.get("code") == "unauthorised":
        raise Skipped("This key is a viewer's.")
    repeat = client.ask("perform", id=number, targets={"none": 0.5, "no joint": 1.0})
    expect(repeat == first, f"The same targets in another form were answered {said(repeat)}.")
    client.expect("id_reused", "perform", id=number, targets={"no joint": 1, "none": 0.25})


@check("4.9", need=Need.CONTROL, after=("4.4", "5.1"))
def refusals_stand(robot: RobotUnderTest) -> None:
    """What was refused is refused again under its id, although it would be possible now."""
    rival = robot.client()
    number = rival.number()
    refusal = rival.harmless(number)
    with robot.controlled():
        held_reply = rival.ask("acquire", id=(later_number := rival.number()))
    repeat = rival.ask("acquire", id=later_number)
    expect(repeat == held_reply, f"acquire was held, and under the same id {said(repeat)} later.")
    rival.expect("ok", "acquire")
    try:
        repeat = rival.harmless(number)
        expect(repeat == refusal, f"A refused release was {said(repeat)} under the same id later.")
        expect(rival.status().get("controller") == rival.name, "A refused release was carried out.")
    finally:
        rival.ask("release")


@check("4.10", after=("2.10", "3.8"))
def what_is_no_outcome(robot: RobotUnderTest) -> None:
    """malformed, unknown_type and restarted leave an id free."""
    client = robot.client()
    number = client.number()
    client.expect("restarted", "read", id=number, session="no such session")
    client.expect("unknown_type", "dance", id=number)
    client.refused("malformed", "A client that is a number", "read", id=number, client=5)
    reply = client.ask("read", id=number)
    expect(
        reply.get("code") not in ("id_reused", "out_of_order", "expired"),
        f"The id of requests that were not looked at is {said(reply)}.",
    )


@check("4.12", after=("2.10", "3.8", "4.4", "4.6", "5.2"))
def order(robot: RobotUnderTest) -> None:
    """Of several things that are wrong, the first in the order is answered."""
    client = robot.client()
    number = client.number()
    client.harmless(number)
    client.expect("restarted", "read", id=number, session="no such session")  # before the id
    client.expect("id_reused", "clear", id=number)  # before control
    client.expect("not_controller", "perform", targets={})  # before the targets
    fields = {"session": "no such session", "targets": 5}
    client.refused("malformed", "Targets that are no map", "perform", **fields)
    client.refused("unknown_type", "An unknown type with wrong fields", "dance", session=5)


@check("4.12", need=Need.CONTROL, after=("7.2",))
def order_in_control(robot: RobotUnderTest) -> None:
    """The targets come before the state."""
    with robot.controlled() as client:
        client.expect("ok", "stop")
        client.expect("bad_targets", "perform", targets={})


@check("4.14", after=("3.5",))
def not_numbered(robot: RobotUnderTest) -> None:
    """Any id will do for hello and heartbeat, again and again."""
    client = robot.client()
    client.harmless(client.number())
    for number in (0, 0, 1, 2**53 - 1, 0):
        client.expect("status", "heartbeat", id=number)
        client.expect("welcome", "hello", id=number, versions=[1])
    client.harmless(client.number())


@check("4.15", after=("3.5",))
def largest_id(robot: RobotUnderTest) -> None:
    """A welcome says the largest id of a numbered request in the session."""
    client = robot.client()
    client.number()
    number = client.number()
    client.harmless(number)
    welcome = robot.client(client.name).hello()
    expect(
        welcome.get("last_id") == number,
        f"After a request {number}, welcome says {welcome.get('last_id')} of it.",
    )
