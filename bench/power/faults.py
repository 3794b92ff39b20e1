"""Robots that are not as their problem says, which must not make a run certain and wrong.

No check of the estimator was made for the *odd* ones: they were thought of to find runs that end
certain and wrong. Some of their faults begin during the run.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from bench.power.robots import (
    Elements,
    Robot,
    exchanged,
    make_heavier,
    noisier,
    shipped,
    with_joints,
    with_leg_mass,
)
from bench.power.trial import Trial
from estimator.problem.problem import Problem
from robot.configuration.calibration_file import (
    AxesCalibration,
    Calibration,
    DistanceCalibration,
    GaugeCalibration,
    JointCalibration,
    to_toml,
)
from robot.configuration.joint_calibration import JointScale
from robot.drivers.servos.sv203 import COUNTS
from sim_robot.simulator.electronics_sets import (
    AXES_INPUTS,
    FIRST_FOOT,
    RECESS,
    TARE_VOLTS,
    VOLTS_PER_G,
    VOLTS_PER_NEWTON,
    ZERO_VOLTS,
    pc104,
)
from sim_robot.world.body import DEFAULT, body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

_DOCS: Final = Path(__file__).parents[2] / "docs" / "problems.md"


def fault_trials(seeds: tuple[int, ...]) -> tuple[Trial, ...]:
    """Trials of each fault with sides unknown and, where that differs, with sides known.

    With sides known the truth is the robot itself; with sides unknown it is the body that the
    robot's readings describe.
    """
    variants = (("sides unknown", "topological", 6), ("sides known", "parametric", 4))
    trials = [
        Trial(
            name="the docs' tripod, another robot",
            seeds=seeds,
            problem=_tripod(),
            robot=_THREE_LEGS,
        ),
        Trial(name="lengths in millimetres", seeds=seeds[:1], problem=_in_millimetres()),
    ]
    for sides, problem, interactions in variants:
        make = partial(Trial, seeds=seeds, interactions=interactions)
        trials.append(make(name=f"another radius; {sides}", problem=_with_radius(problem)))
        for fault, robot in FAULTS.items():
            shown = robot if problem == "topological" else replace(robot, truth=str)
            trials.append(make(name=f"{fault}; {sides}", problem=problem, robot=shown))
    return tuple(trials)


def _tripod() -> str:
    """Text of the problem of a tripod, the example of the documentation."""
    (text,) = re.findall(r"```toml\n(name = \"tripod\".*?)```", _DOCS.read_text("utf-8"), re.DOTALL)
    return str(text)


def _with_radius(problem: str) -> str:
    """A problem whose outermost parts are 13 mm thick instead of 6."""
    return Problem.load(problem).source.replace("radius = 0.006", "radius = 0.013")


def _in_millimetres() -> str:
    """A problem whose lengths somebody wrote in millimetres."""
    return (
        Problem.load("topological")
        .source.replace("0.02, 0.40", "20, 400")
        .replace("0.006 ", "6.0 ")
    )


def miscalibrated(*, truth: Callable[[str], str] = str, **parts: Any) -> Robot:
    """The default robot, whose daemon believes in a calibration with these wrong parts."""
    calibration = Calibration(robot=DEFAULT, revision=1, **parts)
    return Robot(
        truth=truth,
        options=("--calibration", "{folder}/calibration.toml"),
        files={"calibration.toml": to_toml(calibration, COUNTS)},
    )


def reversed_tilt(axis: int) -> Robot:
    """A robot whose accelerometer has a sign reversed."""
    gains = [VOLTS_PER_G] * 3
    gains[axis] = -VOLTS_PER_G
    opposite = ("hip_front", "hip_back") if axis == 0 else ("hip_left", "hip_right")
    return miscalibrated(accelerometer=measured_with(gains), truth=partial(exchanged, *opposite))


def _failing(fault: str) -> Robot:
    return Robot(options=("--fault", fault))


def _along_the_diagonal(urdf: str) -> str:
    """The mirror image of a body with equal legs that puts its left to the front."""
    return exchanged("hip_left", "hip_front", exchanged("hip_right", "hip_back", urdf))


def measured_with(volts_per_g: Sequence[float]) -> AxesCalibration:
    """Calibration by which an accelerometer's axes give so many volts per g."""
    return AxesCalibration(
        wiring={"channels": AXES_INPUTS}, unit="V", zero=(ZERO_VOLTS,) * 3, per_g=tuple(volts_per_g)
    )


def _turning(factor: float, *, servos: int) -> Robot:
    """A robot whose first servos turn so many times as far as its daemon believes."""
    return miscalibrated(joints=servos_calibrated([lambda angle: angle / factor] * servos))


def servos_calibrated(
    angles: Sequence[Callable[[float], float]],
) -> dict[str, JointCalibration]:
    """Calibrations of the default robot's first servos, which map true angles to believed ones."""
    body = load_body(body_path(DEFAULT))
    joints = pc104(body, NoiseLevels()).joints
    return {
        joint.name: JointCalibration(
            output=joint.output,
            lower_limit=joint.lower_limit,
            upper_limit=joint.upper_limit,
            scale=JointScale(
                tuple((count, calibrated_at(angle)) for count, angle in joint.scale.points)
            ),
        )
        for joint, calibrated_at in zip(joints, angles, strict=False)
    }


_DULL: Final = {
    "lower_left": GaugeCalibration(
        channel=FIRST_FOOT, tare=TARE_VOLTS, volts_per_newton=VOLTS_PER_NEWTON, on=40.0, off=30.0
    )
}
_THREE_LEGS: Final = Robot(body=shipped("three_legs"))
FAULTS: Final = {
    "dead servo": _failing("servos.dead=1"),
    "servo jammed at -11°": _failing("servos.jammed=1"),
    "swapped servos": Robot(
        truth=partial(exchanged, "hip_left", "hip_front"),
        options=("--fault", "servos.swapped=1"),
    ),
    "left/right tilt reversed": reversed_tilt(1),
    "tilt axes exchanged": Robot(
        truth=_along_the_diagonal,
        options=("--fault", "daq.swapped_channels=0"),
    ),
    "gauge torn off": _failing("daq.stuck_channel=3"),
    "gauge that hardly feels": miscalibrated(gauges=_DULL),
    "servos turning 1.2 times as far": _turning(1.2, servos=8),
    "one servo turning 1.3 times as far": _turning(1.3, servos=1),
    "accelerometer that feels a fifth less": miscalibrated(
        accelerometer=measured_with((1.25 * VOLTS_PER_G, 1.25 * VOLTS_PER_G, VOLTS_PER_G))
    ),
    "distance sensor that reads 7 mm too much": miscalibrated(
        distance=DistanceCalibration(zero=RECESS - 0.007, scale=1.0)
    ),
    "ground that rises by 3° forward": _failing("ground.rises_forward=3"),
    "ground that rises by 2° forward and to the left": Robot(
        options=("--fault", "ground.rises_forward=2", "--fault", "ground.rises_left=2")
    ),
    "servos that stop 2° short": _failing("servos.short=2"),
    "servos too weak": Robot(body=partial(with_leg_mass, 0.2 / 0.09)),
    "noise three times as announced": noisier(3.0),
}


_LEGS: Final = {"left": (0.0, 1.0), "front": (1.0, 0.0), "right": (0.0, -1.0), "back": (-1.0, 0.0)}
_HIP: Final = 0.07  # m from the middle of the main body
_MOVEMENTS: Final = 7


def odd_trials(seeds: tuple[int, ...]) -> tuple[Trial, ...]:
    """Trials of each odd robot, with sides unknown."""
    robots = {
        "a servo dead during the third movement": _failing("servos.dead=2@3i+1i"),
        "a servo dead from the fourth movement on": _failing("servos.dead=2@4i"),
        "a servo that jams from the fifth movement on": _failing("servos.jammed=3@5i"),
        "servos exchanged from the fourth movement on": _failing("servos.swapped=1@4i"),
        "gauges exchanged": _failing("daq.swapped_channels=3"),
        "gauges exchanged from the fourth movement on": _failing("daq.swapped_channels=3@4i"),
        "a gauge that is always on": _always_on(),
        "a lower leg 5 times as heavy": _changed("lower_front", mass=5.0),
        "a lower leg 15 mm thick": _changed("lower_right", radius=0.015),
        "a main body twice as heavy": _changed("body", mass=2.0),
        "a main body heavier on one side": _changed("body", centre="0.02 0 0"),
        "a knee bent by 20°": _built({"knee_back": _bent(20.0)}),
        "knees bent by 15°": _built({f"knee_{leg}": _bent(15.0) for leg in _LEGS}),
        "hips 1 cm farther out": _built({f"hip_{leg}": _at(leg, out=0.01) for leg in _LEGS}),
        "hips 3 cm lower": _built({f"hip_{leg}": _at(leg, down=0.03) for leg in _LEGS}),
        "a hip 2 cm lower": _built({"hip_left": _at("left", down=0.02)}),
        "a hip 5 cm off the middle of its side": _built({"hip_left": _at("left", aside=0.05)}),
        "a leg that points 16° aside": _built({"hip_left": _at("left", turned=16.0)}),
        "zeros off by 5°, −4°, 3° and −5°": _off_zero((5.0, -4.0, 3.0, -5.0)),
        "a robot that is never laid down anew": Robot(options=("--no-operator",)),
        "noise 1.5 times as announced": noisier(1.5),
        "noise twice as announced": noisier(2.0),
    }
    return tuple(
        Trial(name=name, seeds=seeds, interactions=_MOVEMENTS, robot=robot)
        for name, robot in robots.items()
    )


def _built(joints: Mapping[str, Elements]) -> Robot:
    return Robot(body=partial(with_joints, joints))


def _bent(degrees: float) -> Elements:
    return {"origin": {"rpy": f"0 {math.radians(degrees)!r} 0"}}


def _at(
    leg: str, *, out: float = 0.0, aside: float = 0.0, down: float = 0.0, turned: float = 0.0
) -> Elements:
    """Place of a hip farther out, along its side or lower (m), or pointing to the left (°)."""
    ahead, left = _LEGS[leg]
    distance = _HIP + out
    place = (distance * ahead - aside * left, distance * left + aside * ahead, -down)
    yaw = math.atan2(left, ahead) + math.radians(turned)
    return {"origin": {"xyz": " ".join(map(str, place)), "rpy": f"0 0 {yaw!r}"}}


def _changed(
    link: str, *, mass: float = 1.0, radius: float | None = None, centre: str | None = None
) -> Robot:
    return Robot(body=partial(_with_link, link, mass, radius, centre))


def _with_link(link: str, mass: float, radius: float | None, centre: str | None, seed: int) -> str:
    """The default body with one link so many times as heavy, as thick (m), or heavy elsewhere."""
    root = ElementTree.fromstring(shipped(DEFAULT)(seed))
    inertial = root.find(f"link[@name='{link}']/inertial")
    assert inertial is not None
    make_heavier(inertial, mass)
    if centre is not None:
        ElementTree.SubElement(inertial, "origin", xyz=centre)
    for shape in root.findall(f"link[@name='{link}']/collision/geometry/*[@radius]"):
        shape.set("radius", shape.get("radius", "") if radius is None else repr(radius))
    return ElementTree.tostring(root, encoding="unicode")


def _off_zero(degrees: tuple[float, ...]) -> Robot:
    """A robot whose first servos stand so far from where its daemon believes them."""
    return miscalibrated(
        joints=servos_calibrated([partial(operator.add, math.radians(off)) for off in degrees])
    )


def _always_on() -> Robot:
    gauge = GaugeCalibration(
        channel=FIRST_FOOT,
        tare=TARE_VOLTS - 2 * VOLTS_PER_NEWTON,
        volts_per_newton=VOLTS_PER_NEWTON,
        on=0.5,
        off=0.3,
    )
    return miscalibrated(gauges={"lower_left": gauge})
