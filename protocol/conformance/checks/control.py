"""Checks of sections 5 and 6 on a robot at rest: control, stop, states."""

from __future__ import annotations

import threading
from typing import Final

from protocol.conformance.checks.motion import observed, small_targets
from protocol.conformance.raw_connection import (
    FINAL,
    Failed,
    Map,
    Skipped,
    Unanswered,
    expect,
    said,
)
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient
from protocol.rules.control import EXPIRY, SILENCE

HARMLESS = ("release", "clear", "perform")  # what cannot make a robot at rest move or go limp


def _without_control(client: TrialClient, kinds: tuple[str, ...] = HARMLESS) -> None:
    for kind in kinds:
        client.expect("not_controller", kind, **({"targets": {}} if kind == "perform" else {}))


@check("5.1", need=Need.CONTROL)
def anybody(robot: RobotUnderTest) -> None:
    """While another controls the robot, anybody may say hello, read and see who it is."""
    viewer = robot.client()
    with robot.controlled() as controller:
        viewer.hello()
        status = viewer.status()
        expect(
            status.get("controller") == controller.name,
            f"status names {status.get('controller')} as the controller, not {controller.name}.",
        )
        viewer.expect("observation", "read")


@check("5.2", need=Need.CONTROL)
def control_is_needed(robot: RobotUnderTest) -> None:
    """Without control, what needs it is not_controller."""
    viewer = robot.client()
    viewer.harmless(viewer.number())  # tells a viewer's key
    _without_control(viewer)
    with robot.controlled():
        _without_control(viewer)


@check("5.2", need=Need.MOTION)
def control_is_needed_to_hold_and_relax(robot: RobotUnderTest) -> None:
    """Without control, hold and relax are not_controller."""
    viewer = robot.client()
    with robot.controlled():
        _without_control(viewer, ("hold", "relax"))


@check("5.3", need=Need.CONTROL, after=("5.1", "5.2"))
def acquire_and_release(robot: RobotUnderTest) -> None:
    """The controller may acquire again; release ends control."""
    with robot.controlled() as client:
        client.expect("ok", "acquire")
        expect(client.status().get("controller") == client.name, "status does not name us.")
        client.expect("ok", "release")
        status = client.status()
        expect(status.get("controller") is None, "After release, status still names a controller.")
        _without_control(client)
        rival = robot.client()
        rival.expect("ok", "acquire")
        rival.expect("ok", "release")


@check("5.4", need=Need.CONTROL, after=("5.1",))
def held(robot: RobotUnderTest) -> None:
    """A second controller is held, and told who has it."""
    rival = robot.client()
    with robot.controlled() as client:
        reply = rival.expect("held", "acquire")
        expect(
            client.name in reply["message"],
            f"The sentence does not name who has control: {reply['message']}",
        )
        expect(client.status().get("controller") == client.name, "The second one took control.")


@check("5.9", need=Need.CONTROL)
def anybody_stops(robot: RobotUnderTest) -> None:
    """A stranger may stop the robot, without a session, or with another's id and an old session."""
    stranger = robot.stranger()
    with robot.controlled() as client:
        for fields in (
            {},
            {"session": "long gone"},
            {"session": "long gone", "client": client.name},
        ):
            reply = stranger.expect("ok", "stop", **fields)
            expect(reply["state"] == "stopped", f"After stop the state is {reply['state']}.")
            state = client.status()["state"]
            expect(state == "stopped", f"After a stop that was ok, status says {state}.")
            client.ask("clear")


@check("5.11", need=Need.CONTROL, after=("5.2",))
def stop_latches(robot: RobotUnderTest) -> None:
    """After a stop everything is stopped, until the controller clears it."""
    viewer = robot.client()
    with robot.controlled() as client:
        client.expect("ok", "stop")
        for reader in (client, viewer):
            reader.expect("stopped", "read")
        viewer.expect("not_controller", "clear")
        expect(client.status()["state"] == "stopped", "The stop was lifted by somebody else.")
        reply = client.expect("ok", "clear")
        expect(reply["state"] == "holding", f"After clear the state is {reply['state']}.")
        client.expect("observation", "read")


@check("5.12", need=Need.CONTROL)
def stop_twice(robot: RobotUnderTest) -> None:
    """A stop that arrives twice stops twice, also after a clear."""
    with robot.controlled() as client:
        stop = client.request("stop")
        for _ in range(2):
            expect(client.answer_to(stop)[1]["type"] == "ok", "A second stop was not ok.")
        client.expect("ok", "clear")
        client.answer_to(stop)
        state = client.status()["state"]
        expect(state == "stopped", f"A stop that came again after a clear left the robot {state}.")


@check("6.1", need=Need.CONTROL)
def states_at_rest(robot: RobotUnderTest) -> None:
    """At rest, read and clear are possible and change no state; stop and clear lead on."""
    with robot.controlled() as client:
        before = client.status()["state"]
        client.expect("observation", "read")
        expect(client.status()["state"] == before, "read changed the state.")
        after = client.expect("ok", "clear")["state"]
        expect(after == before, f"clear led from {before} to {after}.")
        states = [client.expect("ok", kind)["state"] for kind in ("stop", "stop", "clear", "clear")]
        expected = ["stopped", "stopped", "holding", "holding"]
        expect(states == expected, f"stop, stop, clear, clear led to {', '.join(states)}.")


@check("6.2", need=Need.CONTROL)
def requests_that_change_no_state(robot: RobotUnderTest) -> None:
    """hello, heartbeat, acquire and release change no state, also while stopped."""
    with robot.controlled() as client:
        for expected in ("as it was", "stopped"):
            if expected == "stopped":
                client.expect("ok", "stop")
            before = client.status()["state"]
            client.hello()
            client.expect("ok", "release")
            reply = client.ask("acquire")
            expect(reply["type"] == "ok", f"acquire, {expected}: {said(reply)}.")
            after = client.status()["state"]
            expect(after == before, f"These requests led from {before} to {after}.")


@check("5.14", need=Need.CONTROL)
def shutting_down(robot: RobotUnderTest) -> None:
    """A daemon that ends says so: to what is under way, and to what is asked then."""
    shut_down = robot.settings.shut_down
    if shut_down is None:
        raise Skipped("This needs --shutdown.")
    with robot.controlled() as client:
        request = client.request("read")
        if robot.settings.move:
            request = client.request("perform", targets=small_targets(robot.capabilities()))
        client.connection.send(request)
        expect(client.connection.answer(request["id"]) is not None, "A motion was not accepted.")
        shut_down()
        try:
            end = client.connection.final(request["id"], patience=robot.settings.motion)[1]
            refusal = client.ask("read")
        except Unanswered as error:
            raise Failed("The daemon ended without a word.") from error
        if end["type"] == "observation" and refusal.get("code") != "shutting_down":
            raise Skipped("The motion, or the daemon, was over too soon.")
        for reply in (end, refusal):
            is_over = reply is end and reply["type"] == "observation"
            sentence = f"A daemon that ended answered {said(reply)}."
            expect(is_over or reply.get("code") == "shutting_down", sentence)


_TOLERANCE: Final = 2.0
"""Seconds by which the robot may be late; it must not be early by more than a tenth of that."""


def _silent_for(robot: RobotUnderTest, viewer: TrialClient, seconds: float) -> None:
    """Lets time pass in which only a viewer gives signs of life."""
    end = robot.settings.clock() + seconds
    while robot.settings.clock() < end:
        threading.Event().wait(0.02)
        viewer.status()


@check("5.7", need=Need.TIME)
def control_expires(robot: RobotUnderTest) -> None:
    """Control is kept for 30 s of silence, then it is free."""
    viewer = robot.client()
    with robot.controlled() as client:
        name, begun = client.name, robot.settings.clock()
        _silent_for(robot, viewer, EXPIRY - _TOLERANCE)
        holder = viewer.status().get("controller")
        silence = robot.settings.clock() - begun  # longer, if this computer stood still
        expect(
            holder == name or silence > EXPIRY - _TOLERANCE / 10,
            f"Control was gone after {silence:.1f} s of silence.",
        )
        _silent_for(robot, viewer, 2 * _TOLERANCE)
        holder = viewer.status().get("controller")
        expect(holder is None, f"Control was kept for {EXPIRY + _TOLERANCE:g} s of silence.")


@check("5.5", need=Need.TIME)
def heartbeats_keep_control(robot: RobotUnderTest) -> None:
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
        holder = viewer.status().get("controller")
        expect(holder is None, "Garbage, and requests in another session, kept control.")


@check("5.6", need=Need.TIME)
def silence_ends_a_motion(robot: RobotUnderTest) -> None:
    """After 5 s of silence a perform ends with aborted_silent, and control is kept."""
    if not robot.settings.move:
        raise Skipped("This needs --move.")
    viewer = robot.client()
    clock = robot.settings.clock
    with robot.controlled() as client:
        targets = small_targets(robot.capabilities())
        if robot.settings.far:  # there and back takes longest
            targets = {joint.name: joint.upper for joint in robot.capabilities().joints}
            observed(client, targets)
        perform = client.send("perform", targets=targets)
        begun = clock()
        expect(client.connection.reply(perform["id"]) is not None, "A perform was not accepted.")
        end = None
        while end is None and clock() - begun < SILENCE + _TOLERANCE:
            viewer.status()
            end = _end_of(client, perform)
        silence = clock() - begun
        end = end or _end_of(client, perform)  # it may have come while this computer stood still
        expect(end is not None, f"A motion went on through {silence:.1f} s of silence.")
        assert end is not None
        if end["type"] == "observation":
            hint = "" if robot.settings.far else "; with --far they take longer"
            raise Skipped(f"Its motions take less than 5 s{hint}.")
        expect(end.get("code") == "aborted_silent", f"The motion ended with {said(end)}.")
        early = SILENCE - _TOLERANCE / 10
        expect(silence > early, f"The motion ended after {silence:.1f} s of silence.")
        expect(viewer.status().get("controller") == client.name, "Control was lost.")


def _end_of(client: TrialClient, request: Map) -> Map | None:
    """The final reply to a request that was sent, if it has come; says nothing to the robot."""
    while (reply := client.connection.reply(request["id"], patience=0.02)) is not None:
        if reply["type"] in FINAL:
            return reply
    return None
