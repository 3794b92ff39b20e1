"""Whether a link can have the inertia that its file says, and what it is given otherwise.

All of a body's mass lies within its extent, so no principal moment exceeds its mass times the
square of that; and none exceeds the sum of the other two. Placeholders (1, 100 or 1000 kg·m² for a
leg of 50 g) and other units (g·mm²) break the first rule by orders of magnitude; a robot simulated
with them takes minutes to tip over. What breaks a rule is replaced by the inertia of a box of
uniform density as large as the link; so is none at all.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_robot.world.urdf.declarations import Inertia, Link, Origin, Points, Robot, Say, vector

_ROUNDING: Final = 0.01  # of the largest moment; files have few digits
_LEAST: Final = 0.01  # m, side of a link without shapes


def mend_inertia(robot: Robot, note: Say) -> None:
    """Replaces the inertia that no link of its mass and size has.

    Negative moments stay: they are for the checks to refuse.

    Args:
        robot: Links that have masses, and boxes, cylinders or spheres.
        note: Told what is replaced, and why.
    """
    hanging: dict[str, list[Points]] = defaultdict(list)
    for joint in robot.joints:
        hanging[joint.parent.link].append(np.array(vector(joint.origin.xyz)))
    extents = {link.name: _extent(link, hanging[link.name]) for link in robot.links}
    longest = max(map(_diagonal, extents.values()), default=0.0)
    said = dict[str, str]()  # of each kind what the first has
    for link in robot.links:
        inertial, mass = link.inertial, link.mass
        if inertial is None or not mass:
            continue
        reach = _diagonal(extents[link.name]) if link.collisions else longest
        reason = _impossible(inertial.inertia, mass, reach)
        if reason:
            sentence = said.setdefault(*reason)
            note(f"link '{link.name}'", f"{sentence}; it is given that of a box of its size")
            inertial.inertia = _of_box(mass, extents[link.name])
            inertial.origin = Origin(xyz=inertial.origin.xyz)  # along the axes of its link


def _impossible(inertia: Inertia | None, mass: float, reach: float) -> tuple[str, str] | None:
    """Which rule an inertia breaks, and a sentence; ``None`` for one that a body can have."""
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
    x, y, z = (np.maximum(sides, _LEAST) ** 2).tolist()
    return Inertia(
        ixx=mass * (y + z) / 12,
        iyy=mass * (x + z) / 12,
        izz=mass * (x + y) / 12,
    )
