"""``estimator doctor --problem``: what a problem can tell, before a robot has moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.mounts import Vector
from estimator.cli.findings import ExaminedItem, bad, fine, note
from estimator.errors import ProblemError
from estimator.exploration.prospects import KNOWN, NEVER, Prospects, prospects
from estimator.parameters.announced import tightens
from estimator.physics.backends import open_arrays
from estimator.problem.problem import Problem
from estimator.readings.modalities import MODALITIES
from protocol.wire.capabilities import Capabilities, Joint, Sensor

_MAX_NEEDED_RATIO: Final = 1.5  # movements needed, relative to those that the problem makes
_WORTHWHILE_BITS: Final = 0.1  # bits that a further sensor tells, from which on it is worth saying
_MAX_UNPREDICTED: Final = 0.1  # share of movements without a prediction that is worth a warning
_SENSOR_NAMES: Final = {
    "touch": "touch sensors",
    "tilt": "an accelerometer",
    "clearance": "a distance sensor",
}
_PAPERS_SIZE: Final = (0.14, 0.14, 0.085)
"""Extents of the paper's main body, m."""

_DENSITY: Final = 0.6 / math.prod(_PAPERS_SIZE)  # kg/m³; the paper's main body has 0.6 kg
_RATE: Final = 50.0  # samples per second of a sensor that is supposed
_SENSORS: Final = {
    "tilt": Sensor(modality="tilt", unit="rad", count=2, noise=math.radians(0.3), rate=_RATE),
    "clearance": Sensor(modality="clearance", unit="m", count=1, noise=1e-3, rate=_RATE, upper=0.2),
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
        loaded = Problem.load(name)
        capabilities = _supposed_robot(loaded) if robot is None else robot
        has = tuple(
            modality for modality in modalities if capabilities.sensor(modality) is not None
        )
        problem = loaded.for_robot(capabilities)
        differences = problem.check_robot(capabilities, has)
    except ProblemError as error:
        yield bad("problem", f"{error}.".replace("..", "."))
        return
    if not has:
        yield bad(
            "sensors",
            f"The robot has no {' or '.join(modalities)} sensor: give other --modalities.",
        )
        return
    driven, joints = len(problem.motors.driven), len(capabilities.joints)
    yield fine(
        "problem",
        f"{problem.name}: {len(problem.parts)} parts, moved by {driven} of {joints} joints.",
    )
    if robot is None:
        yield note(
            "robot",
            f"None is given: one with {joints} joints of ±90°, {_words(has)} and "
            f"{_main_body(capabilities)}, is supposed. With --robot it is yours.",
        )
    for sentence in differences:
        yield note("problem", f"{sentence[0].upper()}{sentence[1:]}.")
    if tighter := tightens(problem.table, problem.supposed.announced):
        yield fine("calibration", f"The robot announces its own: {tighter}.")
    expected = _prospects(problem, capabilities, has)
    yield _bodies(expected)
    yield _movements(problem, expected, has)
    if expected.unpredicted > _MAX_UNPREDICTED:
        yield note(
            "poses",
            f"After {expected.unpredicted:.0%} of random movements no model knows how its body "
            "lies, and they tell nothing: narrow motors.range_deg.",
        )
    yield from _not_identifiable(expected, has)
    for missing in (modality for modality in MODALITIES if modality not in has):
        richer = _with_sensors(capabilities, loaded.sensors or driven)
        extended = tuple(modality for modality in MODALITIES if modality in (*has, missing))
        yield _lacking(missing, _prospects(loaded.for_robot(richer), richer, extended), expected)


def _prospects(problem: Problem, robot: Capabilities, modalities: Sequence[str]) -> Prospects:
    with closing(open_arrays("statics", problem.settings(robot))) as physics:
        return prospects(problem, robot, physics, modalities, np.random.default_rng(0))


def _main_body(supposed: Capabilities) -> str:
    size, papers = supposed.base_size, supposed.base_size == _PAPERS_SIZE
    whose = "the paper's main body" if papers else "a main body that fits its mounts"
    extents = " x ".join(f"{1000 * extent:.0f}" for extent in size)
    return f"{whose}, {extents} mm and {float(f'{supposed.base_mass:.2g}'):g} kg"


def _bodies(expected: Prospects) -> ExaminedItem:
    unknowns, (ways, exact) = [], expected.ways
    if ways > 1:
        rounded = f"{ways:.1e}"
        number = rounded if ways >= 1e9 else f"{ways if exact else float(rounded):,.0f}"
        unknowns.append(
            f"{'' if exact else 'about '}{number} ways to attach its parts "
            f"({math.log2(ways):.0f} bits)"
        )
    if expected.lengths:
        plural = "s" if expected.lengths > 1 else ""
        unknowns.append(
            f"{expected.lengths} length{plural}, to {1000 * KNOWN:.0f} mm "
            f"({expected.length_bits:.0f} bits)"
        )
    return fine("bodies", f"To be found: {' and '.join(unknowns)}.")


def _movements(problem: Problem, expected: Prospects, has: Sequence[str]) -> ExaminedItem:
    planned = problem.search.interactions
    for_attachments = expected.movements(expected.attachment_bits)
    for_everything = expected.movements(expected.attachment_bits + expected.length_bits)
    if math.isinf(for_everything):
        return bad("movements", f"By {_words(has)} no movement tells anything of the body.")
    intro = f"By {_words(has)} a good movement tells {expected.movement_bits:.1f} bits at first: "
    if expected.ways.number > 1:
        intro += f"attachments take about {math.ceil(for_attachments)} movements, lengths up to "
    else:
        intro += "lengths take about "
    sentence = f"{intro}{math.ceil(for_everything)}; the problem makes {planned}"
    needed = for_attachments if expected.ways.number > 1 else for_everything
    if needed > _MAX_NEEDED_RATIO * planned:
        return bad(
            "movements",
            f"{sentence}, and so many unknowns are more than these can tell. Give identify "
            f"--interactions {math.ceil(needed)}, say more in the problem, or add a sensor.",
        )
    if needed > planned:
        return note("movements", f"{sentence}. Give identify --interactions {math.ceil(needed)}.")
    return fine("movements", f"{sentence}.")


def _not_identifiable(expected: Prospects, has: Sequence[str]) -> Iterator[ExaminedItem]:
    if expected.never:
        yield note("unknowns", f"By {_words(has)} nobody can tell: {', '.join(expected.never)}.")
    if expected.turned >= NEVER:
        yield note(
            "unknowns",
            f"By {_words(has)} a body feels like itself turned by a quarter or a half, or "
            "mirrored: sides, and which way parts swing sideways, are found up to that.",
        )
    if not expected.never and expected.turned < NEVER:
        yield fine("unknowns", "Each shows in some reading of some bodies.")


def _lacking(missing: str, richer: Prospects, expected: Prospects) -> ExaminedItem:
    """What a sensor that the robot lacks would tell."""
    extra_bits = richer.movement_bits - expected.movement_bits
    sentence = f"With {_SENSOR_NAMES[missing]} a movement would tell " + (
        f"{richer.movement_bits:.1f} bits" if extra_bits > _WORTHWHILE_BITS else "hardly more"
    )
    newly_shown = [name for name in expected.never if name not in richer.never]
    if expected.turned >= NEVER > richer.turned:
        newly_shown.append("sides, and which way parts swing sideways")
    return note(
        "sensors",
        f"{sentence}, and show what nothing shows now: {', '.join(newly_shown)}."
        if newly_shown
        else f"{sentence}.",
    )


def _words(modalities: Sequence[str]) -> str:
    *most, last = modalities
    return f"{', '.join(most)} and {last}" if most else last


# --- the robot that is supposed where none is given -----------------------------------------------


def _supposed_robot(problem: Problem) -> Capabilities:
    """A robot that a problem suits, where none is known, with all sensors."""
    robot = problem.supposed
    names = robot.names or tuple(f"joint {number}" for number in range(1, robot.joints + 1))
    touch = problem.sensors if problem.touch is None else robot.touch_sensors
    size = _size(problem)
    return _with_sensors(
        Capabilities(
            robot="supposed",
            software="none",
            config_hash="none",
            base_size=size,
            base_mass=_DENSITY * math.prod(size),
            part_radii=None,
            joints=tuple(
                Joint(name=name, lower=-math.pi / 2, upper=math.pi / 2, speed=1.05, resolution=0.01)
                for name in names
            ),
            sensors=(),
            telemetry="*",
            telemetry_rate=1.0,
        ),
        touch,
    )


def _with_sensors(robot: Capabilities, touch: int) -> Capabilities:
    """The robot with sensors added that it lacks, of usual noise; ``touch`` feet if it has none."""
    sensors = dict(_SENSORS)
    if touch:
        sensors["touch"] = Sensor(modality="touch", unit="bool", count=touch, noise=0.0, rate=_RATE)
    sensors |= {sensor.modality: sensor for sensor in robot.sensors}
    return replace(robot, sensors=tuple(sensors[name] for name in MODALITIES if name in sensors))


def _size(problem: Problem) -> Vector:
    """Extents, m, of a main body that fits the problem's mounts; without any the paper's.

    Where mounts lie on both sides of the middle, the body reaches to the outermost; it is as flat
    as the paper's, or as high as its mounts.
    """
    places = [*(mount.at for mount in problem.mounts), *(part.at for part in problem.parts)]
    points = np.array([place for place in places if isinstance(place, tuple)])
    if not points.size:
        return _PAPERS_SIZE
    ends = np.round([-points.min(axis=0), points.max(axis=0)], 6)
    x, y, _ = np.where(ends.min(axis=0) > 0, 2 * ends.max(axis=0), 0.0).tolist()
    x, y = x or y or _PAPERS_SIZE[0], y or x or _PAPERS_SIZE[1]
    flat = math.sqrt(x * y) * _PAPERS_SIZE[2] / _PAPERS_SIZE[0]
    return x, y, max(flat, 2 * float(ends[:, 2].max()))
