"""Reads a URDF file: the body that is simulated, all that is wrong, all that is taken otherwise.

In this order, so that nothing is rewritten before it was checked: the file is held against bounds,
parsed, freed of the words of other programs; its links and joints are checked one by one; they are
normalised; what became of them is checked as a whole.

Words of other programs (``<mujoco>``, ``<ros2_control>``, ``dont_collapse``) are ignored, with a
note, as every simulator reads its own and the reference parser (urdfdom) skips them. A word that is
almost one of URDF's is refused: a body without its ``<colision>`` would be another body. So is
xacro, from which URDF is yet to be made.
"""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Final, TypeAlias, TypeVar, get_args

from lxml import etree
from pydantic import ValidationError
from pydantic_xml import BaseXmlModel

from sim_robot.errors import BodyError
from sim_robot.world.urdf.checks import MAX_LINKS, faults_of
from sim_robot.world.urdf.declarations import Joint, Link, Robot, Say, Visual
from sim_robot.world.urdf.meshes import LFS_POINTER
from sim_robot.world.urdf.normalisation import normalise

LARGEST: Final = 4 * 2**20
"""Most bytes of a file; the descriptions of whole humanoids have a tenth of that."""

MAX_ELEMENTS: Final = 20_000
"""Most XML elements of a file; a hundred links with all their parts have a tenth of that."""

MAX_WRITTEN: Final = 10 * MAX_LINKS
"""Most links, and most joints, as they are written: those without mass are joined to others."""

_MAX_LENGTH: Final = 200  # characters of an attribute; PyBullet dies of a hundred thousand
_SKIPPED_WORDS: Final = (
    "visual",
    "material",
    "gazebo",
    "transmission",
)  # words of URDF, skipped in silence
_MOTION_TAGS: Final = ("axis", "limit", "dynamics")  # of a fixed joint they mean nothing
_ROBOT_PARTS: Final[dict[str, type[BaseXmlModel]]] = {"link": Link, "joint": Joint}
_SIMILARITY: Final = 0.8  # as difflib counts it: one letter of five
_LINE_PREFIX: Final = re.compile(r"^\[line -?\d+\]: ")
_XACRO_EXPRESSION: Final = re.compile(r"\$[{(]")
_XACRO_ADVICE: Final = "is xacro, of which URDF is made first: xacro FILE > robot.urdf."
_SHAPE_ADVICE: Final = "is no shape that can be simulated: write a box, cylinder, sphere or mesh"

_Element: TypeAlias = etree._Element
_Item = TypeVar("_Item", bound=BaseXmlModel)
_Remark: TypeAlias = tuple[str, str]


@dataclass(frozen=True, kw_only=True)
class Description:
    """Result of reading a URDF file.

    Attributes:
        robot: The body that is simulated, if there are no faults.
        faults: What is wrong with the file.
        notes: What is taken otherwise than it stands in the file.
    """

    robot: Robot
    faults: tuple[BodyError, ...]
    notes: tuple[str, ...]


def read_urdf(path: Path) -> Description:
    """Reads a URDF file.

    Raises:
        BodyError: The file cannot be read, is too large, is no XML or no URDF.
    """
    root, faults, notes = _parsed(path), list[_Remark](), list[_Remark]()

    def fault(place: str, reason: str) -> None:
        faults.append((place, reason))

    def note(place: str, what: str) -> None:
        notes.append((place, what))

    _drop_foreign(root, note, fault)
    robot, visual_faults = _checked(root, fault)
    written_counts = len(root.findall("link")), len(root.findall("joint"))
    whole = written_counts == (len(robot.links), len(robot.joints))
    normalise(robot, path, whole=whole, visual_faults=visual_faults, note=note, fault=fault)
    faults += faults_of(robot, whole=whole)
    return Description(
        robot=robot,
        faults=tuple(
            BodyError(str(path), place, reason if reason.endswith("?") else f"{reason}.")
            for place, reason in _merged(faults)
        ),
        notes=tuple(f"{place} {what}" for place, what in _merged(notes)),
    )


def _merged(remarks: Iterable[_Remark]) -> Iterable[_Remark]:
    """Merges remarks that say the same of several elements into one."""
    places: dict[str, dict[str, None]] = {}
    for place, what in remarks:
        places.setdefault(what.removesuffix("."), {})[place] = None
    for what, (first, *other_places) in places.items():
        likewise = ", ".join(_short_place(first, other) for other in other_places)
        yield first, f"{what}; likewise {likewise}" if likewise else what


def _short_place(first: str, other: str) -> str:
    """A place after another one, by its name alone where the rest is the same."""
    prefix, _, remainder = first.partition("'")
    suffix = remainder.partition("'")[2]
    is_alike = prefix and other.startswith(f"{prefix}'") and other.endswith(f"'{suffix}")
    return other[len(prefix) : len(other) - len(suffix)] if is_alike else other


# --- the XML --------------------------------------------------------------------------------------


def _parsed(path: Path) -> _Element:
    """The ``<robot>`` of a file that is within the bounds and no xacro."""
    try:
        with path.open("rb") as file:
            root = _root_element(file.read(LARGEST + 1))
    except OSError as error:
        raise BodyError(str(path), "", f"cannot be read: {error.strerror}.") from error
    except etree.XMLSyntaxError as error:
        reason = f"is not valid XML: {error.msg}."
        if "prefix xacro" in reason:  # without the line that says what xacro is
            reason = _XACRO_ADVICE
        raise BodyError(str(path), "", reason) from error
    except ValueError as error:
        raise BodyError(str(path), "", f"{error}.") from error
    place, reason = _no_description(root)
    if reason:
        raise BodyError(str(path), place, reason)
    return root


def _root_element(data: bytes) -> _Element:
    """Root element of a file's text.

    Raises:
        ValueError: There is too much, or something else, in the file.
        etree.XMLSyntaxError: The text is no XML.
    """
    if len(data) > LARGEST:
        limit = f"{LARGEST / 2**20:g} MiB"
        raise ValueError(f"has more than {limit}, as no description of {MAX_LINKS} links has")
    if data.startswith(LFS_POINTER):
        raise ValueError("is a Git LFS pointer, not the description: fetch it with git lfs pull")
    reader = etree.iterparse(
        io.BytesIO(data),
        events=("start",),
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
    )
    for count, _ in enumerate(reader, start=1):
        if count > MAX_ELEMENTS:
            raise ValueError(f"has more than {MAX_ELEMENTS} elements")
    root: _Element = reader.root
    return root


def _no_description(root: _Element) -> _Remark:
    """Where and why a document is no description, whatever its links and joints are; else empty."""
    if root.getroottree().docinfo.internalDTD is not None:
        return "<!DOCTYPE>", "is no part of URDF; leave it out, and entities."
    if root.tag != "robot":
        return f"<{root.tag!s}>", "the root element must be <robot>."
    for item in root.iter():
        if max((len(value) for value in item.attrib.values()), default=0) > _MAX_LENGTH:
            return f"<{item.tag!s}>", f"no attribute may have more than {_MAX_LENGTH} characters."
    place = _xacro_place(root)
    if place:
        return place, _XACRO_ADVICE
    for tag in _ROBOT_PARTS:
        count = len(root.findall(tag))
        if count > MAX_WRITTEN:
            return "robot", f"must have at most {MAX_LINKS} {tag}s, not {count}."
    return "", ""


def _xacro_place(root: _Element) -> str:
    """Element that is xacro and was not expanded; empty for none."""
    for element in root.iter():
        namespace, _, name = str(element.tag).rpartition("}")
        if namespace.endswith("xacro"):
            return f"<xacro:{name}>"
    for element in (root, *root.iterfind("link//*"), *root.iterfind("joint//*")):
        for key, value in element.attrib.items():
            if _XACRO_EXPRESSION.search(str(value)):
                return f'<{element.tag!s} {key!s}="{value!s}">'
    return ""


# --- words of other programs ----------------------------------------------------------------------


def _drop_foreign(root: _Element, note: Say, fault: Say) -> None:
    """Removes what is neither link nor joint, nor a known part of one.

    Args:
        root: The ``<robot>``.
        note: Told what is ignored.
        fault: Told what looks like a misspelt word of URDF.
    """
    for joint in root.iterfind("joint[@type='fixed']"):
        for element in [child for child in joint if child.tag in _MOTION_TAGS]:
            joint.remove(element)
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            if link.find("collision") is not None:
                link.remove(visual)
            for element in [child for child in visual if child.tag not in ("origin", "geometry")]:
                visual.remove(element)
            visual.attrib.clear()
    _drop(root, _ROBOT_PARTS, {"name", "version"}, note, fault)


def _drop(
    element: _Element,
    parts: dict[str, type[BaseXmlModel]],
    attributes: set[str],
    note: Say,
    fault: Say,
) -> None:
    for name in map(str, list(element.attrib)):
        if name in attributes:
            continue
        suggestion = _suggestion(name, attributes)
        place = f"attribute '{name}' of <{element.tag}>"
        if suggestion:
            fault(place, f"is unknown; did you mean '{suggestion}'?")
        else:
            note(place, "is ignored")
        del element.attrib[name]
    for child in list(element):
        tag = str(child.tag)
        if tag in parts:
            if parts[tag] is not Visual:
                _drop(child, *_declared(parts[tag]), note, fault)
        elif element.tag != "geometry":  # a shape that is not known must not vanish
            suggestion = _suggestion(tag, parts)
            if suggestion:
                fault(f"<{tag}> in <{element.tag}>", f"is unknown; did you mean <{suggestion}>?")
            elif tag not in _SKIPPED_WORDS:
                note(f"<{tag}>", "is ignored")
            element.remove(child)


def _suggestion(word: str, known: Collection[str]) -> str:
    """The known word that is almost this one, or has the same letters; empty without any."""
    anagrams = [name for name in known if sorted(name) == sorted(word)]
    return next(iter([*anagrams, *get_close_matches(word, known, 1, _SIMILARITY)]), "")


@cache
def _declared(kind: type[BaseXmlModel]) -> tuple[dict[str, type[BaseXmlModel]], set[str]]:
    """The elements and the attributes that a declaration has."""
    parts, attributes = dict[str, type[BaseXmlModel]](), set[str]()
    for name, field in kind.model_fields.items():
        models = [
            item
            for item in (field.annotation, *get_args(field.annotation))
            if isinstance(item, type) and issubclass(item, BaseXmlModel)
        ]
        if models:
            parts[models[0].__xml_tag__ or name] = models[0]
        else:
            attributes.add(name)
    return parts, attributes


# --- links and joints, one by one -----------------------------------------------------------------


def _checked(root: _Element, fault: Say) -> tuple[Robot, dict[str, list[_Remark]]]:
    """Checks links and joints, one by one, against their declarations.

    Returns:
        A robot of those that pass, and by the names of links what is wrong with their ``<visual>``,
        which matters only where it is needed.
    """
    links, joints, visual_faults = list[Link](), list[Joint](), dict[str, list[_Remark]]()
    for number, element in enumerate(root.findall("link"), start=1):
        link, faults = _item(Link, element, number)
        visual_remarks = [remark for remark in faults if ": visual" in remark[0]]
        if visual_remarks:
            visual_faults[element.get("name", "")] = visual_remarks
            for visual in element.findall("visual"):
                element.remove(visual)
            link, faults = _item(Link, element, number)
        for remark in faults:
            fault(*remark)
        links += [] if link is None else [link]
    for number, element in enumerate(root.findall("joint"), start=1):
        joint, faults = _item(Joint, element, number)
        for remark in faults:
            fault(*remark)
        joints += [] if joint is None else [joint]
    robot = Robot(
        name=root.get("name", ""), version=root.get("version"), links=links, joints=joints
    )
    return robot, visual_faults


def _item(kind: type[_Item], element: _Element, number: int) -> tuple[_Item | None, list[_Remark]]:
    """A link or joint, or what is wrong with it."""
    # The validator searches for elements by exchanging them with those that stand in their place,
    # so collisions would come out of document order.
    element[:] = sorted(element, key=lambda child: child.tag in ("collision", "visual"))
    try:
        return kind.from_xml_tree(element), []  # type: ignore[arg-type]  # two sets of types
    except ValidationError as error:
        name = element.get("name", f"number {number}")
        faults = []
        for detail in error.errors():
            location = ".".join(str(part) for part in detail["loc"] if not isinstance(part, int))
            place = ": ".join(filter(None, (f"{element.tag} '{name}'", location)))
            place = place.replace(": collisions", ": collision").replace(": visuals", ": visual")
            reason = _LINE_PREFIX.sub("", detail["msg"]).replace("Value error, ", "")
            faults.append((place, reason.replace("Extra inputs are not permitted", _SHAPE_ADVICE)))
        return None, faults
