"""Checks that move the robot; only with ``--move``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from protocol.conformance.raw_connection import Map, Skipped, expect, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient
from protocol.wire.capabilities import Capabilities

REACH: Final = 0.5
"""The largest angle that is asked for, rad; half of what a joint reaches, where that is less."""

_TRIALS: Final = 3  # a simulated robot may be done before it can be interrupted


def small_targets(capabilities: Capabilities, share: float = 1.0) -> dict[str, float]:
    """Small angles, in the direction in which each joint reaches further."""
    targets = {}
    for joint in capabilities.joints:
        limit = max(joint.lower, joint.upper, key=abs)
        angle = min(abs(limit) / 2, REACH) * share
        targets[joint.name] = angle if limit > 0 else -angle
    return targets


def _performed(
    robot: RobotUnderTest, client: TrialClient, share: float
) -> tuple[dict[str, float], Map]:
    targets = small_targets(robot.capabilities(), share)
    return targets, observed(client, targets)


def begun(client: TrialClient, targets: Mapping[str, float]) -> Map:
    """Begins a motion, and returns its request."""
    perform = client.send("perform", targets=targets)
    expect(client.connection.reply(perform["id"]) is not None, "A perform was not accepted.")
    return perform


def observed(client: TrialClient, targets: Mapping[str, float]) -> Map:
    """Performs a motion and returns its observation."""
    request = client.send("perform", targets=targets)
    _, end = client.wait_for(request["id"])
    expect(end["type"] == "observation", f"A perform ended with {said(end)}.")
    return end


def _rest(robot: RobotUnderTest, client: TrialClient) -> None:
    """Moves the robot back to its zero pose."""
    _performed(robot, client, 0.0)


def _under_way(
    robot: RobotUnderTest, client: TrialClient, kind: str, other: TrialClient, code: str
) -> None:
    """Interrupts a motion with a request; expects that the motion ends with this code."""
    for _ in range(_TRIALS):
        perform = begun(client, small_targets(robot.capabilities()))
        interrupt = other.send(kind)
        reply = other.connection.final(interrupt["id"])[1]
        expect(reply["type"] == "ok", f"{kind} in mid-motion was answered with {said(reply)}.")
        _, end = client.wait_for(perform["id"])
        if end["type"] != "observation":
            expect(end.get("code") == code, f"The motion ended with {said(end)}, not {code}.")
            return
        if kind == "stop":
            client.ask("clear")
        if kind == "release":
            client.ask("acquire")
    raise Skipped("Its motions are over too soon to be interrupted.")


@check("7.2", need=Need.MOTION)
def bad_targets(robot: RobotUnderTest) -> None:
    """Missing and unknown joints are bad_targets."""
    with robot.controlled() as client:
        complete = small_targets(robot.capabilities(), 0.0)
        first_joint = next(iter(complete))
        incomplete = {name: angle for name, angle in complete.items() if name != first_joint}
        for targets in (incomplete, complete | {"no such joint": 0.0}):
            client.expect("bad_targets", "perform", targets=targets)
        expect(client.status()["state"] in ("idle", "holding"), "It moved all the same.")


@check("7.3", need=Need.MOTION, after=("7.2",))
def out_of_range(robot: RobotUnderTest) -> None:
    """Targets beyond a limit, by however little, are out_of_range, and nothing is clamped."""
    capabilities = robot.capabilities()
    with robot.controlled() as client:
        for joint in capabilities.joints:
            for beyond in (
                joint.upper + 0.02,
                joint.lower - 0.02,
                math.nextafter(joint.upper, math.inf),
                math.nextafter(joint.lower, -math.inf),
            ):
                targets = small_targets(capabilities, 0.0) | {joint.name: beyond}
                client.expect("out_of_range", "perform", targets=targets)


@check("7.4", "4.3", need=Need.MOTION, after=("4.4",))
def perform_reaches_its_targets(robot: RobotUnderTest) -> None:
    """A perform is carried out once, to within one resolution of its targets."""
    capabilities = robot.capabilities()
    with robot.controlled() as client:
        targets, observation = _performed(robot, client, 1.0)
        for joint in capabilities.joints:
            miss = abs(observation["angles"][joint.name] - targets[joint.name])
            expect(
                miss <= joint.resolution + 1e-9,
                f"{joint.name} was commanded {miss:.4f} rad off its target.",
            )
        sequence = client.status()["sequence"]
        repeat = client.ask("perform", id=observation["id"], targets=targets)
        expect(repeat == observation, f"The same perform again was answered with {said(repeat)}.")
        expect(client.status()["sequence"] == sequence, "The same perform was carried out twice.")
        _rest(robot, client)


@check("7.9", need=Need.MOTION)
def joints_at_the_end(robot: RobotUnderTest) -> None:
    """Joints at the end of their range are named as saturated, and no others."""
    if not robot.settings.far:
        raise Skipped("This needs --far.")
    capabilities = robot.capabilities()
    with robot.controlled() as client:
        joint = capabilities.joints[0]
        for end in ("upper", "lower"):
            targets = small_targets(capabilities, 0.0) | {joint.name: getattr(joint, end)}
            saturated = observed(client, targets)["saturated_joints"]
            expect(
                saturated == [joint.name],
                f"With {joint.name} alone at its {end} limit, saturated_joints is {saturated}.",
            )
        _rest(robot, client)


@check("4.5", need=Need.MOTION, after=("3.5", "4.4"))
def asked_again_under_way(robot: RobotUnderTest) -> None:
    """A request that is under way answers with its progress, then its end, once."""
    with robot.controlled() as client:
        request = client.send("perform", targets=small_targets(robot.capabilities()))
        first_reply = client.connection.reply(request["id"])
        expect(
            first_reply is not None and first_reply["type"] == "accepted",
            f"A perform was answered with {said(first_reply)} instead of accepted.",
        )
        later = robot.client(client.name)
        later.connection.send(request)
        seen = later.connection.reply(request["id"])
        expect(seen is not None, "A request asked again was not answered.")
        end = seen if seen and seen["type"] == "observation" else later.wait_for(request["id"])[1]
        expect(end["type"] == "observation", f"Asked again, it ended with {said(end)}.")
        extra = later.connection.reply(request["id"], patience=0.3)
        expect(extra is None, f"After its end came {said(extra)}.")
        _rest(robot, client)


@check("5.10", need=Need.MOTION)
def stop_in_motion(robot: RobotUnderTest) -> None:
    """A stop from anybody ends a perform with aborted_stop."""
    with robot.controlled() as client:
        _under_way(robot, client, "stop", robot.stranger(), "aborted_stop")
        expect(client.status()["state"] == "stopped", "After the stop it is not stopped.")
        refusal = client.ask("perform", targets=small_targets(robot.capabilities(), 0.0))
        expect(refusal.get("code") == "stopped", f"A perform then was {said(refusal)}.")
        client.expect("ok", "clear")
        _rest(robot, client)


@check("5.8", need=Need.MOTION)
def release_in_motion(robot: RobotUnderTest) -> None:
    """A release in mid-motion ends it with aborted_silent."""
    with robot.controlled() as client:
        _under_way(robot, client, "release", client, "aborted_silent")
        client.expect("ok", "acquire")
        _rest(robot, client)


@check("6.1", need=Need.MOTION)
def busy(robot: RobotUnderTest) -> None:
    """While it moves, read, clear and a second perform are busy; hold ends the motion."""
    with robot.controlled() as client:
        for kind in ("read", "clear", "perform"):
            _busy(robot, client, kind)
        _under_way(robot, client, "hold", client, "aborted_hold")
        expect(client.status()["state"] == "holding", "After hold it does not hold.")
        _rest(robot, client)


def _busy(robot: RobotUnderTest, client: TrialClient, kind: str) -> None:
    targets = small_targets(robot.capabilities())
    fields = {"targets": targets} if kind == "perform" else {}
    for _ in range(_TRIALS):
        motion = begun(client, targets)
        second = client.send(kind, **fields)
        _, reply = client.wait_for(second["id"])
        _, end = client.wait_for(motion["id"])
        expect(end["type"] == "observation", f"The first motion ended with {said(end)}.")
        if reply.get("code") == "busy":
            return
        was_over = reply.get("sequence", end["sequence"]) >= end["sequence"]
        expect(was_over, f"{kind} in mid-motion was answered with {said(reply)} instead of busy.")
    raise Skipped("Its motions are over too soon.")


@check("5.13", "6.1", need=Need.MOTION)
def relaxed(robot: RobotUnderTest) -> None:
    """After relax it is relaxed, and perform wrong_state; hold brings it back."""
    with robot.controlled() as client:
        _rest(robot, client)
        state = client.expect("ok", "relax")["state"]
        expect(state == "relaxed", f"After relax the state is {state}.")
        targets = small_targets(robot.capabilities(), 0.0)
        client.expect("wrong_state", "perform", targets=targets)
        client.expect("observation", "read")
        expect(client.status()["state"] == "relaxed", "read changed the state.")
        state = client.expect("ok", "hold")["state"]
        expect(state == "holding", f"After hold the state is {state}.")


@check("6.1", "5.11", need=Need.MOTION)
def limp_and_stopped(robot: RobotUnderTest) -> None:
    """A limp robot that was stopped holds, once it is cleared, and performs."""
    with robot.controlled() as client:
        _rest(robot, client)
        for kind, expected in (("relax", "relaxed"), ("stop", "stopped"), ("clear", "holding")):
            state = client.expect("ok", kind)["state"]
            expect(state == expected, f"After {kind} the state is {state}.")
        _rest(robot, client)
