"""Checks of sections 5 and 6 on a robot at rest: control, stop, states."""

from __future__ import annotations

from protocol.conformance.checks.motion import small_targets
from protocol.conformance.expectations import Broken, Untried, expect
from protocol.conformance.raw_connection import Unanswered, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import RobotOnTrial, TrialClient

HARMLESS = ("release", "clear", "perform")  # what cannot make a robot at rest move or go limp


def _without_control(client: TrialClient, kinds: tuple[str, ...] = HARMLESS) -> None:
    for kind in kinds:
        client.expect("not_controller", kind, **({"targets": {}} if kind == "perform" else {}))


@check("5.1", need=Need.CONTROL)
def anybody(robot: RobotOnTrial) -> None:
    """While another controls the robot, anybody may say hello, read and see who it is."""
    viewer = robot.client()
    with robot.controlled() as controller:
        viewer.hello()
        seen = viewer.status()
        expect(
            seen.get("controller") == controller.name,
            f"status names {seen.get('controller')} as the controller, not {controller.name}.",
        )
        viewer.expect("observation", "read")


@check("5.2", need=Need.CONTROL)
def control_is_needed(robot: RobotOnTrial) -> None:
    """Without control, what needs it is not_controller."""
    viewer = robot.client()
    viewer.harmless(viewer.number())  # tells a viewer's key
    _without_control(viewer)
    with robot.controlled():
        _without_control(viewer)


@check("5.2", need=Need.MOTION)
def control_is_needed_to_hold_and_relax(robot: RobotOnTrial) -> None:
    """Without control, hold and relax are not_controller."""
    viewer = robot.client()
    with robot.controlled():
        _without_control(viewer, ("hold", "relax"))


@check("5.3", need=Need.CONTROL, after=("5.1", "5.2"))
def acquire_and_release(robot: RobotOnTrial) -> None:
    """The controller may acquire again; release ends control."""
    with robot.controlled() as client:
        client.expect("ok", "acquire")
        expect(client.status().get("controller") == client.name, "status does not name us.")
        client.expect("ok", "release")
        after = client.status()
        expect(after.get("controller") is None, "After release, status still names a controller.")
        _without_control(client)
        other = robot.client()
        other.expect("ok", "acquire")
        other.expect("ok", "release")


@check("5.4", need=Need.CONTROL, after=("5.1",))
def held(robot: RobotOnTrial) -> None:
    """A second controller is held, and told who has it."""
    other = robot.client()
    with robot.controlled() as client:
        reply = other.expect("held", "acquire")
        expect(
            client.name in reply["message"],
            f"The sentence does not name who has control: {reply['message']}",
        )
        expect(client.status().get("controller") == client.name, "The second one took control.")


@check("5.9", need=Need.CONTROL)
def anybody_stops(robot: RobotOnTrial) -> None:
    """A stranger may stop the robot, without a session."""
    with robot.controlled() as client:
        reply = robot.stranger().expect("ok", "stop")
        expect(reply["state"] == "stopped", f"After stop the state is {reply['state']}.")
        seen = client.status()["state"]
        expect(seen == "stopped", f"After a stop that was ok, status says {seen}.")


@check("5.11", need=Need.CONTROL, after=("5.2",))
def stop_latches(robot: RobotOnTrial) -> None:
    """After a stop everything is stopped, until the controller clears it."""
    viewer = robot.client()
    with robot.controlled() as client:
        client.expect("ok", "stop")
        for each in (client, viewer):
            each.expect("stopped", "read")
        viewer.expect("not_controller", "clear")
        expect(client.status()["state"] == "stopped", "The stop was lifted by somebody else.")
        reply = client.expect("ok", "clear")
        expect(reply["state"] == "holding", f"After clear the state is {reply['state']}.")
        client.expect("observation", "read")


@check("5.12", need=Need.CONTROL)
def stop_twice(robot: RobotOnTrial) -> None:
    """A stop that arrives twice stops twice, also after a clear."""
    with robot.controlled() as client:
        stop = client.request("stop")
        for _ in range(2):
            expect(client.answer_to(stop)[1]["type"] == "ok", "A second stop was not ok.")
        client.expect("ok", "clear")
        client.answer_to(stop)
        seen = client.status()["state"]
        expect(seen == "stopped", f"A stop that came again after a clear left the robot {seen}.")


@check("6.1", need=Need.CONTROL)
def states_at_rest(robot: RobotOnTrial) -> None:
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
def requests_that_change_no_state(robot: RobotOnTrial) -> None:
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
def shutting_down(robot: RobotOnTrial) -> None:
    """A daemon that ends says so: to what is under way, and to what is asked then."""
    shut_down = robot.settings.shut_down
    if shut_down is None:
        raise Untried("This needs --shutdown.")
    with robot.controlled() as client:
        asked = client.request("read")
        if robot.settings.move:
            asked = client.request("perform", targets=small_targets(robot.capabilities()))
        client.connection.send(asked)
        expect(client.connection.answer(asked["id"]) is not None, "A motion was not accepted.")
        shut_down()
        try:
            end = client.connection.final(asked["id"], patience=robot.settings.motion)[1]
            refused = client.ask("read")
        except Unanswered as error:
            raise Broken("The daemon ended without a word.") from error
        if end["type"] == "observation" and refused.get("code") != "shutting_down":
            raise Untried("The motion, or the daemon, was over too soon.")
        for reply in (end, refused):
            over = reply is end and reply["type"] == "observation"
            sentence = f"A daemon that ended answered {said(reply)}."
            expect(over or reply.get("code") == "shutting_down", sentence)
