"""Whether a link can have the inertia that its file says, and what it is given otherwise.

All of a body's mass lies within its extent, so no principal moment exceeds its mass times the
extent squared; and none exceeds the sum of the other two. Placeholders (1, 100 or 1000 kg·m² for a
leg of 50 g) and other units (g·mm²) break the first rule by orders of magnitude; a robot simulated
with them takes minutes to tip over. An inertia that breaks a rule, or is missing, is replaced by
that of a box of uniform density as large as the link.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_robot.world.urdf.declarations import Inertia, Link, Origin, Points, Robot, Say, vector

_ROUNDING: Final = 0.01  # share of the largest moment; files have few digits
_LEAST_SIDE: Final = 0.01  # m, side of a link without shapes


def mend_inertia(robot: Robot, note: Say) -> None:
    """Replaces inertias that no link of such mass and size can have.

    Negative moments stay: they are for the checks to refuse.

    Args:
        robot: Links that have masses, and boxes, cylinders or spheres.
        note: Told what is replaced, and why.
    """
    joint_places: dict[str, list[Points]] = defaultdict(list)
    for joint in robot.joints:
        joint_places[joint.parent.link].append(np.array(vector(joint.origin.xyz)))
    extents = {link.name: _extent(link, joint_places[link.name]) for link in robot.links}
    longest = max(map(_diagonal, extents.values()), default=0.0)
    sentences = dict[str, str]()  # sentence about the first link, by broken rule
    for link in robot.links:
        inertial, mass = link.inertial, link.mass
        if inertial is None or not mass:
            continue
        reach = _diagonal(extents[link.name]) if link.collisions else longest
        broken_rule = _impossible(inertial.inertia, mass, reach)
        if broken_rule:
            sentence = sentences.setdefault(*broken_rule)
            note(f"link '{link.name}'", f"{sentence}; it is given that of a box of its size")
            inertial.inertia = _of_box(mass, extents[link.name])
            inertial.origin = Origin(xyz=inertial.origin.xyz)  # along the axes of its link


def _impossible(inertia: Inertia | None, mass: float, reach: float) -> tuple[str, str] | None:
    """Rule that an inertia breaks, with a sentence; ``None`` for none, or a negative moment."""
    if inertia is None:
        return "missing", "has a mass and no inertia"
    least, middle, largest = np.linalg.eigvalsh(inertia.matrix).tolist()
    if least < -1e-6 * largest:
        return None
    if largest <= 0:
        return "missing", "has a mass and no inertia"
    bound = mass * reach**2
    if reach and largest > bound:
        return "large", (
            f"has an inertia of {largest:.3g} kg·m², and {mass:.3g} kg within "
            f"{1000 * reach:.0f} mm cannot have more than {bound:.2g}"
        )
    if largest > least + middle + _ROUNDING * largest:
        return "triangle", (
            f"has principal moments of inertia of {least:.3g}, {middle:.3g} and {largest:.3g} "
            "kg·m², and no body's largest exceeds the sum of the others"
        )
    return None


def _extent(link: Link, joints: Sequence[Points]) -> Points:
    """Sides of the box around a link's shapes, its joints and its centre of mass, m."""
    places = [np.zeros(3), *joints]
    if link.inertial is not None:
        places.append(np.array(vector(link.inertial.origin.xyz)))
    for collision in link.collisions:
        places += collision.bounds(np.eye(4))
    sides: Points = np.ptp(places, axis=0)
    return sides


def _diagonal(sides: Points) -> float:
    return float(np.linalg.norm(sides))


def _of_box(mass: float, sides: Points) -> Inertia:
    """The inertia of a box of uniform density."""
    x, y, z = (np.maximum(sides, _LEAST_SIDE) ** 2).tolist()
    return Inertia(
        ixx=mass * (y + z) / 12,
        iyy=mass * (x + z) / 12,
        izz=mass * (x + y) / 12,
    )
