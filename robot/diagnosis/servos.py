"""The servo board, its line, and each joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from protocol.errors import HOLD, with_address
from protocol.sockets.zmq_sockets import DEFAULT_BIND
from robot.calibration.joints import Mover
from robot.configuration.joint_calibration import USUAL_SPAN, DrivenJoint, middle
from robot.control.joint_watch import LIMITED, OFF, JointWatch, cut_short, told
from robot.diagnosis.findings import Finding, bad, failed, look, ok
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings, ServoState, answering
from robot.errors import DeviceError
from robot.host.clock import Clock

QUERIES: Final = 24  # a line that damages one query in five hardly passes
_TOLERATED_REPEATS: Final = 1  # query that had to be repeated; a bad line has more
MOVE: Final = math.radians(5)  # is seen, and safe in any pose
_PAUSE: Final = 0.3  # s between there and back
_MARGIN: Final = math.radians(1)  # a joint may stand this far outside its limits, by quantisation
_SIZES: Final = (0.43, 2.14)  # times the usual size of a count: 0.3° to 1.5° where there are 255


def failing_alone(servos: ServoBus, outputs: Sequence[int]) -> dict[int, DeviceError]:
    """Errors of those servos that fail while others on their line answer, by output.

    What every servo reports is the line's, or the board's.
    """
    errors: dict[int, DeviceError] = {}
    for output in outputs if answering(servos) is not None else ():
        try:
            servos.read_counts([output])
        except DeviceError as error:
            errors[output] = error
    return errors if len(errors) < len(outputs) else {}


def check_board(
    servos: ServoBus, settings: ServoSettings, outputs: Sequence[int], clock: Clock
) -> tuple[list[Finding], dict[int, int]]:
    """Asks the board for its counts, again and again.

    Returns:
        What was observed, and the counts by output; empty when the board did not answer.
    """
    subject = "servo board"
    repeats_before, start = servos.repeats, clock.now()
    counts: dict[int, int] = {}
    if not settings.reads_back:
        warning = "It cannot be read back: where the servos stand is not known."
        return [
            look(
                subject,
                f"{servos.name}: {warning}",
                "Watch them when a program moves them: a reset goes unnoticed.",
            )
        ], {}
    try:
        for query in range(QUERIES):
            counts |= servos.read_counts([outputs[query % len(outputs)]])
    except DeviceError as error:
        return [failed(subject, error)], {}
    took = (clock.now() - start) / QUERIES
    repeated = servos.repeats - repeats_before
    text = f"{servos.name}: {repeated} of {QUERIES + repeated} queries had to be repeated"
    advice = "check cable, ground and baud rate; keep the line away from the motors' wires."
    if repeated > _TOLERATED_REPEATS:
        return [
            bad(subject, f"{text}: bytes are lost or damaged on the line.", advice.capitalize())
        ], counts
    if repeated:
        findings = [
            look(
                subject, f"{text}, which a busy computer can cause.", f"If it is so again: {advice}"
            )
        ]
    else:
        text = f"{servos.name} answers; {QUERIES} of {QUERIES} queries, {took * 1000:.0f} ms each"
        findings = [ok(subject, text)]
    neutral = middle(settings.counts)
    if set(counts.values()) == {neutral}:
        findings.append(
            look(
                subject,
                f"Every servo stands at count {neutral}, as after switching on.",
                "Nothing, if it was just switched on; else its supply drops: check it under load.",
            )
        )
    return findings, counts


def check_joints(
    joints: Sequence[DrivenJoint], counts: Mapping[int, int], servos: ServoBus
) -> Iterator[Finding]:
    """Checks each joint's count against calibration and limits, and what its servo reports."""
    answers = answering(servos)
    for joint in joints:
        finding = _check_joint(joint, counts[joint.output])
        if answers is not None:
            try:
                state = answers.read_states([joint.output])[joint.output]
            except DeviceError as error:
                finding = failed(finding.subject, error)
            else:
                finding = _with_state(finding, joint, counts[joint.output], state)
        yield finding


def _with_state(finding: Finding, joint: DrivenJoint, count: int, state: ServoState) -> Finding:
    """A finding about a joint, with what its servo reports."""
    angle = joint.scale.angle(state.position)
    reports = [f"it is at {math.degrees(angle):.1f}°"]
    for value, unit in ((state.voltage, " V"), (state.temperature, " °C"), (state.current, " A")):
        reports += [] if value is None else [f"{value:.3g}{unit}"]
    reports += [] if state.load is None else [f"drives with {abs(state.load):.0%}"]
    text = f"{finding.text}; {', '.join(reports)}"
    if limitation := cut_short(joint, state):
        return bad(finding.subject, f"{text}; {limitation}", LIMITED)
    if count and abs(angle - joint.scale.angle(count)) > OFF:
        return bad(
            finding.subject,
            f"{text}: not where it was sent",
            "Look what is in its way, or on it; robotd try moves it.",
        )
    return replace(finding, text=text)


def _check_joint(joint: DrivenJoint, count: int) -> Finding:
    subject = f"joint {joint.name}"
    low, high = (math.degrees(angle) for angle in joint.reachable)
    size = math.degrees(joint.scale.resolution)
    reach = f"reaches {low:.1f}° to {high:.1f}°, {size:.2f}° a count"
    if not count:
        return look(
            subject,
            f"output {joint.output} is limp; {reach}",
            "robotd try makes it stiff, joint by joint; where robotd runs with its usual --bind: "
            f"{with_address(HOLD, DEFAULT_BIND)}",
        )
    angle = joint.scale.angle(count)
    text = f"output {joint.output} at count {count}, {math.degrees(angle):.1f}°; {reach}"
    if not joint.lower_limit - _MARGIN <= angle <= joint.upper_limit + _MARGIN:
        limits = math.degrees(joint.lower_limit), math.degrees(joint.upper_limit)
        return bad(
            subject,
            f"{text}. That is outside its limits, {limits[0]:.1f}° to {limits[1]:.1f}°.",
            "Look where it really stands, then:",
            joint.name,
        )
    usual_size = USUAL_SPAN / (len(joint.counts) - 1)
    if not _SIZES[0] <= size / usual_size <= _SIZES[1]:
        return look(
            subject,
            f"{text}. A servo usually turns by {usual_size:.2g}° a count.",
            "If its range is not as it should be:",
            joint.name,
        )
    return ok(subject, text)


def move_joints(
    joints: Sequence[DrivenJoint], counts: Mapping[int, int], servos: ServoBus, clock: Clock
) -> Iterator[Finding]:
    """Moves each joint a little, one after another, and back to where it was.

    Ends with the first failure: after a reset the board no longer stands where it is thought to.

    Args:
        joints: The joints.
        counts: Counts at which they stand, by output.
        servos: The servo board.
        clock: Clock that paces the counts.
    """
    answers = answering(servos)
    for joint in joints:
        subject = f"move {joint.name}"
        count = counts[joint.output]
        target = _aside(joint, count) if count else None
        if target is None:
            yield look(subject, "not moved: it is limp or outside its limits.", "See its joint.")
            continue
        try:
            mover = Mover(servos, joint, clock)
            watch = JointWatch([joint])
            if answers is not None:
                watch.begin(answers.read_states([joint.output]))
            mover.go(target)
            clock.sleep(_PAUSE)
            states = {} if answers is None else answers.read_states([joint.output])
            mover.go(count)
            lost = servos.verify(counts)
        except DeviceError as error:
            yield failed(subject, error)
            return
        if lost:
            yield bad(
                subject,
                f"The board lost the counts of outputs {', '.join(map(str, lost))} meanwhile.",
                "The servos' supply drops when one moves: measure it, use shorter, thicker wires.",
            )
            return
        turn = math.degrees(joint.scale.angle(target) - joint.scale.angle(count))
        if not states:
            yield ok(
                subject, f"sent by {turn:+.1f}° and back. You should have seen it: no servo tells."
            )
            continue
        commanded = {joint.name: joint.scale.angle(target)}
        off_target = watch.off_target(commanded, states)
        if off_target:
            yield bad(
                subject,
                told(off_target, watch.angles(states), commanded),
                "Look what is in its way, or on it, and whether its plug and gears are sound.",
            )
        else:
            yield ok(subject, f"sent by {turn:+.1f}° and back, and it went there.")


def _aside(joint: DrivenJoint, count: int) -> int | None:
    """A count some degrees away within the joint's reach, upwards if there is room."""
    low, high = joint.reachable
    angle = joint.scale.angle(count)
    if not low - _MARGIN <= angle <= high + _MARGIN:
        return None
    return joint.scale.count(angle + MOVE if angle + MOVE <= high else max(low, angle - MOVE))
