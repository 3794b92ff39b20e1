"""Checks that take half a minute; only with ``--slow``."""

from __future__ import annotations

import threading
from typing import Final

from protocol.conformance.checks.motion import observed, small_targets
from protocol.conformance.expectations import Untried, expect
from protocol.conformance.raw_connection import FINAL, Map, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import RobotOnTrial, TrialClient
from protocol.rules.lease import EXPIRY, SILENCE

_TOLERANCE: Final = 2.0
"""Seconds by which the robot may be late; it must not be early by more than a tenth of that."""


def _silent_for(robot: RobotOnTrial, viewer: TrialClient, seconds: float) -> None:
    """Lets time pass in which only a viewer gives signs of life."""
    end = robot.settings.clock() + seconds
    while robot.settings.clock() < end:
        threading.Event().wait(0.02)
        viewer.status()


@check("5.7", need=Need.TIME)
def control_expires(robot: RobotOnTrial) -> None:
    """Control is kept for 30 s of silence, then it is free."""
    viewer = robot.client()
    with robot.controlled() as client:
        name, begun = client.name, robot.settings.clock()
        _silent_for(robot, viewer, EXPIRY - _TOLERANCE)
        kept = viewer.status().get("controller")
        silent = robot.settings.clock() - begun  # longer, if this computer stood still
        expect(
            kept == name or silent > EXPIRY - _TOLERANCE / 10,
            f"Control was gone after {silent:.1f} s of silence.",
        )
        _silent_for(robot, viewer, 2 * _TOLERANCE)
        kept = viewer.status().get("controller")
        expect(kept is None, f"Control was kept for {EXPIRY + _TOLERANCE:g} s of silence.")


@check("5.5", need=Need.TIME)
def heartbeats_keep_control(robot: RobotOnTrial) -> None:
    """Any valid request in the session is a sign of life; garbage and stop are none."""
    viewer = robot.client()
    with robot.controlled() as client:
        for _ in range(2):
            client.status()
            _silent_for(robot, viewer, EXPIRY * 0.6)
        expect(viewer.status().get("controller") == client.name, "Heartbeats did not keep control.")
        client.status()
        end = robot.settings.clock() + EXPIRY + _TOLERANCE
        while robot.settings.clock() < end:
            client.connection.send_parts(b"\xc1")
            client.connection.reply(None)
            client.ask("read", session="no such session")
        kept = viewer.status().get("controller")
        expect(kept is None, "Garbage, and requests in another session, kept control.")


@check("5.6", need=Need.TIME)
def silence_ends_a_motion(robot: RobotOnTrial) -> None:
    """After 5 s of silence a perform ends with aborted_silent, and control is kept."""
    if not robot.settings.move:
        raise Untried("This needs --move.")
    viewer = robot.client()
    clock = robot.settings.clock
    with robot.controlled() as client:
        targets = small_targets(robot.capabilities())
        if robot.settings.far:  # there and back takes longest
            targets = {joint.name: joint.upper for joint in robot.capabilities().joints}
            observed(client, targets)
        perform = client.request("perform", targets=targets)
        client.connection.send(perform)
        begun = clock()
        expect(client.connection.reply(perform["id"]) is not None, "A perform was not accepted.")
        end = None
        while end is None and clock() - begun < SILENCE + _TOLERANCE:
            viewer.status()
            end = _end_of(client, perform)
        silent = clock() - begun
        end = end or _end_of(client, perform)  # it may have come while this computer stood still
        expect(end is not None, f"A motion went on through {silent:.1f} s of silence.")
        assert end is not None
        if end["type"] == "observation":
            hint = "" if robot.settings.far else "; with --far they take longer"
            raise Untried(f"Its motions take less than 5 s{hint}.")
        expect(end.get("code") == "aborted_silent", f"The motion ended with {said(end)}.")
        early = SILENCE - _TOLERANCE / 10
        expect(silent > early, f"The motion ended after {silent:.1f} s of silence.")
        expect(viewer.status().get("controller") == client.name, "Control was lost.")


def _end_of(client: TrialClient, request: Map) -> Map | None:
    """The final reply to a request that was sent, if it has come; says nothing to the robot."""
    while (reply := client.connection.reply(request["id"], patience=0.02)) is not None:
        if reply["type"] in FINAL:
            return reply
    return None
