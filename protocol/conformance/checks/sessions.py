"""Checks of section 3: hello, sessions, who is remembered, where answers go."""

from __future__ import annotations

import time

from protocol.conformance.raw_connection import FINAL, GRACE, Failed, Map, expect, pack, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient

PLACES = 64


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
            request = client.request(kind)
            del request[missing]
            client.refused(pack(request), "malformed", request["id"], f"{kind} without {missing}")


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
    late = robot.client(f"{first.name}-late")
    first.expect("restarted", "heartbeat")
    late.status()


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
    read = first.request("read")
    first.connection.send(read)
    expect(first.connection.reply(read["id"]) is not None, "A read was not answered.")
    felt = _answer_on(robot, second, read, instead=first)
    _, again = second.answer_to(read)
    expect(again == felt, f"Asked again, the robot answered {said(again)}, not as before.")
