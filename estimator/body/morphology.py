"""Bodies as trees of parts, and their forward kinematics.

Conventions. The body frame has x forward, y left, z up, with its origin in the middle of the main
body. A part's frame has its origin on its joint's axis and x along the part, away from its parent;
in the planar configuration (all angles 0) z is up. Units are m, rad, kg.

A part is a capsule whose *length is the distance from its joint's axis to its outermost tip*, the
round end included: the sphere centres lie on x from 0 to ``length - radius``. A part shorter than
its radius is a single sphere at ``length - radius``, so that the tip is where the length says. Or
it is a box, a square bar from the axis to the tip, ``2 * radius`` wide and never shorter than wide.

A part sits on a mount of its parent, on the axis of a part or anywhere on the main body, and its
hinge turns it there about any axis; ``mounts`` has both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.geometry import ends, volume
from estimator.body.mounts import (
    HINGES,
    PART_SIDES,
    BaseMount,
    Hinge,
    Mount,
    PartMount,
    Vector,
    four_sides,
)
from estimator.errors import MorphologyError

Array: TypeAlias = NDArray[np.float64]

PartShape: TypeAlias = Literal["capsule", "box"]

BASE: Final = -1
"""Parent index of the parts that sit on the main body."""


@dataclass(frozen=True, kw_only=True)
class Base:
    """The main body: a box, or an upright cylinder.

    Attributes:
        size: Extent along x, y, z, m.
        mass: Mass of the main body, kg.
        mounts: Where parts can sit on it; default: the middle of each side face.
        centre: Centre of mass, from the middle of the body, m.
        accelerometer: How far the accelerometer on it is turned about the x axis and then about
            the y axis, rad: where the body stands level it reads the first as left/right tilt.
        round: Whether it is an upright cylinder, as wide as long; else it is a box.
    """

    size: Vector
    mass: float
    mounts: tuple[BaseMount, ...] = ()
    centre: Vector = (0.0, 0.0, 0.0)
    accelerometer: tuple[float, float] = (0.0, 0.0)
    round: bool = False

    def __post_init__(self) -> None:
        if len(self.size) != 3 or not all(0 < extent < math.inf for extent in self.size):
            sizes = " x ".join(f"{extent:g}" for extent in self.size)
            raise MorphologyError(
                f"the main body's size must be three lengths above 0 m, not {sizes}"
            )
        if self.round and self.size[0] != self.size[1]:
            x, y, _ = self.size
            raise MorphologyError(f"a round main body must be as wide as long, not {x:g} x {y:g}")
        if not 0 < self.mass < math.inf:
            raise MorphologyError(f"the main body's mass must be above 0, not {self.mass}")
        if not all(map(math.isfinite, (*self.centre, *self.accelerometer))):
            raise MorphologyError("the main body's centre and accelerometer must be finite")
        if not self.mounts:
            object.__setattr__(self, "mounts", four_sides(self.size))

    @property
    def inertia(self) -> Vector:
        """Moments of inertia about the centre of mass, along x, y and z, kg·m²."""
        if self.round:
            return cylinder_inertia(self.radius, self.size[2], self.mass)
        return box_inertia(self.size, self.mass)

    @property
    def radius(self) -> float:
        """Half the extent along x, m: of a round body its radius."""
        return self.size[0] / 2


@dataclass(frozen=True, kw_only=True)
class Part:
    """One rigid part, hinged to its parent.

    Attributes:
        parent: Index of an earlier part, or ``BASE``.
        mount: Where on its parent it sits: index into the mounts of the main body, or into those
            of parts.
        hinge: Index into the body's hinges: how a positive angle moves it.
        length: Length from the joint's axis to the outermost tip, m.
        radius: Radius, or half the width of a box, m.
        motor: Index of the motor that drives it, or ``None`` where its hinge is locked at 0.
        sensor: Index of the touch sensor that it carries, or ``None``.
        zero: Angle of a driven hinge where its motor stands at 0, rad.
        shape: Shape of the part.
        density: Density, kg/m³; ``None``: the ``density`` of its ``Morphology``.
    """

    parent: int
    mount: int
    hinge: int
    length: float
    radius: float
    motor: int | None = None
    sensor: int | None = None
    zero: float = 0.0
    shape: PartShape = "capsule"
    density: float | None = None

    @property
    def far(self) -> float:
        """Position of the far sphere's centre, or of the far face, on the part's x axis, m."""
        return ends(self.length, self.radius, self.shape == "box")[1]

    @property
    def near(self) -> float:
        """Position of the near sphere's centre, or of the near face, on the part's x axis, m."""
        return ends(self.length, self.radius, self.shape == "box")[0]

    @property
    def middle(self) -> float:
        """Position of the centre of mass on the part's x axis, m."""
        return (self.near + self.far) / 2

    @property
    def size(self) -> Vector:
        """Extent along x, y and z, m."""
        round_ends = 0.0 if self.shape == "box" else 2 * self.radius
        return self.far - self.near + round_ends, 2 * self.radius, 2 * self.radius

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return volume(self.far - self.near, self.radius, self.shape == "box")

    def below(self, up: Sequence[float] | Array) -> float:
        """How far the part's surface reaches below its x axis, m.

        Args:
            up: World up in the part's frame.
        """
        if self.shape == "box":
            return self.radius * float(abs(up[1]) + abs(up[2]))
        return self.radius


@dataclass(frozen=True, kw_only=True)
class Morphology:
    """A body: the main body and a tree of parts, parents before children.

    Attributes:
        base: The main body.
        parts: The parts; the order is the order of a genome's rows.
        density: Density of parts that have none of their own, kg/m³.
        part_mounts: Where parts can sit on other parts; default: the paper's four sides.
        hinges: How parts can turn; default: the paper's six.
    """

    base: Base
    parts: tuple[Part, ...]
    density: float
    part_mounts: tuple[PartMount, ...] = PART_SIDES
    hinges: tuple[Hinge, ...] = HINGES

    def __post_init__(self) -> None:
        if not 0 < self.density < math.inf:
            raise MorphologyError(f"density must be above 0, not {self.density}")
        for index, part in enumerate(self.parts):
            self._check(index, part)
        for name in ("motor", "sensor"):
            used = [getattr(part, name) for part in self.parts if getattr(part, name) is not None]
            if len(set(used)) != len(used):
                raise MorphologyError(f"each {name} belongs to one part, not several: {used}")

    def _check(self, index: int, part: Part) -> None:
        def refuse(what: str) -> MorphologyError:
            return MorphologyError(f"part {index + 1}: {what}")

        if not BASE <= part.parent < index:
            raise refuse(
                f"its parent must be the main body or an earlier part, not {part.parent + 1}"
            )
        mounts = len(self.base.mounts if part.parent == BASE else self.part_mounts)
        if not 0 <= part.mount < mounts:
            raise refuse(f"mount must be 0 to {mounts - 1}, not {part.mount}")
        if not 0 <= part.hinge < len(self.hinges):
            raise refuse(f"hinge must be 0 to {len(self.hinges) - 1}, not {part.hinge}")
        if not 0 <= part.length < math.inf:
            raise refuse(f"length must be at least 0, not {part.length}")
        if not 0 < part.radius < math.inf:
            raise refuse(f"radius must be above 0, not {part.radius}")
        if not math.isfinite(part.zero):
            raise refuse(f"zero must be finite, not {part.zero}")
        for name in ("motor", "sensor"):
            number = getattr(part, name)
            if number is not None and number < 0:
                raise refuse(f"{name} must be at least 0 or None, not {number}")

    def with_lengths(self, lengths: Sequence[float]) -> Morphology:
        """The body with other lengths of its parts, m."""
        pairs = zip(self.parts, lengths, strict=True)
        return replace(self, parts=tuple(replace(part, length=length) for part, length in pairs))

    def mount(self, index: int) -> BaseMount | PartMount:
        """Mount that a part sits on."""
        part = self.parts[index]
        return (self.base.mounts if part.parent == BASE else self.part_mounts)[part.mount]

    def hinge(self, index: int) -> Hinge:
        """Hinge that turns a part."""
        return self.hinges[self.parts[index].hinge]

    def place(self, index: int) -> Vector:
        """Where a part sits, in the frame of its parent, m."""
        mount = self.mount(index)
        if isinstance(mount, BaseMount):
            return mount.at
        return (mount.fraction * self.parts[self.parts[index].parent].length, 0.0, 0.0)

    def turn(self, index: int, angle: float) -> Array:
        """Rotation of a part in its parent's frame at an angle of its hinge (rad), shape (3, 3).

        Read-only where the angle is 0.
        """
        straight = direction(self.mount(index))
        return straight @ rotation(self.hinge(index).axis, angle) if angle else straight

    @cached_property
    def masses(self) -> Array:
        """Mass of each part, kg, shape (parts,)."""
        densities = (self.density if part.density is None else part.density for part in self.parts)
        volumes = (part.volume for part in self.parts)
        return np.array([v * d for v, d in zip(volumes, densities, strict=True)], dtype=float)

    @cached_property
    def mass(self) -> float:
        """Mass of the whole body, kg."""
        return self.base.mass + float(self.masses.sum())

    @cached_property
    def reach(self) -> float:
        """Farthest that any pose can put the end of a part from the middle of the body, m.

        Without parts it is half the main body's longest edge.
        """
        reach = 0.5 * max(self.base.size)
        roots: list[float] = []
        for index, part in enumerate(self.parts):
            root = math.hypot(*self.place(index))
            roots.append(root if part.parent == BASE else roots[part.parent] + root)
            reach = max(reach, roots[-1] + part.length)
        return reach

    @cached_property
    def planar_height(self) -> float:
        """Height of the body frame in the planar pose, with the lowest point on the ground, m."""
        origins, turns = _planar_frames(self)
        lowest = self.base.size[2] / 2
        for part, origin, turn in zip(self.parts, origins, turns, strict=True):
            below = part.below(turn[2])
            for along in (part.near, part.far):
                lowest = max(lowest, below - float(origin[2] + along * turn[2, 0]))
        return lowest

    @property
    def lies_flat(self) -> bool:
        """Whether the main body lies on the ground in the planar pose."""
        return self.planar_height < self.base.size[2] / 2 + 1e-9

    @cached_property
    def motors(self) -> int:
        """Smallest number of angles in a motor program for this body."""
        return max((part.motor + 1 for part in self.parts if part.motor is not None), default=0)

    @cached_property
    def sensors(self) -> int:
        """How many touch sensors the body has."""
        return max((part.sensor + 1 for part in self.parts if part.sensor is not None), default=0)

    @cached_property
    def rigid_groups(self) -> tuple[int, ...]:
        """For each part, the first part of the rigid group that it belongs to.

        Parts joined by locked hinges form one group. The main body joins nothing: a gauge in a
        leg does not measure what the main body stands on.
        """
        groups: list[int] = []
        for index, part in enumerate(self.parts):
            joined = part.motor is None and part.parent != BASE
            groups.append(groups[part.parent] if joined else index)
        return tuple(groups)

    def sensor_parts(self, sensor: int) -> tuple[int, ...]:
        """Indices of the parts whose contact with the ground a touch sensor measures."""
        for index, part in enumerate(self.parts):
            if part.sensor == sensor:
                group = self.rigid_groups[index]
                return tuple(i for i, root in enumerate(self.rigid_groups) if root == group)
        return ()

    def part_angles(self, program: Sequence[float] | Array) -> list[float]:
        """Angle of each part's hinge when the motors stand at ``program`` (rad, per motor).

        Raises:
            MorphologyError: The program has fewer angles than the body has motors.
        """
        if len(program) < self.motors:
            raise MorphologyError(
                f"the motor program has {len(program)} angles, but the body has "
                f"{self.motors} motors: give one angle per motor"
            )
        return [
            0.0 if part.motor is None else float(program[part.motor]) + part.zero
            for part in self.parts
        ]


def _planar_frames(morphology: Morphology) -> tuple[Array, Array]:
    """Origins, m, and rotations of the parts' frames in the body frame, in the planar pose."""
    origins, rotations = (
        np.empty((len(morphology.parts), 3)),
        np.empty((len(morphology.parts), 3, 3)),
    )
    for index, part in enumerate(morphology.parts):
        on_base = part.parent == BASE
        turn = np.eye(3) if on_base else rotations[part.parent]
        start = np.zeros(3) if on_base else origins[part.parent]
        origins[index] = start + turn @ np.array(morphology.place(index))
        rotations[index] = turn @ morphology.turn(index, 0.0)
    return origins, rotations


def box_inertia(size: Vector, mass: float) -> Vector:
    """Moments of inertia of a box about its middle, along x, y and z, kg·m²."""
    (x, y, z), share = size, mass / 12
    return share * (y * y + z * z), share * (x * x + z * z), share * (x * x + y * y)


def cylinder_inertia(radius: float, length: float, mass: float) -> Vector:
    """Moments of inertia of a cylinder along z about its middle, along x, y and z, kg·m²."""
    across = mass * (3 * radius**2 + length**2) / 12
    return across, across, mass * radius**2 / 2


@lru_cache(maxsize=1024)
def direction(mount: Mount) -> Array:
    """Rotation of a part on a mount in its carrier's frame, its hinge at 0; read-only, (3, 3)."""
    turn: Array = rotation((0.0, 0.0, 1.0), mount.yaw)
    turn = turn @ rotation((0.0, -1.0, 0.0), mount.elevation)
    turn.flags.writeable = False  # all callers share it
    return turn


def rotation(axis: Vector, angle: float) -> Array:
    """Matrix of the rotation about a unit vector (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: Array = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return matrix
