"""Robots with something wrong that no check of the estimator was made for.

They were thought of to find runs that end certain and wrong. Some of these faults begin on the way.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from functools import partial
from typing import Final
from xml.etree import ElementTree

from bench.power.faults import believing, believing_of_servos
from bench.power.robots import Robot, make_heavier, noisier, shipped, turned_joint
from bench.power.trial import Trial
from robot.configuration.calibration_file import Calibration, GaugeCalibration
from sim_robot.simulator.electronics_set import TARE_VOLTS, VOLTS_PER_NEWTON
from sim_robot.world.body import DEFAULT

_Elements = Mapping[str, Mapping[str, str]]

_LEGS: Final = {"left": (0.0, 1.0), "front": (1.0, 0.0), "right": (0.0, -1.0), "back": (-1.0, 0.0)}
_HIP: Final = 0.07  # m from the middle of the main body
_MOVEMENTS: Final = 7


def odd_trials(seeds: tuple[int, ...]) -> tuple[Trial, ...]:
    """Each of them, with sides unknown."""
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
        "a robot that is never laid down anew": _default("--no-operator"),
        "noise 1.5 times as announced": noisier(1.5),
        "noise twice as announced": noisier(2.0),
    }
    return tuple(
        Trial(name=name, seeds=seeds, interactions=_MOVEMENTS, robot=robot)
        for name, robot in robots.items()
    )


def _default(*options: str) -> Robot:
    return Robot(body=shipped(DEFAULT), options=options)


def _failing(fault: str) -> Robot:
    return _default("--fault", fault)


def _built(joints: Mapping[str, _Elements]) -> Robot:
    return Robot(body=partial(_with_joints, joints))


def _with_joints(joints: Mapping[str, _Elements], seed: int) -> str:
    urdf = shipped(DEFAULT)(seed)
    for joint, elements in joints.items():
        urdf = turned_joint(joint, elements, urdf)
    return urdf


def _bent(degrees: float) -> _Elements:
    return {"origin": {"rpy": f"0 {math.radians(degrees)!r} 0"}}


def _at(
    leg: str, *, out: float = 0.0, aside: float = 0.0, down: float = 0.0, turned: float = 0.0
) -> _Elements:
    """A hip elsewhere: farther out, along its side, lower (m), or pointing leftward of it (°)."""
    ahead, left = _LEGS[leg]
    away = _HIP + out
    place = (away * ahead - aside * left, away * left + aside * ahead, -down)
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
    return believing_of_servos([partial(operator.add, math.radians(off)) for off in degrees])


def _always_on() -> Robot:
    gauge = GaugeCalibration(
        tare=TARE_VOLTS - 2 * VOLTS_PER_NEWTON,
        volts_per_newton=VOLTS_PER_NEWTON,
        on=0.5,
        off=0.3,
    )
    return believing(Calibration(robot=DEFAULT, revision=1, gauges={"lower_left": gauge}))
