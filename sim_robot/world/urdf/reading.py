"""Reads a URDF file: declarations, all that is wrong with it, and all that is taken otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

from lxml import etree
from pydantic import ValidationError
from pydantic_xml import BaseXmlModel

from sim_robot.errors import BodyError
from sim_robot.world.urdf.customary import rewrite
from sim_robot.world.urdf.declarations import Joint, Link, Robot
from sim_robot.world.urdf.elements import Element

_LONGEST: Final = 200  # characters of an attribute; PyBullet dies of a hundred thousand
_SUBSET: Final = "is outside the subset (box, cylinder, sphere; fixed and revolute joints)"
Item = TypeVar("Item", bound=BaseXmlModel)


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a file says.

    Attributes:
        robot: Its links and joints, without those that are wrong in themselves.
        faults: What is wrong.
        notes: What is taken otherwise than it stands there.
    """

    robot: Robot
    faults: tuple[BodyError, ...]
    notes: tuple[str, ...]


def read_urdf(path: Path) -> Description:
    """Reads a URDF file.

    Raises:
        BodyError: The file cannot be read, is no XML or no URDF.
    """
    root, faults, notes = _parsed(path), list[BodyError](), list[str]()

    def fault(element: str, reason: str) -> None:
        faults.append(BodyError(str(path), element, reason))

    for item in root.iter():
        if max((len(value) for value in item.attrib.values()), default=0) > _LONGEST:
            fault(f"<{item.tag}>", f"no attribute may have more than {_LONGEST} characters.")
    if not faults:
        rewrite(root, path, note=lambda place, what: notes.append(f"{place} {what}"), fault=fault)
    links = _all(root, Link, "link", path, faults)
    joints = _all(root, Joint, "joint", path, faults)
    robot = Robot(
        name=root.get("name", ""), version=root.get("version"), links=links, joints=joints
    )
    return Description(robot=robot, faults=tuple(faults), notes=tuple(notes))


def _parsed(path: Path) -> Element:
    try:
        parser = etree.XMLParser(remove_comments=True, remove_pis=True, resolve_entities=False)
        root = etree.fromstring(path.read_bytes(), parser)
    except OSError as error:
        raise BodyError(str(path), "", f"cannot be read: {error.strerror}.") from error
    except etree.XMLSyntaxError as error:
        raise BodyError(str(path), "", f"is not valid XML: {error.msg}.") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise BodyError(str(path), "<!DOCTYPE>", "is no part of URDF; leave it out, and entities.")
    if root.tag != "robot":
        raise BodyError(str(path), f"<{root.tag}>", "the root element must be <robot>.")
    return root


def _all(
    root: Element, kind: type[Item], tag: str, path: Path, faults: list[BodyError]
) -> list[Item]:
    """All links, or all joints, that are what the declaration says."""
    items = []
    for number, element in enumerate(root.findall(tag), start=1):
        # The validator searches for elements by exchanging them with those that stand in their
        # place, so collisions would come out of document order.
        element[:] = sorted(element, key=lambda child: child.tag == "collision")
        try:
            items.append(kind.from_xml_tree(element))  # type: ignore[arg-type]  # two sets of types
        except ValidationError as error:
            name = element.get("name", f"number {number}")
            for wrong in error.errors():
                inner = ".".join(str(part) for part in wrong["loc"] if not isinstance(part, int))
                place = ": ".join(filter(None, (f"{tag} '{name}'", inner)))
                place = place.replace("collisions", "collision")
                reason = wrong["msg"].replace("Value error, ", "")
                reason = reason.replace("Extra inputs are not permitted", _SUBSET)
                faults.append(BodyError(str(path), place, f"{reason}."))
    return items
