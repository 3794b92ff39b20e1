"""What all other checks build on: a plain request of each kind is answered as it should be.

These checks come first. Where one fails, the others that need such a request are skipped: each
would only wait in vain, and say the same again.
"""

from __future__ import annotations

from protocol.conformance.checks.motion import small_targets
from protocol.conformance.raw_connection import expect, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest


@check("3.2", basic="hello")
def hello_is_answered(robot: RobotUnderTest) -> None:
    """A hello is answered with welcome."""
    robot.client()


@check("5.5", basic="heartbeat")
def heartbeat_is_answered(robot: RobotUnderTest) -> None:
    """A heartbeat is answered with status."""
    robot.client().status()


@check("7.5", basic="read")
def read_is_answered(robot: RobotUnderTest) -> None:
    """A read is answered to its end."""
    client = robot.client()
    reply = client.ask("read")
    expect(reply["type"] in ("observation", "error"), f"A read ended with {said(reply)}.")


@check("5.3", need=Need.CONTROL, basic="acquire")
def acquire_is_answered(robot: RobotUnderTest) -> None:
    """An acquire of a free robot is answered with ok."""
    with robot.controlled():
        pass


@check("5.3", need=Need.CONTROL, basic="release")
def release_is_answered(robot: RobotUnderTest) -> None:
    """A release is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "release")


@check("5.9", need=Need.CONTROL, basic="stop")
def stop_is_answered(robot: RobotUnderTest) -> None:
    """A stop is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "stop")


@check("6.1", need=Need.CONTROL, basic="clear")
def clear_is_answered(robot: RobotUnderTest) -> None:
    """A clear is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "clear")


@check("7.4", need=Need.MOTION, basic="perform")
def perform_is_answered(robot: RobotUnderTest) -> None:
    """A perform is accepted, and ends with an observation."""
    with robot.controlled() as client:
        request = client.request("perform", targets=small_targets(robot.capabilities(), 0.0))
        client.connection.send(request)
        interim, end = client.wait_for(request["id"])
        expect(end["type"] == "observation", f"A perform ended with {said(end)}.")
        expect(bool(interim), "A perform was not accepted.")


@check("6.1", need=Need.MOTION, basic="hold")
def hold_is_answered(robot: RobotUnderTest) -> None:
    """A hold is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "hold")


@check("5.13", need=Need.MOTION, basic="relax")
def relax_is_answered(robot: RobotUnderTest) -> None:
    """A relax is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "relax")
        client.expect("ok", "hold")
