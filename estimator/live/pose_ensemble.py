"""Bodies in the robot's last pose, as arrays that a graphics card draws in one go."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.body.arrays import Integers
from estimator.body.morphology import Array, Base, Morphology
from estimator.readings.observation import Observation
from estimator.report.bodies.jointed_body import MAIN_BODY, Kind, model_links
from estimator.report.bodies.scene import Solid, at_rest, solids_of
from estimator.report.plots.leg_styles import leg_colour

KINDS: Final[tuple[Kind, ...]] = ("box", "cylinder", "sphere")
_MAIN_BODY_COLOUR: Final = (178, 184, 190)

Colours: TypeAlias = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Instances:
    """n solids of one kind, each as a copy of a mesh of unit size.

    Attributes:
        wxyzs: Orientations as quaternions, shape (n, 4).
        positions: Of their middles, m, shape (n, 3).
        scales: Along their own axes, shape (n, 3).
        colours: Red, green and blue, 0 to 255, proportional to light, shape (n, 3).
    """

    wxyzs: Array
    positions: Array
    scales: Array
    colours: Colours


def posed(base: Base, body: Morphology | None, pose: Observation | None) -> list[Solid]:
    """A body as the robot last lay; flat on its belly where nothing was felt yet.

    Args:
        base: The main body.
        body: With its legs; ``None``: nothing is known of them.
        pose: What the robot felt. A tilt that was not read counts as level.
    """
    whole = body or Morphology(base=base, parts=(), density=1.0)
    angles = np.zeros(whole.motors) if pose is None else np.array(pose.angles)
    return at_rest(solids_of(model_links(whole), angles), pose)


def instances(bodies: Iterable[Sequence[Solid]], kind: Kind) -> Instances:
    """All solids of one kind, of some bodies."""
    solids = [solid for body in bodies for solid in body if solid.kind == kind]
    turns = np.array([solid.turn for solid in solids]).reshape(-1, 3, 3)
    return Instances(
        wxyzs=Rotation.from_matrix(turns).as_quat(scalar_first=True).reshape(-1, 4),
        positions=np.array([solid.place for solid in solids]).reshape(-1, 3),
        scales=np.array([_extents(solid) for solid in solids]).reshape(-1, 3),
        colours=_linear(np.array([list(_colour(solid)) for solid in solids]).reshape(-1, 3)),
    )


def _extents(solid: Solid) -> tuple[float, float, float]:
    """By how much a unit box, a cylinder of radius 1 and length 1, or a unit sphere is scaled."""
    if solid.kind == "box":
        x, y, z = solid.size
        return x, y, z
    if solid.kind == "cylinder":
        radius, length = solid.size
        return radius, radius, length
    (radius,) = solid.size
    return radius, radius, radius


def _colour(solid: Solid) -> Iterable[int]:
    if solid.limb == MAIN_BODY:
        return _MAIN_BODY_COLOUR
    return bytes.fromhex(leg_colour(solid.limb)[1:])


def _linear(colours: Integers) -> Colours:
    """Colours as light, which is what a scene is computed with; sRGB's own curve, nearly."""
    return np.rint(255 * (colours / 255) ** 2.2).astype(np.uint8)
