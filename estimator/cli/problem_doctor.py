"""``estimator doctor --problem``: what a problem can tell, before a robot has moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Final

import numpy as np

from estimator.cli.findings import ExaminedItem, Fitness
from estimator.errors import ProblemError
from estimator.exploration.prospects import (
    KNOWN,
    NEVER,
    Prospects,
    prospects,
    supposed_robot,
    with_sensors,
)
from estimator.parameters.announced import tightens
from estimator.physics.backends import open_arrays
from estimator.problem.problem import Problem
from estimator.readings.modalities import MODALITIES
from protocol.wire.capabilities import Capabilities

_TOO_MANY: Final = 1.5  # movements needed, relative to those that the problem makes
_MORE: Final = 0.1  # bits that a further sensor tells, from which on it is worth saying
_UNPREDICTED: Final = 0.1  # share of movements without a prediction that is worth a warning
_SENSORS: Final = {
    "touch": "touch sensors",
    "tilt": "an accelerometer",
    "clearance": "a distance sensor",
}


def examine_problem(
    name: str, robot: Capabilities | None, modalities: Sequence[str]
) -> Iterator[ExaminedItem]:
    """Checks what a problem says and can be expected to tell; ends early if it cannot be used.

    Args:
        name: Name or file of the problem, as for ``Problem.load``.
        robot: The robot that the problem is for; ``None``: one that it suits is supposed.
        modalities: Sensors that may count, in their usual order.
    """
    try:
        asked = Problem.load(name)
        known = supposed_robot(asked) if robot is None else robot
        has = tuple(one for one in modalities if known.sensor(one) is not None)
        problem = asked.for_robot(known)
        differences = problem.check_robot(known, has)
    except ProblemError as error:
        yield ExaminedItem("problem", Fitness.BAD, f"{error}.".replace("..", "."))
        return
    driven, joints = len(problem.motors.driven), len(known.joints)
    yield ExaminedItem(
        "problem",
        Fitness.FINE,
        f"{problem.name}: {len(problem.parts)} parts, moved by {driven} of {joints} joints.",
    )
    if robot is None:
        yield ExaminedItem(
            "robot",
            Fitness.NOTE,
            f"None is given: one with {joints} joints of ±90°, {_words(has)} and the paper's main "
            "body, 140 x 140 x 85 mm and 0.6 kg, is supposed. With --robot it is yours.",
        )
    for sentence in differences:
        yield ExaminedItem("problem", Fitness.NOTE, f"{sentence[0].upper()}{sentence[1:]}.")
    if tighter := tightens(problem.table, problem.supposed.announced):
        yield ExaminedItem("calibration", Fitness.FINE, f"The robot announces its own: {tighter}.")
    expected = _prospects(problem, known, has)
    yield _bodies(expected)
    yield _movements(problem, expected, has)
    if expected.unpredicted > _UNPREDICTED:
        yield ExaminedItem(
            "poses",
            Fitness.NOTE,
            f"After {expected.unpredicted:.0%} of random movements no model knows how its body "
            "lies, and they tell nothing: narrow motors.range_deg.",
        )
    yield from _not_identifiable(expected, has)
    for missing in (one for one in MODALITIES if one not in has):
        richer = with_sensors(known, asked.sensors or driven)
        counting = tuple(one for one in MODALITIES if one in (*has, missing))
        yield _with(missing, _prospects(asked.for_robot(richer), richer, counting), expected)


def _prospects(problem: Problem, robot: Capabilities, modalities: Sequence[str]) -> Prospects:
    with closing(open_arrays("statics", problem.settings(robot))) as physics:
        return prospects(problem, robot, physics, modalities, np.random.default_rng(0))


def _bodies(expected: Prospects) -> ExaminedItem:
    ways = f"{expected.ways:,.0f}" if expected.ways < 1e9 else f"{expected.ways:.1e}"
    parts = []
    if expected.ways > 1:
        parts.append(f"{ways} ways to attach its parts ({math.log2(expected.ways):.0f} bits)")
    if expected.lengths:
        several = "s" if expected.lengths > 1 else ""
        parts.append(
            f"{expected.lengths} length{several}, to {1000 * KNOWN:.0f} mm "
            f"({expected.length_bits:.0f} bits)"
        )
    return ExaminedItem("bodies", Fitness.FINE, f"To be found: {' and '.join(parts)}.")


def _movements(problem: Problem, expected: Prospects, has: Sequence[str]) -> ExaminedItem:
    makes = problem.search.interactions
    first = expected.movements(expected.attachment_bits)
    last = expected.movements(expected.attachment_bits + expected.length_bits)
    if math.isinf(last):
        return ExaminedItem(
            "movements", Fitness.BAD, f"By {_words(has)} no movement tells anything of the body."
        )
    told = f"By {_words(has)} a good movement tells {expected.movement_bits:.1f} bits at first: "
    if expected.ways > 1:
        told += f"attachments take about {math.ceil(first)} movements, lengths up to "
    else:
        told += "lengths take about "
    sentence = f"{told}{math.ceil(last)}; the problem makes {makes}"
    needed = first if expected.ways > 1 else last
    if needed > _TOO_MANY * makes:
        return ExaminedItem(
            "movements",
            Fitness.BAD,
            f"{sentence}, and so many unknowns are more than these can tell. Give identify "
            f"--interactions {math.ceil(needed)}, say more in the problem, or add a sensor.",
        )
    if needed > makes:
        return ExaminedItem(
            "movements",
            Fitness.NOTE,
            f"{sentence}. Give identify --interactions {math.ceil(needed)}.",
        )
    return ExaminedItem("movements", Fitness.FINE, f"{sentence}.")


def _not_identifiable(expected: Prospects, has: Sequence[str]) -> Iterator[ExaminedItem]:
    if expected.never:
        yield ExaminedItem(
            "unknowns",
            Fitness.NOTE,
            f"By {_words(has)} nobody can tell: {', '.join(expected.never)}.",
        )
    if expected.turned >= NEVER:
        yield ExaminedItem(
            "unknowns",
            Fitness.NOTE,
            f"By {_words(has)} a body feels like itself turned by a quarter or a half, or "
            "mirrored: sides, and which way parts swing sideways, are found up to that.",
        )
    if not expected.never and expected.turned < NEVER:
        yield ExaminedItem("unknowns", Fitness.FINE, "Each shows in some reading of some bodies.")


def _with(missing: str, richer: Prospects, expected: Prospects) -> ExaminedItem:
    """What a sensor that the robot lacks would tell."""
    more = richer.movement_bits - expected.movement_bits
    sentence = f"With {_SENSORS[missing]} a movement would tell " + (
        f"{richer.movement_bits:.1f} bits" if more > _MORE else "hardly more"
    )
    shown = [name for name in expected.never if name not in richer.never]
    if expected.turned >= NEVER > richer.turned:
        shown.append("sides, and which way parts swing sideways")
    return ExaminedItem(
        "sensors",
        Fitness.NOTE,
        f"{sentence}, and show what nothing shows now: {', '.join(shown)}."
        if shown
        else f"{sentence}.",
    )


def _words(modalities: Sequence[str]) -> str:
    *most, last = modalities
    return f"{', '.join(most)} and {last}" if most else last
