"""What all other checks build on: a plain request of each kind is answered as it should be.

These checks come first. Where one fails, the others that need such a request are skipped: each
would only wait in vain, and say the same again.
"""

from __future__ import annotations

from protocol.conformance.checks.motion import small_targets
from protocol.conformance.raw_connection import expect, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest


def _answered_with_ok(clause: str, kind: str, need: Need) -> None:
    """Registers the check that a request of the client in control is answered with ok."""

    def run(robot: RobotUnderTest) -> None:
        with robot.controlled() as client:
            client.expect("ok", kind)

    run.__doc__ = f"A {kind} is answered with ok."
    check(clause, need=need, basic=kind)(run)


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


_answered_with_ok("5.3", "release", Need.CONTROL)
_answered_with_ok("5.9", "stop", Need.CONTROL)
_answered_with_ok("6.1", "clear", Need.CONTROL)


@check("7.4", need=Need.MOTION, basic="perform")
def perform_is_answered(robot: RobotUnderTest) -> None:
    """A perform is accepted, and ends with an observation."""
    with robot.controlled() as client:
        request = client.send("perform", targets=small_targets(robot.capabilities(), 0.0))
        interim, end = client.wait_for(request["id"])
        expect(end["type"] == "observation", f"A perform ended with {said(end)}.")
        expect(bool(interim), "A perform was not accepted.")


_answered_with_ok("6.1", "hold", Need.MOTION)


@check("5.13", need=Need.MOTION, basic="relax")
def relax_is_answered(robot: RobotUnderTest) -> None:
    """A relax is answered with ok."""
    with robot.controlled() as client:
        client.expect("ok", "relax")
        client.expect("ok", "hold")
