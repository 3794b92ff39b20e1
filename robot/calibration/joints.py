"""The joints: from counts to angles, joint by joint.

A person moves a joint's count in small steps and types the angle that a protractor shows. Counts
are all that can be trusted here: neither the direction nor the size of a count is known before it
was measured. So the joint moves one step at a time, far slower than its servo can, and only as far
as it was told to.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import linear_regression
from typing import Final

from robot.calibration.questions import Questions, number
from robot.configuration.calibration_file import JointCalibration
from robot.configuration.joint_calibration import (
    USUAL_SPAN,
    DrivenJoint,
    JointScale,
    middle,
    slopes,
)
from robot.drivers.servos.servo_bus import ServoBus, answering
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.uncertainty import Uncertainty

HELP: Final = """
  u 5, d 5      five steps up or down; at most 20, and 5 without a number; a step is one count, or
                as many as make 0.7°
  -12.5         the angle that you measure now, in degrees; 0 is the planar pose, + is upward
  lower, upper  the joint may go no further down, or up, than here
  drop          forgets the last angle
  limp, hold    lets the joint go, to be moved by hand, and holds it there; with servos that say
                where they are
  done          takes the angles over; two are needed, five across the whole range are better
  skip          leaves this joint as it was
  ?             this list
  q             leaves; the robot holds, and this joint keeps what it had"""

MAX_STEP: Final = 20  # steps in one move: 14°, which a person can follow and stop
PACE: Final = 0.03  # s between counts besides the serial line's own: about 13° a second
_STEP: Final = math.radians(0.7)
_MIN_APART: Final = 10  # steps between two measured angles
_ZERO_TOLERANCE: Final = 1.5  # degrees; two steps
_READING_ERROR: Final = 0.3  # degrees: a protractor that is read to 0.5° either way
_MAX_EXTRAPOLATION: Final = 30  # steps by which a scale may be extrapolated without a warning: 21°


def step_of(scale: JointScale) -> int:
    """Counts that a joint moves at once: one, or as many as make 0.7° by its present scale."""
    return max(1, int(_STEP / scale.resolution))


class Mover:
    """Moves one servo, step by step; methods raise ``DeviceError`` where its board failed.

    Args:
        servos: The servo driver.
        joint: Joint to move.
        clock: Clock that paces the counts.

    Attributes:
        count: Count to which the servo was sent; 0 while it is limp.
        measures: Whether the servo reports its position.
    """

    def __init__(self, servos: ServoBus, joint: DrivenJoint, clock: Clock):
        self._servos = servos
        self._output = joint.output
        self._nearest = joint.nearest
        self._step = step_of(joint.scale)
        self._clock = clock
        self._answering = answering(servos)
        self.measures = self._answering is not None
        self.count = servos.read_counts([self._output])[self._output]

    def where(self) -> int:
        """Count to which the servo was sent; of a limp one, what it reports, or 0 without that."""
        if self.count or self._answering is None:
            return self.count
        return self._nearest(self._answering.read_states([self._output])[self._output].position)

    def go(self, target: int) -> None:
        """Moves to a count; a limp servo jumps there, unless it reports its position.

        Raises:
            DeviceDataError: The board was reset; the next try starts from its present count.
        """
        self.check()
        if self.count == 0:
            self._send(self.where() or target)
        while self.count != target:
            step = min(self._step, abs(target - self.count))
            self._send(self.count + (step if target > self.count else -step))
            self._clock.sleep(PACE)

    def release(self) -> None:
        """Lets the servo go limp."""
        self._servos.release([self._output])
        self.count = 0

    def check(self) -> None:
        """Makes sure that the board still holds the count.

        Raises:
            DeviceDataError: The board lost the count: it was reset.
        """
        expected = self.count
        try:
            lost = self._servos.verify({self._output: expected})
        except DeviceDataError:
            self._look_anew()
            raise
        if lost:
            self._look_anew()
            raise DeviceDataError(
                f"The servo board ({self._servos.name}) lost count {expected} and stands at "
                f"{self.count}: it was reset.",
                "Check the servos' supply.",
            )

    def _look_anew(self) -> None:
        """Takes over the count that the board has now; it may have to be set up for that."""
        self._servos.forget()
        self.count = self._servos.read_counts([self._output])[self._output]

    def _send(self, count: int) -> None:
        self._servos.set_counts({self._output: count})
        self.count = count


def calibrate_joint(
    joint: DrivenJoint, mover: Mover, dialogue: Questions
) -> JointCalibration | None:
    """Leads through one joint.

    Returns:
        What was measured, or ``None`` if the joint was skipped; it then went back to where it was,
        or was let go limp again.

    Raises:
        AbandonedError: Somebody left.
    """
    dialogue.say(f"\n{joint.name}, servo output {joint.output}")
    was_limp = mover.count == 0
    if was_limp and not mover.measures:
        prompt = f"{joint.name} is limp; hold it, then Enter drives it to its middle; or skip"
        if dialogue.choose(prompt, "", "skip"):
            return None
        dialogue.attempt(lambda: mover.go(middle(joint.counts)))
    start = mover.count
    measuring = _Measuring(joint, mover, dialogue)
    while True:
        answer = dialogue.ask(measuring.prompt)
        if answer == "skip":
            dialogue.attempt(mover.release if was_limp else lambda: mover.go(start))
            return None
        if answer == "done":
            calibration = measuring.finish()
            if calibration is not None:
                return calibration
        else:
            measuring.take(answer)


class _Measuring:
    """The angles of one joint so far."""

    def __init__(self, joint: DrivenJoint, mover: Mover, dialogue: Questions):
        self._joint = joint
        self._mover = mover
        self._dialogue = dialogue
        self._counts = joint.counts
        self._step = step_of(joint.scale)
        self._points: list[tuple[int, float]] = []  # count, degrees
        self._limits: dict[str, int] = {}

    @property
    def prompt(self) -> str:
        count = self._dialogue.attempt(self._mover.where)
        expected = math.degrees(self._joint.scale.angle(count))
        measured = f"{len(self._points)} angle{'' if len(self._points) == 1 else 's'}"
        return (
            f"{self._joint.name}: {'' if self._mover.count else 'limp, '}count {count}, was "
            f"{expected:.1f}°, {measured} measured"
        )

    def take(self, answer: str) -> None:
        """Carries out one answer."""
        move = re.fullmatch(r"([ud]) *(\d*)", answer)
        angle = number(answer)
        if move is not None:
            self._move(1 if move[1] == "u" else -1, int(move[2] or 5))
        elif angle is not None:
            self._measure(angle)
        elif answer in ("lower", "upper"):
            count = self._limits[answer] = self._dialogue.attempt(self._mover.where)
            self._dialogue.say(f"Count {count} is the {answer} limit.")
        elif answer == "limp" and self._mover.measures:
            if not self._dialogue.choose("support it, then Enter lets it go; or hold", "", "hold"):
                self._dialogue.attempt(self._mover.release)
        elif answer == "hold" and self._mover.measures:
            self._dialogue.attempt(lambda: self._mover.go(self._mover.where()))
        elif answer == "drop" and self._points:
            count, angle = self._points.pop()
            self._dialogue.say(f"{angle:g}° at count {count} is forgotten.")
        else:
            self._dialogue.say(HELP)

    def finish(self) -> JointCalibration | None:
        """Checks the table, goes to its zero, and lets a person look at it."""
        try:
            joint = self._table()
        except ValueError as error:
            self._dialogue.say(f"Not yet: it {error}.")
            return None
        scale, old_scale = joint.scale, self._joint.scale
        if (scale.angle(2) > scale.angle(1)) != (old_scale.angle(2) > old_scale.angle(1)):
            self._dialogue.say("It turns the other way than was thought; that is put right.")
        self._say_what_is_guessed(joint)
        self._dialogue.attempt(lambda: self._mover.go(scale.count(0.0)))
        zero, expected = self._zero_angle(), math.degrees(scale.angle(scale.count(0.0)))
        if zero is not None and abs(zero) > _ZERO_TOLERANCE:
            self._dialogue.say(
                f"It should be 0° and is {zero:g}°: one of the angles is wrong, or there are too "
                "few of them near 0°. Add or drop some."
            )
            return None
        return JointCalibration(
            output=joint.output,
            lower_limit=joint.lower_limit,
            upper_limit=joint.upper_limit,
            scale=scale,
            uncertainty=known_to(self._points, 0.0 if zero is None else zero - expected),
        )

    def _move(self, direction: int, steps: int) -> None:
        target = self._dialogue.attempt(self._mover.where) + direction * steps * self._step
        if not (1 <= steps <= MAX_STEP and target in self._counts):
            self._dialogue.say(
                f"A move has 1 to {MAX_STEP} steps of {self._step}, and counts run from "
                f"{self._counts[0]} to {self._counts[-1]}."
            )
            return
        self._dialogue.attempt(lambda: self._mover.go(target))

    def _measure(self, angle: float) -> None:
        sent, count = self._mover.count, self._dialogue.attempt(self._mover.where)
        self._dialogue.attempt(self._mover.check)
        if self._mover.count != sent:
            self._dialogue.say(f"It moved to count {self._mover.count}: measure once more.")
            return
        others = [point for point in self._points if point[0] != count]
        reason = _objection([*others, (count, angle)], self._counts, _MIN_APART * self._step)
        if reason is not None:
            self._dialogue.say(f"{angle:g}° at count {count} is not taken: {reason}")
            return
        self._points = [*others, (count, angle)]
        self._dialogue.say(f"{angle:g}° at count {count}.")

    def _table(self) -> DrivenJoint:
        points = tuple((count, math.radians(angle)) for count, angle in self._points)
        scale = JointScale(points)
        limits = {name: scale.angle(count) for name, count in self._limits.items()}
        lower = limits.get("lower", self._joint.lower_limit)
        upper = limits.get("upper", self._joint.upper_limit)
        if lower >= upper:
            raise ValueError(
                f"has its lower limit at {math.degrees(lower):.1f}° and its upper one at "
                f"{math.degrees(upper):.1f}°; mark them again"
            )
        joint = replace(self._joint, scale=scale, lower_limit=lower, upper_limit=upper)
        joint.check_zero()
        return joint

    def _zero_angle(self) -> float | None:
        while True:
            answer = self._dialogue.ask(
                f"{self._joint.name} at its new 0°: the angle measured, or Enter"
            )
            if not answer:
                return None
            angle = number(answer)
            if angle is not None:
                return angle
            self._dialogue.say("Answer an angle in degrees, Enter, or q to leave.")

    def _say_what_is_guessed(self, joint: DrivenJoint) -> None:
        counts = [count for count, _ in self._points]
        limits = [joint.scale.count(angle) for angle in joint.reachable]
        extrapolation = max(min(counts) - min(limits), max(limits) - max(counts))
        if extrapolation > _MAX_EXTRAPOLATION * self._step:
            self._dialogue.say(
                f"Measured from count {min(counts)} to {max(counts)}; it may go from {min(limits)} "
                f"to {max(limits)}, where its angle is a guess."
            )


def known_to(points: Sequence[tuple[int, float]], off: float) -> Uncertainty:
    """Uncertainty of a table of counts and angles.

    A reading errs as a protractor does, or by as much as the readings scatter about a straight
    line, whichever is more; the zero also by as much as the table is off at its new 0°. The table
    goes through the readings, so that at each of them its error is the reading's: it is not
    reduced by averaging over many readings.

    Args:
        points: Counts and angles, degrees; at least two.
        off: By how much the table is off at its new 0°, degrees.
    """
    angles = [angle for _, angle in points]
    error = _READING_ERROR
    if len(points) > 2:
        slope, start = linear_regression(*zip(*points, strict=True))
        squares = sum((angle - start - slope * count) ** 2 for count, angle in points)
        error = max(error, math.sqrt(squares / (len(points) - 2)))
    return Uncertainty(
        zero=math.radians(max(error, abs(off))),
        gain=math.sqrt(2) * error / (max(angles) - min(angles)),
    )


def _objection(points: Sequence[tuple[int, float]], counts: range, apart: int) -> str | None:
    """What is wrong with a table of counts and degrees, or ``None``; ``apart`` is in counts."""
    least_slope, most_slope = slopes(counts)
    usual_slope = USUAL_SPAN / (len(counts) - 1)
    rising: set[bool] = set()
    for (count, angle), (next_count, next_angle) in pairwise(sorted(points)):
        if next_count - count < apart:
            return (
                f"count {count} and count {next_count} were both measured; move at least "
                f"{apart} counts in between."
            )
        slope = (next_angle - angle) / (next_count - count)
        if not least_slope <= abs(slope) <= most_slope:
            return (
                f"from count {count} to {next_count} that would be {abs(slope):.2g}° a count, and "
                f"{usual_slope:.2g}° is usual. Is the joint at a stop, or an angle mistyped?"
            )
        rising.add(slope > 0)
    if len(rising) > 1:
        return "the angles must rise or fall all along the counts. Is one of them mistyped?"
    return None
