"""What other programs write into URDF files: ignored and said aloud, unless it looks misspelt.

``<mujoco>``, ``<ros2_control>``, ``dont_collapse``: every simulator reads its own words and skips
those of others, as the reference parser (urdfdom) does. A word that is almost one of URDF's is
refused: a body without its ``<colision>`` would be another body.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from difflib import get_close_matches
from functools import cache
from typing import Final, get_args

from pydantic_xml import BaseXmlModel

from sim_robot.world.urdf.declarations import Geometry, Joint, Link
from sim_robot.world.urdf.elements import Element, Say

_SILENTLY: Final = ("visual", "material", "gazebo", "transmission")
_ROBOT: Final[dict[str, type[BaseXmlModel]]] = {"link": Link, "joint": Joint}
_ALIKE: Final = 0.8  # as difflib counts it: one letter of five


def drop_foreign(root: Element, *, note: Say, fault: Say) -> None:
    """Removes what is neither link nor joint, nor a known part of one.

    Args:
        root: The ``<robot>``.
        note: Told what is ignored, once for each name.
        fault: Told what looks like a misspelt word of URDF.
    """
    said: set[str] = set()

    def ignore(place: str) -> None:
        if place not in said:
            note(place, "is ignored")
        said.add(place)

    _drop(root, _ROBOT, {"name", "version"}, ignore, fault)


def _drop(
    element: Element,
    parts: dict[str, type[BaseXmlModel]],
    attributes: set[str],
    ignore: Callable[[str], None],
    fault: Say,
) -> None:
    for name in map(str, list(element.attrib)):
        if name in attributes:
            continue
        meant = _meant(name, attributes)
        place = f"attribute '{name}' of <{element.tag}>"
        if meant:
            fault(place, f"is unknown; did you mean '{meant}'?")
        else:
            ignore(place)
        del element.attrib[name]
    for child in list(element):
        tag = str(child.tag)
        if tag in parts:
            kind = parts[tag]
            if kind is not Geometry:  # a shape that is not known must not vanish
                _drop(child, *_known(kind), ignore, fault)
            continue
        meant = _meant(tag, parts)
        if meant:
            fault(f"<{tag}> in <{element.tag}>", f"is unknown; did you mean <{meant}>?")
        elif tag not in _SILENTLY:
            ignore(f"<{tag}>")
        element.remove(child)


def _meant(word: str, known: Collection[str]) -> str:
    """The known word that is almost this one, or has the same letters; empty without any."""
    same = [name for name in known if sorted(name) == sorted(word)]
    return next(iter([*same, *get_close_matches(word, known, 1, _ALIKE)]), "")


@cache
def _known(kind: type[BaseXmlModel]) -> tuple[dict[str, type[BaseXmlModel]], set[str]]:
    """The elements and the attributes that a declaration has."""
    parts, attributes = dict[str, type[BaseXmlModel]](), set[str]()
    for name, field in kind.model_fields.items():
        inner = [
            item
            for item in (field.annotation, *get_args(field.annotation))
            if isinstance(item, type) and issubclass(item, BaseXmlModel)
        ]
        if inner:
            parts[inner[0].__xml_tag__ or name] = inner[0]
        else:
            attributes.add(name)
    return parts, attributes
