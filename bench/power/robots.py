"""Bodies to start simulated robots with, and what counts as the truth about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from sim_robot.world.body import DEFAULT, body_path

TextOf = Callable[[int], str]
"""Returns, for a seed, the URDF of a body, or the content of a file."""

Elements = Mapping[str, Mapping[str, str]]
"""Attributes of a joint in URDF, by element."""


def shipped(name: str) -> TextOf:
    """A body that comes with the simulator, by name, or the body in a file."""
    return partial(_read, name)


def _read(name: str, seed: int) -> str:
    del seed  # it is always the same
    return body_path(name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Otherwise:
    """The one thing that a robot has otherwise than its problem says.

    Attributes:
        cause: Name of its row in the table of parameters, or how the name begins; empty: there is
            no row.
        amount: How far it is from what is stated: SI; for factors, logarithms; ``None``: there is
            nothing to measure.
        narrow: Whether it is something that is always a little otherwise, and no cause.
    """

    cause: str
    amount: float | None = None
    narrow: bool = False


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A simulated robot.

    Attributes:
        body: Returns the URDF of its body, for a seed.
        truth: Returns the URDF of the body that its readings describe, given that of its body: a
            mirrored one, for instance, where a tilt has its sign reversed.
        options: Options of ``sim-robotd``; ``{folder}`` stands for the folder of ``files``.
        files: Content of files, or what returns it for a seed, by name.
        otherwise: What it has otherwise than its problem says; ``None``: nothing, or many things.
    """

    body: TextOf = shipped(DEFAULT)
    truth: Callable[[str], str] = str
    options: tuple[str, ...] = ()
    files: Mapping[str, TextOf | str] = field(default_factory=dict)
    otherwise: Otherwise | None = None

    def write_files(self, folder: Path, seed: int) -> None:
        """Writes ``files`` for a seed."""
        for name, content in self.files.items():
            text = content if isinstance(content, str) else content(seed)
            (folder / name).write_text(text, encoding="utf-8")


def noisier(factor: float) -> Robot:
    """The default robot with so many times the noise that it announces."""
    noise = f"tilt_deg = {0.3 * factor}\nclearance_mm = {factor}\nannounced = {1 / factor!r}\n"
    options = ("--noise", "{folder}/noise.toml")
    return Robot(options=options, files={"noise.toml": noise})


def with_leg_mass(factor: float, seed: int) -> str:
    """The default body, with every link but the main body so many times as heavy."""
    root = ElementTree.fromstring(shipped(DEFAULT)(seed))
    for link in root.findall("link")[1:]:
        for inertial in link.findall("inertial"):
            make_heavier(inertial, factor)
    return ElementTree.tostring(root, encoding="unicode")


def make_heavier(inertial: ElementTree.Element, factor: float) -> None:
    """Multiplies a link's mass and inertia."""
    for element in inertial:
        if element.tag in ("mass", "inertia"):
            for key, value in element.attrib.items():
                element.set(key, repr(factor * float(value)))


def turned_joint(joint: str, elements: Elements, urdf: str) -> str:
    """A body of which a joint has other attributes, by element: its place, or its axis."""
    root = ElementTree.fromstring(urdf)
    joint_element = root.find(f"joint[@name='{joint}']")
    assert joint_element is not None
    for tag, attributes in elements.items():
        element = joint_element.find(tag)
        assert element is not None
        element.attrib.update(attributes)
    return ElementTree.tostring(root, encoding="unicode")


def with_joints(joints: Mapping[str, Elements], seed: int) -> str:
    """The default body of which some joints have other attributes."""
    urdf = shipped(DEFAULT)(seed)
    for joint, elements in joints.items():
        urdf = turned_joint(joint, elements, urdf)
    return urdf


def exchanged(one: str, other: str, urdf: str) -> str:
    """A body with two legs in each other's place."""
    root = ElementTree.fromstring(urdf)
    places = [root.find(f"joint[@name='{name}']/origin") for name in (one, other)]
    first, second = (dict(place.attrib) for place in places if place is not None)
    for place, attributes in zip(places, (second, first), strict=True):
        assert place is not None
        place.attrib.update(attributes)
    return ElementTree.tostring(root, encoding="unicode")


def two_on_one_side(seed: int) -> str:
    """Four legs of 200 mm: two on the left, on the same hip, one at the front, one at the back.

    The second one on the left is hinged so that it swings to the side.
    """
    root = ElementTree.fromstring(_read("leg_on_leg", seed))
    for element in root.findall("*"):
        if element.get("name") in ("branch", "hip_branch"):
            root.remove(element)
    root.set("name", "two_on_one_side")
    at_left = {"xyz": "0 0.07 0", "rpy": f"0 0 {math.pi / 2!r}"}
    return turned_joint(
        "hip_right",
        {"origin": at_left, "axis": {"xyz": "0 0 1"}},
        ElementTree.tostring(root, encoding="unicode"),
    )


BODIES: Final[Mapping[str, TextOf]] = {
    "damaged leg": shipped("damaged_leg"),
    "unequal legs": shipped("unequal_legs"),
    "leg on leg": shipped("leg_on_leg"),
    "twisted hinge": shipped("twisted_hinge"),
    "two legs on one side": two_on_one_side,
    "legs 3.5 times as heavy": partial(with_leg_mass, 3.5),
}
"""The six other bodies of the study."""
