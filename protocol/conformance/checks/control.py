"""Checks of sections 5 and 6 on a robot at rest: control, stop, states."""

from __future__ import annotations

from protocol.conformance.checks.motion import small_targets
from protocol.conformance.expectations import Broken, Untried, expect
from protocol.conformance.raw_connection import Unanswered, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import Party, RobotOnTrial

HARMLESS = ("release", "clear", "perform")  # what cannot make a robot at rest move or go limp


def _without_control(party: Party, kinds: tuple[str, ...] = HARMLESS) -> None:
    for kind in kinds:
        party.expect("not_controller", kind, **({"targets": {}} if kind == "perform" else {}))


@check("5.1", need=Need.CONTROL)
def anybody(bench: RobotOnTrial) -> None:
    """While another controls the robot, anybody may say hello, read and see who it is."""
    viewer = bench.party()
    with bench.controlled() as controller:
        viewer.hello()
        seen = viewer.status()
        expect(
            seen.get("controller") == controller.name,
            f"status names {seen.get('controller')} as the controller, not {controller.name}.",
        )
        viewer.expect("observation", "read")


@check("5.2", need=Need.CONTROL)
def control_is_needed(bench: RobotOnTrial) -> None:
    """Without control, what needs it is not_controller."""
    viewer = bench.party()
    viewer.harmless(viewer.number())  # tells a viewer's key
    _without_control(viewer)
    with bench.controlled():
        _without_control(viewer)


@check("5.2", need=Need.MOTION)
def control_is_needed_to_hold_and_relax(bench: RobotOnTrial) -> None:
    """Without control, hold and relax are not_controller."""
    viewer = bench.party()
    with bench.controlled():
        _without_control(viewer, ("hold", "relax"))


@check("5.3", need=Need.CONTROL, after=("5.1", "5.2"))
def acquire_and_release(bench: RobotOnTrial) -> None:
    """The controller may acquire again; release ends control."""
    with bench.controlled() as party:
        party.expect("ok", "acquire")
        expect(party.status().get("controller") == party.name, "status does not name us.")
        party.expect("ok", "release")
        after = party.status()
        expect(after.get("controller") is None, "After release, status still names a controller.")
        _without_control(party)
        other = bench.party()
        other.expect("ok", "acquire")
        other.expect("ok", "release")


@check("5.4", need=Need.CONTROL, after=("5.1",))
def held(bench: RobotOnTrial) -> None:
    """A second controller is held, and told who has it."""
    other = bench.party()
    with bench.controlled() as party:
        reply = other.expect("held", "acquire")
        expect(
            party.name in reply["message"],
            f"The sentence does not name who has control: {reply['message']}",
        )
        expect(party.status().get("controller") == party.name, "The second one took control.")


@check("5.9", need=Need.CONTROL)
def anybody_stops(bench: RobotOnTrial) -> None:
    """A stranger may stop the robot, without a session."""
    with bench.controlled() as party:
        reply = bench.stranger().expect("ok", "stop")
        expect(reply["state"] == "stopped", f"After stop the state is {reply['state']}.")
        seen = party.status()["state"]
        expect(seen == "stopped", f"After a stop that was ok, status says {seen}.")


@check("5.11", need=Need.CONTROL, after=("5.2",))
def stop_latches(bench: RobotOnTrial) -> None:
    """After a stop everything is stopped, until the controller clears it."""
    viewer = bench.party()
    with bench.controlled() as party:
        party.expect("ok", "stop")
        for client in (party, viewer):
            client.expect("stopped", "read")
        viewer.expect("not_controller", "clear")
        expect(party.status()["state"] == "stopped", "The stop was lifted by somebody else.")
        reply = party.expect("ok", "clear")
        expect(reply["state"] == "holding", f"After clear the state is {reply['state']}.")
        party.expect("observation", "read")


@check("5.12", need=Need.CONTROL)
def stop_twice(bench: RobotOnTrial) -> None:
    """A stop that arrives twice stops twice, also after a clear."""
    with bench.controlled() as party:
        stop = party.request("stop")
        for _ in range(2):
            expect(party.answer_to(stop)[1]["type"] == "ok", "A second stop was not ok.")
        party.expect("ok", "clear")
        party.answer_to(stop)
        seen = party.status()["state"]
        expect(seen == "stopped", f"A stop that came again after a clear left the robot {seen}.")


@check("6.1", need=Need.CONTROL)
def states_at_rest(bench: RobotOnTrial) -> None:
    """At rest, read and clear are possible and change no state; stop and clear lead on."""
    with bench.controlled() as party:
        before = party.status()["state"]
        party.expect("observation", "read")
        expect(party.status()["state"] == before, "read changed the state.")
        after = party.expect("ok", "clear")["state"]
        expect(after == before, f"clear led from {before} to {after}.")
        states = [party.expect("ok", kind)["state"] for kind in ("stop", "stop", "clear", "clear")]
        expected = ["stopped", "stopped", "holding", "holding"]
        expect(states == expected, f"stop, stop, clear, clear led to {', '.join(states)}.")


@check("6.2", need=Need.CONTROL)
def requests_that_change_no_state(bench: RobotOnTrial) -> None:
    """hello, heartbeat, acquire and release change no state, also while stopped."""
    with bench.controlled() as party:
        for expected in ("as it was", "stopped"):
            if expected == "stopped":
                party.expect("ok", "stop")
            before = party.status()["state"]
            party.hello()
            party.expect("ok", "release")
            reply = party.ask("acquire")
            expect(reply["type"] == "ok", f"acquire, {expected}: {said(reply)}.")
            after = party.status()["state"]
            expect(after == before, f"These requests led from {before} to {after}.")


@check("5.14", need=Need.CONTROL)
def shutting_down(bench: RobotOnTrial) -> None:
    """A daemon that ends says so: to what is under way, and to what is asked then."""
    shut_down = bench.settings.shut_down
    if shut_down is None:
        raise Untried("This needs --shutdown.")
    with bench.controlled() as party:
        asked = party.request("read")
        if bench.settings.move:
            asked = party.request("perform", targets=small_targets(bench.capabilities()))
        party.line.send(asked)
        expect(party.line.answer(asked["id"]) is not None, "A motion was not accepted.")
        shut_down()
        try:
            end = party.line.final(asked["id"], patience=bench.settings.motion)[1]
            refused = party.ask("read")
        except Unanswered as error:
            raise Broken("The daemon ended without a word.") from error
        if end["type"] == "observation" and refused.get("code") != "shutting_down":
            raise Untried("The motion, or the daemon, was over too soon.")
        for reply in (end, refused):
            over = reply is end and reply["type"] == "observation"
            sentence = f"A daemon that ended answered {said(reply)}."
            expect(over or reply.get("code") == "shutting_down", sentence)
