"""The sections of a problem file, as declarations."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from estimator.body.morphology import PartShape
from estimator.parameters.rows import PartOutline
from estimator.physics.base import WorldSettings
from estimator.problem.operators import (
    BlendCrossover,
    Crossover,
    GaussianMutation,
    Mutation,
    Operators,
)
from estimator.problem.values import (
    Angles,
    Axis,
    Count,
    Elevation,
    Length,
    Name,
    NameOrUnknown,
    Number,
    Parent,
    Place,
    Population,
    Positive,
    Radius,
    Spread,
    Yaw,
)


class Strict(BaseModel):
    """Refuses unknown keys: a misspelt one would silently leave its default in force."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class MountRule(Strict):
    """A place where parts can sit: on the main body if ``at`` is a point, or on any part.

    Attributes:
        name: Name, unique among the mounts on the main body, or on parts.
        at: A point, m, or a fraction of the carrier's length.
        yaw_deg: Angle from the carrier's direction to that of the part that sits there.
        elevation_deg: Angle of that direction over the carrier's plane; −90 hangs down.
    """

    name: Name
    at: Place
    yaw_deg: Yaw
    elevation_deg: Elevation = 0.0


class HingeRule(Strict):
    """A way in which parts can turn.

    Attributes:
        name: Name, unique among the hinges.
        axis: Unit vector in the frame of the part that it turns.
    """

    name: Name
    axis: Axis


class PartRule(Strict):
    """What is known about one part; ``None`` stands for what is to be found.

    Attributes:
        name: Name for people.
        parent: Index of an earlier part, or ``morphology.BASE``.
        mount: Name of the mount that it sits on; empty where ``at`` is given.
        at: A place of its own instead of ``mount``; see ``MountRule``.
        yaw_deg: Yaw of the part at ``at``; see ``MountRule``.
        elevation_deg: Elevation of the part at ``at``; see ``MountRule``.
        hinge: Name of its hinge; empty where ``axis`` is given.
        axis: An axis of its own instead of ``hinge``; see ``HingeRule``.
        length: Shortest and longest length, m; equal where the length is known.
        shape: Shape of the part.
        radius: Radius, or half the width of a box, m.
        motor: Index of the joint that moves it, or ``None`` where its hinge is locked.
        locked: Index of the joint that carries it and stays at 0, where it is known: only then can
            a score say whether the part is attached as it is on the robot.
        sensor: Index of the touch sensor that it carries, or ``None``.
    """

    name: Name
    parent: Parent
    mount: NameOrUnknown = ""
    at: Place | None = None
    yaw_deg: Yaw | None = None
    elevation_deg: Elevation = 0.0
    hinge: NameOrUnknown = ""
    axis: Axis | None = None
    length: Length
    shape: PartShape = "capsule"
    radius: Radius
    motor: Number | None = None
    locked: Number | None = None
    sensor: Number | None = None

    @property
    def outline(self) -> PartOutline:
        """What the table of parameters must know of it."""
        return PartOutline(**{one.name: getattr(self, one.name) for one in fields(PartOutline)})

    @property
    def length_unknown(self) -> bool:
        """Whether the length is to be found."""
        return self.length[0] < self.length[1]

    @property
    def joint(self) -> int | None:
        """Index of the joint that carries the part, moved or not."""
        return self.locked if self.motor is None else self.motor

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if (self.at is None) == (self.mount == "") or (self.at is None) != (self.yaw_deg is None):
            raise ValueError(
                'give either mount, which may be "unknown", or a place of its own by at and yaw_deg'
            )
        if self.at is None and self.elevation_deg:
            raise ValueError("elevation_deg belongs to at and yaw_deg; a mount has its own")
        if (self.axis is None) == (self.hinge == ""):
            raise ValueError('give either hinge, which may be "unknown", or an axis of its own')
        if self.motor is not None and self.locked is not None:
            raise ValueError("a joint is either driven (motor) or stays at 0 (locked), not both")
        if self.radius >= self.length[1]:
            raise ValueError(
                f"radius {self.radius:g} m must lie below the length, at most {self.length[1]:g} m"
            )
        return self


class Motors(Strict):
    """Which joints a motor program moves, and how.

    Attributes:
        driven: Joints that are moved; the others stay at 0.
        range_deg: Range that random targets are drawn from, degrees.
        slew_deg_per_s: Speed of the joints, degrees per second.
    """

    driven: Annotated[tuple[Number, ...], Field(min_length=1)]
    range_deg: Angles
    slew_deg_per_s: Positive


class UncertainSection(BaseModel):
    """How well a robot is known to be as its problem says: standard deviations by group.

    The groups are those of the rows of ``parameters``, in the units of the rows' sentences; factors
    have those of their logarithms; 0: just as stated. A group that is not named is as on robots
    that people build.

    Attributes:
        exact: Whether the whole robot is just as stated.
    """

    model_config = ConfigDict(frozen=True, extra="allow")
    __pydantic_extra__: dict[str, Spread] = Field(init=False)

    exact: Annotated[bool, Field(strict=True)] = False

    @property
    def spreads(self) -> dict[str, float]:
        """Standard deviations by group."""
        return self.__pydantic_extra__


class WorldSection(Strict):
    """How models are simulated, where the paper is silent or only implies it.

    Attributes:
        steps: Number of steps of one simulation (the paper's 300).
        step_s: Time step, s: the paper's 300 steps spread over its 5-second interactions.
        friction: Coefficient of friction between body and ground.
    """

    steps: Count = WorldSettings.steps
    step_s: Positive = WorldSettings.step
    friction: Positive = WorldSettings.friction


class SearchSettings(Strict):
    """How often the robot acts, and how the paper's method optimises its models."""

    interactions: Count
    population: Population = 100
    generations: Count = 10
    crossover: Annotated[Crossover, Field(discriminator="kind")] = BlendCrossover()
    mutation: Annotated[Mutation, Field(discriminator="kind")] = GaussianMutation()

    def operators(self) -> Operators:
        """The search's operators."""
        return Operators(crossover=self.crossover, mutation=self.mutation)
