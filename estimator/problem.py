"""Problems: what is known about a robot, and what is to be found, from a TOML file.

``problems/parametric.toml`` documents the format. Joints, parts and sensors are counted from 1 in
the file and from 0 in code.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    model_validator,
)

from estimator.errors import ProblemError
from estimator.morphology import Array, Base
from estimator.physics.base import Settings
from estimator.problem_values import (
    Count,
    Hinge,
    Length,
    Name,
    Number,
    Parent,
    Positive,
    Range,
    Side,
    complaint,
)
from estimator.search.operators import (
    BlendCrossover,
    Crossover,
    GaussianMutation,
    Mutation,
    Operators,
)
from protocol.capabilities import Capabilities


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PartRule(_Strict):
    """What is known about one part; ``None`` stands for what is to be found.

    Attributes:
        name: For people.
        parent: Index of an earlier part, or ``morphology.BASE``.
        side: Index into ``morphology.SIDES``.
        hinge: Index into ``morphology.HINGES``.
        length: Shortest and longest, m; equal where the length is known.
        radius: m.
        motor: The joint that moves it, or ``None`` where its hinge is locked.
        sensor: The touch sensor that it carries, or ``None``.
    """

    name: Name
    parent: Parent
    side: Side
    hinge: Hinge
    length: Length
    radius: Positive
    motor: Number | None = None
    sensor: Number | None = None

    @property
    def length_unknown(self) -> bool:
        """Whether the length is to be found."""
        return self.length[0] < self.length[1]


class Motors(_Strict):
    """Which joints a motor program moves, and how.

    Attributes:
        driven: Joints that are moved; the others stay at 0.
        range_deg: Where random targets are drawn from, degrees.
        slew_deg_per_s: Speed of the joints, degrees per second.
    """

    driven: Annotated[tuple[Number, ...], Field(min_length=1)]
    range_deg: Range
    slew_deg_per_s: Positive


class SearchSettings(_Strict):
    """How the models are optimised."""

    population: Count
    generations: Count
    interactions: Count
    crossover: Annotated[Crossover, Field(discriminator="kind")] = BlendCrossover()
    mutation: Annotated[Mutation, Field(discriminator="kind")] = GaussianMutation()

    @model_validator(mode="after")
    def _mates(self) -> Self:
        if self.population % 2:
            raise ValueError(
                f"population must be even, not {self.population}: members mate in pairs"
            )
        return self

    def operators(self) -> Operators:
        """The search's operators."""
        return Operators(crossover=self.crossover, mutation=self.mutation)


class Problem(_Strict):
    """What is known about a robot, and what is to be found.

    Attributes:
        name: Short name.
        description: One sentence for people.
        density: Of all parts, kg/m³.
        motors: Which joints move, and how.
        search: How the models are optimised.
        parts: Parents before children; the order is that of the genome's rows.
    """

    name: Name
    description: str
    density: Positive
    motors: Motors
    search: SearchSettings
    parts: Annotated[tuple[PartRule, ...], Field(min_length=1)]
    _source: str = PrivateAttr(default="")

    @classmethod
    def load(cls, name_or_path: str) -> Problem:
        """Reads a problem that ships with the estimator, by name, or a file ending in ``.toml``.

        Raises:
            ProblemError: There is no such problem, or it is wrong: file, key and reason.
        """
        if not name_or_path.endswith(".toml"):
            folder = resources.files("estimator") / "problems"
            shipped = sorted(item.name.removesuffix(".toml") for item in folder.iterdir())
            if name_or_path not in shipped:
                raise ProblemError(
                    f"there is no problem named {name_or_path!r}: give one of "
                    f"{', '.join(shipped)}, or the path of a .toml file"
                )
            return cls.parse((folder / f"{name_or_path}.toml").read_text("utf-8"), name_or_path)
        try:
            return cls.parse(Path(name_or_path).read_text("utf-8"), name_or_path)
        except OSError as error:
            raise ProblemError(f"{name_or_path} cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ProblemError(f"{name_or_path} is no UTF-8 text: {error.reason}") from error

    @classmethod
    def parse(cls, text: str, origin: str) -> Problem:
        """Reads a problem from TOML text; ``origin`` names it in errors.

        Raises:
            ProblemError: The text is wrong: file, key and reason.
        """
        try:
            problem = cls.model_validate(tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise ProblemError(f"{origin} is no valid TOML: {error}") from error
        except ValidationError as error:
            raise ProblemError(complaint(error, origin)) from error
        problem._source = text
        return problem

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for index, part in enumerate(self.parts):
            if part.parent is not None and part.parent >= index:
                raise ValueError(
                    f"parts[{index + 1}] ({part.name}): its parent {part.parent + 1} is no earlier "
                    "part: list parents before their children"
                )
        names = [part.name for part in self.parts]
        if len(set(names)) != len(names):
            raise ValueError("parts: every part needs a name of its own")
        moved = sorted(part.motor + 1 for part in self.parts if part.motor is not None)
        driven = sorted(motor + 1 for motor in self.motors.driven)
        if moved != driven or len(set(driven)) != len(driven):
            raise ValueError(
                f"motors.driven: each driven joint must move exactly one part, but {driven} are "
                f"driven and parts name the motors {moved}"
            )
        sensors = sorted(part.sensor + 1 for part in self.parts if part.sensor is not None)
        if sensors != list(range(1, len(sensors) + 1)):
            raise ValueError(f"parts: sensors must be numbered 1, 2, … once each, not {sensors}")
        if not any(
            part.length_unknown or None in (part.parent, part.side, part.hinge)
            for part in self.parts
        ):
            raise ValueError("parts: there is nothing to be found: give some length a range")
        return self

    @property
    def source(self) -> str:
        """The TOML text that the problem was read from, to be kept with a run."""
        return self._source

    @property
    def sensors(self) -> int:
        """How many touch sensors the parts carry."""
        return sum(part.sensor is not None for part in self.parts)

    def base(self, capabilities: Capabilities) -> Base:
        """The main body, which the robot makes public."""
        x, y, z = capabilities.base_size
        return Base(size=(x, y, z), mass=capabilities.base_mass)

    def settings(self, capabilities: Capabilities) -> Settings:
        """The world in which models of this robot are simulated."""
        slew = math.radians(self.motors.slew_deg_per_s)
        sensor = capabilities.sensor("clearance")
        if sensor is None or sensor.upper is None:
            return Settings(slew=slew)
        return Settings(slew=slew, clearance_cap=sensor.upper)

    def program_range(self, capabilities: Capabilities) -> Array:
        """Lowest and highest target of each joint, rad, shape (joints, 2); 0 where not driven.

        Raises:
            ProblemError: A joint that must be driven is missing or cannot reach the range.
        """
        joints = capabilities.joints
        found = np.zeros((len(joints), 2))
        for motor in self.motors.driven:
            if motor >= len(joints):
                raise ProblemError(
                    f"problem {self.name!r} drives joint {motor + 1}, but robot "
                    f"{capabilities.robot!r} has only {len(joints)} joints: choose another problem"
                )
            joint = joints[motor]
            low, high = (math.radians(end) for end in self.motors.range_deg)
            low, high = max(low, joint.lower), min(high, joint.upper)
            if low > high:
                raise ProblemError(
                    f"problem {self.name!r}: motors.range_deg lies outside the limits of joint "
                    f"{joint.name!r}, {math.degrees(joint.lower):.1f} to "
                    f"{math.degrees(joint.upper):.1f} degrees"
                )
            found[motor] = low, high
        return found

    def random_program(self, rng: np.random.Generator, capabilities: Capabilities) -> Array:
        """A motor program drawn at random: one target per joint, rad; 0 where not driven.

        Raises:
            ProblemError: The robot cannot perform this problem's programs.
        """
        ends = self.program_range(capabilities)
        driven = list(self.motors.driven)
        program = np.zeros(len(ends))
        program[driven] = rng.uniform(ends[driven, 0], ends[driven, 1])
        return program

    def check_robot(self, capabilities: Capabilities, modalities: Sequence[str]) -> tuple[str, ...]:
        """Compares the problem with what the robot says about itself.

        Returns:
            Sentences that a person should see: what differs, but does not prevent a run.

        Raises:
            ProblemError: This robot cannot serve this problem.
        """
        self.program_range(capabilities)
        for modality in modalities:
            sensor = capabilities.sensor(modality)
            if sensor is None:
                raise ProblemError(
                    f"robot {capabilities.robot!r} has no {modality} sensor: leave {modality} out "
                    "of the modalities"
                )
            if modality == "touch" and sensor.count != self.sensors:
                raise ProblemError(
                    f"robot {capabilities.robot!r} has {sensor.count} touch sensors, but problem "
                    f"{self.name!r} describes {self.sensors}: correct its parts, or leave touch out"
                )
        return (*self._differing_speeds(capabilities), *self._differing_radii(capabilities))

    def _differing_speeds(self, capabilities: Capabilities) -> list[str]:
        slew = self.motors.slew_deg_per_s
        speeds = {
            capabilities.joints[motor].name: math.degrees(capabilities.joints[motor].speed)
            for motor in self.motors.driven
        }
        return [
            f"joint {name} moves at {speed:.1f} degrees per second, the models at {slew:g}"
            for name, speed in speeds.items()
            if abs(speed - slew) > 0.01 * slew
        ]

    def _differing_radii(self, capabilities: Capabilities) -> list[str]:
        radii = capabilities.part_radii
        if len(radii) != len(self.parts):
            return []  # parts are not one to a joint, so there is nothing to compare
        return [
            f"part {part.name} has a radius of {radius * 1e3:.1f} mm according to the robot, of "
            f"{part.radius * 1e3:.1f} mm according to the problem: lengths will be biased"
            for part, radius in zip(self.parts, radii, strict=True)
            if abs(part.radius - radius) > 0.1 * radius
        ]
