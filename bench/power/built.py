"""Robots that are built otherwise than their problem says: what the table of parameters is for.

The simulator runs what is built; the estimator is told what is stated. Bodies are changed before
they are written as URDF, and sensors by the daemon's calibration of them or by faults of
``sim-robotd``: nothing here calls the code by which the estimator changes bodies. A turn of the
accelerometer about the vertical, of less than a right angle, is left out: no option sets it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from typing import Final
from xml.etree import ElementTree

import numpy as np

from bench.power.faults import measured_with, miscalibrated, reversed_tilt, servos_calibrated
from bench.power.robots import Otherwise, Robot, TextOf, shipped, with_joints
from bench.power.trial import Trial
from bench.prior_bodies import drawn_genes, on_robot
from estimator.body.morphology import BASE, Array, Morphology
from estimator.problem.problem import Problem
from estimator.report.export.formats import in_words_of, urdf
from robot.configuration.calibration_file import (
    AxesCalibration,
    Calibration,
    DistanceCalibration,
    to_toml,
)
from robot.drivers.servos.sv203 import COUNTS
from sim_robot.simulator.electronics_sets import AXES_INPUTS, RECESS, VOLTS_PER_G, ZERO_VOLTS
from sim_robot.world.body import DEFAULT

BUILT: Final = "built"
"""Name of the group of these trials."""

_PROBLEM: Final = "topological"
_LEGS: Final = 4
_MANY_MOVEMENTS: Final = 8  # movements
_FEW_MOVEMENTS: Final = 4
_MASS_FACTOR: Final = 3.5
_SHORTEST: Final = 0.1  # m, roughly the shortest leg
_LONGEST: Final = 0.4  # m, the longest leg that the problem allows
_CONFUSED: Final = ((5.0, 7.5, "box"), (7.5, 5.0, "box"), (6.0, 13.0, "capsule"))
_CONFUSED_TOO: Final = (13.0, 6.0, "capsule")
_QUARTER: Final = "accelerometer by a quarter turn"


def built_trials(seeds: tuple[int, ...]) -> tuple[Trial, ...]:
    """All trials of robots that are built otherwise.

    Args:
        seeds: Thirty seeds; most trials take the first few.
    """
    unknown = partial(Trial, problem=_PROBLEM, interactions=_MANY_MOVEMENTS)
    known = partial(Trial, problem="parametric", interactions=_FEW_MOVEMENTS, seeds=seeds[:10])
    trials = [unknown(name="as people build them", seeds=seeds, robot=_AS_BUILT)]
    trials.append(
        unknown(
            name=f"legs {_MASS_FACTOR} times as heavy",
            seeds=seeds[:6],
            robot=Robot(
                body=partial(standing_body, _stated(density=1000 * _MASS_FACTOR)),
                otherwise=Otherwise("mass of all parts", math.log(_MASS_FACTOR), narrow=True),
            ),
        )
    )
    for true, called, shape in (*_CONFUSED, _CONFUSED_TOO):
        kind = "bars" if shape == "box" else "rods"
        body = partial(standing_body, _stated(radius=true, shape=shape))
        robot = Robot(
            body=body,
            options=_CONFIG,
            files={"robot.toml": partial(_stating, called, body)},
            otherwise=Otherwise("thickness of all parts", math.log(true / called), narrow=True),
        )
        trials.append(
            unknown(
                name=f"{kind} of {true:g} mm called {called:g}",
                seeds=seeds[:5],
                problem=_stated(radius=called, shape=shape),
                robot=robot,
            )
        )
    for degrees, leg in ((15.0, "front"), (30.0, "left"), (-30.0, "back"), (-15.0, "right")):
        name = f"hinge of the {leg} leg turned by {degrees:g}°"
        trials.append(unknown(name=name, seeds=seeds[:5], robot=_twisted(leg, degrees)))
    trials += [known(name=name, robot=robot) for name, robot in _wired().items()]
    trials += [unknown(name=name, seeds=seeds[:15], robot=robot) for name, robot in _FAILED.items()]
    return tuple(trials)


def _stated(*, density: float = 1000.0, radius: float = 6.0, shape: str = "capsule") -> str:
    """Text of the problem with parts of another density, kg/m³, radius, mm, or shape."""
    return (
        Problem.load(_PROBLEM)
        .source.replace("density = 1000.0", f"density = {density!r}")
        .replace("radius = 0.006", f'shape = "{shape}"\nradius = {radius / 1000!r}')
    )


def _standing(problem: str, seed: int) -> Morphology:
    """A body with the default robot's attachments, and lengths of 115 to 400 mm.

    Most bodies of the whole prior lie on their bellies whatever they do: their lengths are never
    known, so that intervals hold by themselves.
    """
    _, genome, _ = on_robot(problem)
    body = genome.decode(drawn_genes(genome, np.random.default_rng([seed, 1])))
    (up,) = (index for index, hinge in enumerate(body.hinges) if hinge.name == "up")
    parts = (
        replace(
            part,
            parent=BASE,
            mount=leg,
            hinge=up,
            sensor=leg,
            length=_SHORTEST + (1 - _SHORTEST / _LONGEST) * part.length,
        )
        for leg, part in enumerate(body.parts)
    )
    return replace(body, parts=tuple(parts))


def standing_body(problem: str, seed: int) -> str:
    """URDF of a standing body that is as a problem says; the problem by name, or its text."""
    loaded, _, robot = on_robot(problem)
    return urdf(in_words_of(loaded, robot, _standing(problem, seed)))


def _stating(radius: float, body: TextOf, seed: int) -> str:
    """Configuration of a robot with a drawn body, which states a radius, mm, as the problem does.

    Without it the simulator would announce what is built.
    """
    root = ElementTree.fromstring(body(seed))
    carriers = {parent.get("link") for parent in root.iter("parent")}
    feet = [name for link in root.findall("link") if (name := link.get("name")) not in carriers]
    text = resources.files("robot").joinpath("robot.toml").read_text("utf-8")
    head, *tables = text.split("\n[[joint]]\n")
    tables[-1], *sensors = tables[-1].split("\n[[touch]]\n")
    joints = [
        re.sub(r"radius_mm = \d+", f"radius_mm = {radius}", joint) for joint in tables[:_LEGS]
    ]
    named = [
        re.sub(r'name = "\w+"', f'name = "{foot}"', sensor)
        for foot, sensor in zip(feet, sensors, strict=False)
    ]
    head = re.sub(r"joints = \d+", f"joints = {_LEGS}", head)
    head = re.sub(r"touch_sensors = \d+", f"touch_sensors = {len(named)}", head)
    tables = [f"\n[[joint]]\n{joint}" for joint in joints]
    return "".join([head, *tables, *(f"\n[[touch]]\n{sensor}" for sensor in named)])


_CONFIG: Final = ("--config", "{folder}/robot.toml")


# --- robots as people build them --------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Draw:
    """How one robot differs from what is stated; SI, and factors.

    Attributes:
        thickness: Factor on the thickness of each leg, shape (legs,).
        mass: Factor on the mass of all legs.
        centre: Centre of mass of the main body, m, shape (3,).
        zeros: Zero of each servo, rad, shape (legs,).
        travel: Factor on the travel of each servo, shape (legs,).
        level: How the accelerometer is turned, forward/back and left/right, rad, shape (2,).
        gain: Gain of the accelerometer.
        distance: What the distance sensor reads too much, m.
        ruler: Gain of the distance sensor.
    """

    thickness: Array
    mass: float
    centre: Array
    zeros: Array
    travel: Array
    level: Array
    gain: float
    distance: float
    ruler: float

    @classmethod
    def of(cls, seed: int) -> _Draw:
        """Draws from the narrow priors, as the documentation of problems gives them."""
        rng = np.random.default_rng([seed, 2])
        normal = rng.standard_normal
        return cls(
            thickness=np.exp(0.25 * normal() + 0.05 * normal(_LEGS)),
            mass=math.exp(1.0 * normal()),
            centre=0.005 * normal(3),
            zeros=np.radians(0.4 * normal(_LEGS)),
            travel=np.exp(0.01 * normal(_LEGS)),
            level=np.radians(0.4 * normal(2)),
            gain=math.exp(0.01 * normal()),
            distance=0.002 * normal(),
            ruler=math.exp(0.01 * normal()),
        )


def _body_as_built(seed: int) -> str:
    """URDF of a standing body with other parts: a thicker part has no other mass."""
    problem, _, robot = on_robot(_PROBLEM)
    body, draw = _standing(_PROBLEM, seed), _Draw.of(seed)
    parts = []
    for part, factor in zip(body.parts, draw.thickness.tolist(), strict=True):
        density = draw.mass * body.density / factor**2
        parts.append(replace(part, radius=factor * part.radius, density=density))
    x, y, z = draw.centre.tolist()
    changed = replace(body, parts=tuple(parts), base=replace(body.base, centre=(x, y, z)))
    return urdf(in_words_of(problem, robot, changed))


def _believed(seed: int) -> str:
    """Calibration, TOML, that the daemon of such a robot has of its servos and sensors."""
    draw = _Draw.of(seed)
    zero = [ZERO_VOLTS + VOLTS_PER_G * math.sin(turn) for turn in draw.level.tolist()]
    gains = (VOLTS_PER_G / draw.gain, VOLTS_PER_G / draw.gain, VOLTS_PER_G)
    calibration = Calibration(
        robot=DEFAULT,
        revision=1,
        joints=servos_calibrated(
            [partial(_commanded, *servo) for servo in zip(draw.zeros, draw.travel, strict=True)]
        ),
        accelerometer=AxesCalibration(
            wiring={"channels": AXES_INPUTS}, unit="V", zero=(*zero, ZERO_VOLTS), per_g=gains
        ),
        distance=DistanceCalibration(zero=RECESS - draw.distance, scale=draw.ruler),
    )
    return to_toml(calibration, COUNTS)


def _commanded(zero: float, travel: float, angle: float) -> float:
    """Angle that a servo is told, rad, when it goes to ``angle``."""
    return float((angle - zero) / travel)


_AS_BUILT: Final = Robot(
    body=_body_as_built,
    options=(*_CONFIG, "--calibration", "{folder}/calibration.toml"),
    files={"calibration.toml": _believed, "robot.toml": partial(_stating, 6.0, _body_as_built)},
)


# --- one thing otherwise ----------------------------------------------------------------------


def _twisted(leg: str, degrees: float) -> Robot:
    """The default robot with a hinge turned about its leg; attachments count as unchanged."""
    turn = math.radians(degrees)
    axis = {"xyz": f"0 {-math.cos(turn)!r} {-math.sin(turn)!r}"}
    number = ("left", "front", "right", "back").index(leg) + 1
    return Robot(
        body=partial(with_joints, {f"hip_{leg}": {"axis": axis}}),
        truth=_shipped,
        otherwise=Otherwise(f"hinge of leg {number} about its own length", turn),
    )


def _shipped(urdf: str) -> str:
    del urdf
    return shipped(DEFAULT)(0)


def _wired() -> dict[str, Robot]:
    """Robots, by name, of other wiring than stated; what no sensor can tell apart is the same."""
    quarter = measured_with((-VOLTS_PER_G, VOLTS_PER_G, VOLTS_PER_G))
    return {
        "servo reversed": Robot(
            body=partial(with_joints, {"hip_left": {"axis": {"xyz": "0 1 0"}}}),
            truth=_shipped,
            otherwise=Otherwise("servo of left upper reversed"),
        ),
        "servo plugs exchanged": _default(
            "plugs of left upper and front upper exchanged", "servos.swapped=1"
        ),
        "gauge plugs exchanged": _default(
            "plugs of touch sensors 1 and 2 exchanged", "daq.swapped_channels=3"
        ),
        "accelerometer by 90°": replace(
            miscalibrated(accelerometer=quarter),
            options=(
                *miscalibrated(accelerometer=quarter).options,
                *("--fault", "daq.swapped_channels=0"),
            ),
            otherwise=Otherwise(_QUARTER),
        ),
        "left/right tilt reversed": replace(
            reversed_tilt(1), truth=str, otherwise=Otherwise("left/right tilt reversed")
        ),
    }


def _default(cause: str, *faults: str, amount: float | None = None) -> Robot:
    options = [word for fault in faults for word in ("--fault", fault)]
    return Robot(options=tuple(options), otherwise=Otherwise(cause, amount))


_JAMMED: Final = 20.0  # degrees

_FAILED: Final = {
    "a servo too weak": Robot(
        body=partial(with_joints, {"hip_left": {"limit": {"effort": "0.2"}}}),
        otherwise=Otherwise(""),
    ),
    "a servo dead": _default("servo of leg 1 dead", "servos.dead=1"),
    "a servo jammed": _default(
        "servo of leg 2 jammed",
        *("servos.jammed=2", f"servos.slipped=2:{_JAMMED:g}"),
        amount=math.radians(_JAMMED),
    ),
    "a gauge stuck on": _default("touch sensor 3 stuck on", "sensors.pressed=3"),
}
"""A weak servo is in no row: nothing may be named for sure."""
