"""Problems: what is known about a robot, and what is to be found, from a TOML file.

``docs/problems.md`` documents the format. Joints, parts and sensors are counted from 1 in the file
and from 0 in code. A file may leave open how many joints the robot has; until a problem is told of
a robot (``for_robot``) it is written out for the paper's, or for one that it suits.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from estimator.body.morphology import Array, Base
from estimator.errors import ProblemError
from estimator.parameters.announced import announced, tightened, widened
from estimator.parameters.rows import PartOutline, table_of
from estimator.parameters.table import Parameter
from estimator.physics.base import WorldSettings
from estimator.problem.attachment_tables import AttachmentTables
from estimator.problem.genes import genes_of
from estimator.problem.sections import (
    HingeRule,
    Motors,
    MountRule,
    PartRule,
    SearchSettings,
    Strict,
    UncertainSection,
    WorldSection,
)
from estimator.problem.template import PAPERS_ROBOT, Inventory, supposed_robots, write_out
from estimator.problem.values import Density, Name, complaint
from estimator.readings.modalities import MODALITIES
from protocol.text import TomlError, parse_toml
from protocol.wire.capabilities import Capabilities

_UNCERTAIN_TILT: Final = 1.0  # degrees of own tilt that are worth an interaction without motion
_BY_CHANCE: Final = 4.0  # standard deviations; one tilt of 16,000 is larger


class Problem(Strict):
    """What is known about a robot, and what is to be found.

    Attributes:
        name: Short name.
        description: One sentence for people.
        density: Density of all parts, kg/m³.
        motors: Which joints move, and how.
        uncertain: How well the robot is known to be as the problem says.
        search: How the models are optimised.
        world: How models are simulated.
        touch: ``outermost``: the robot's touch sensors sit on the parts that carry no other, in
            the parts' order; where there are more sensors than such parts, the first other parts
            have the rest. So each part has one if there are as many. ``None``: they sit on the
            parts that say so by ``sensor``.
        mounts: Where parts can sit; without any on the main body, or on parts: the paper's four
            sides there.
        hinges: How parts can turn; without any: the paper's six ways.
        share_mounts: Whether several parts may sit on one mount.
        parts: The parts, parents before children; the order is that of the genome's rows.
    """

    name: Name
    description: str = ""
    density: Density
    motors: Motors
    uncertain: UncertainSection = UncertainSection()
    search: SearchSettings
    world: WorldSection = WorldSection()
    touch: Literal["outermost"] | None = None
    mounts: tuple[MountRule, ...] = ()
    hinges: tuple[HingeRule, ...] = ()
    share_mounts: Annotated[bool, Field(strict=True)] = True
    parts: Annotated[tuple[PartRule, ...], Field(min_length=1)]
    _source: str = PrivateAttr(default="")
    _origin: str = PrivateAttr(default="")
    _robot: Inventory = PrivateAttr(default=PAPERS_ROBOT)

    @classmethod
    def load(cls, name_or_path: str) -> Problem:
        """Reads a problem that ships with the estimator, by name, or a file ending in ``.toml``.

        Raises:
            ProblemError: There is no such problem, or it is wrong: file, key and reason.
        """
        if not name_or_path.endswith(".toml"):
            folder = resources.files("estimator") / "problem" / "library"
            shipped = sorted(file.name.removesuffix(".toml") for file in folder.iterdir())
            if name_or_path not in shipped:
                raise ProblemError(
                    f"there is no problem named {name_or_path!r}: give one of "
                    f"{', '.join(shipped)}, or the path of a .toml file"
                )
            return cls.parse((folder / f"{name_or_path}.toml").read_text("utf-8"), name_or_path)
        try:
            return cls.parse(Path(name_or_path).read_text("utf-8-sig"), name_or_path)
        except OSError as error:
            raise ProblemError(f"{name_or_path} cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ProblemError(f"{name_or_path} is no UTF-8 text: {error.reason}") from error

    @classmethod
    def parse(cls, text: str, origin: str, robot: Inventory | None = None) -> Problem:
        """Reads a problem from TOML text.

        Args:
            text: The file's content.
            origin: Name of the text in errors.
            robot: Robot that the problem is written out for; default: the first that it suits, the
                paper's before others.

        Raises:
            ProblemError: The text is wrong, or suits no robot: file, key and reason, as for the
                first robot.
        """
        try:
            raw = parse_toml(text)
            robots = list(supposed_robots(raw)) if robot is None else [robot]
        except TomlError as error:
            raise ProblemError(f"{origin} is no valid TOML: {error}") from error
        except ValueError as error:
            raise ProblemError(f"{origin}: {error}") from error
        first_error: ProblemError | None = None
        for supposed in robots:
            try:
                problem = cls._written_out(raw, origin, supposed)
            except ProblemError as error:
                first_error = first_error or error
            else:
                problem._source, problem._origin, problem._robot = text, origin, supposed
                return problem
        assert first_error is not None
        raise first_error

    @classmethod
    def _written_out(cls, raw: Mapping[str, Any], origin: str, robot: Inventory) -> Problem:
        origins: list[int] = []
        try:
            written, origins = write_out(raw, robot)
            return cls.model_validate(written)
        except ValidationError as error:
            raise ProblemError(complaint(error, origin, raw, origins)) from error
        except ValueError as error:
            raise ProblemError(f"{origin}: {error}") from error

    def for_robot(
        self, capabilities: Capabilities, zero_tilt: Sequence[float] | None = None
    ) -> Problem:
        """Returns the problem written out for a particular robot.

        Args:
            capabilities: The robot.
            zero_tilt: Its tilt in the zero pose, rad, where that is known.

        Raises:
            ProblemError: The file does not describe robots of this kind.
        """
        touch = capabilities.sensor("touch")
        robot = Inventory(
            joints=len(capabilities.joints),
            touch_sensors=touch.count if touch else 0,
            names=tuple(joint.name for joint in capabilities.joints) if self._robot.names else (),
            announced=announced(capabilities),
            lean=_lean(capabilities, zero_tilt),
        )
        return self if robot == self._robot else self.parse(self._source, self._origin, robot)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for index, part in enumerate(self.parts):
            if part.parent is not None and part.parent >= index:
                raise ValueError(
                    f"parts[{index + 1}] ({part.name}): its parent {part.parent + 1} is no earlier "
                    "part: list parents before their children"
                )
        if not self.share_mounts:
            self.tables.check_doubles(self.parts)
        else:
            _ = self.tables
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
        locked = [part.locked + 1 for part in self.parts if part.locked is not None]
        if len({*locked, *driven}) != len(locked) + len(driven):
            raise ValueError(
                f"parts: each joint carries one part, but {driven} are driven and {locked} locked"
            )
        sensors = sorted(part.sensor + 1 for part in self.parts if part.sensor is not None)
        if sensors != list(range(1, len(sensors) + 1)):
            raise ValueError(f"parts: sensors must be numbered 1, 2, … once each, not {sensors}")
        if sensors and self.touch:
            raise ValueError(
                "touch: say where the sensors are either here or with the parts, not both"
            )
        if not any(gene.can_be_found for gene in genes_of(self.parts, self.tables)):
            raise ValueError(
                "parts: there is nothing to be found: give some length a range (a single choice is "
                "none, the hinge of a part without a motor never shows, and what is uncertain is "
                "found along with a body, not alone)"
            )
        self._check_uncertain()
        return self

    @property
    def source(self) -> str:
        """The TOML text that the problem was read from, to be kept with a run."""
        return self._source

    @property
    def supposed(self) -> Inventory:
        """The robot that the problem is written out for."""
        return self._robot

    @property
    def reads_flat_first(self) -> bool:
        """Whether the first interaction moves nothing.

        While the body lies flat the accelerometer reads its own tilt alone.
        """
        return self.uncertain.spreads.get("accelerometer_deg", 0.0) >= _UNCERTAIN_TILT

    @property
    def reads_zero_pose(self) -> bool:
        """Whether an interaction that moves nothing is worth it, since the robot leans so.

        The accelerometer's tilt, or the ground's slope, must be something that is weighed.
        """
        weighed = any(row.group == "accelerometer_deg" for row in self.table)
        return weighed and self._robot.lean > 0

    @property
    def outlines(self) -> list[PartOutline]:
        """What the table of parameters must know of each part."""
        return [part.outline for part in self.parts]

    @cached_property
    def table(self) -> tuple[Parameter, ...]:
        """Parameters in which the robot may differ from what the problem says.

        ``[uncertain]`` tightens, widens or removes rows; the robot's calibration tightens others,
        and a lean in its zero pose widens that of the accelerometer's tilt.
        """
        rows, spreads = table_of(self.outlines, self.sensors), self.uncertain.spreads
        if self.uncertain.exact:
            return ()
        table = (
            replace(row, narrow=spreads[row.group] / row.unit)
            if row.group in spreads
            else widened(tightened(row, self._robot.announced), self._robot.lean)
            for row in rows
            if spreads.get(row.group, 1.0) > 0
        )
        return tuple(row for row in table if row.narrow or row.may_deviate)

    def _check_uncertain(self) -> None:
        # how many touch sensors there are is not known yet, and groups are the same for two or more
        switches = {row.group: row.switch for row in table_of(self.outlines, 2)}
        for group, spread in self.uncertain.spreads.items():
            if group not in switches:
                raise ValueError(
                    f"uncertain.{group}: is nothing that may be otherwise on this robot: name some "
                    f"of exact, {', '.join(sorted(switches))}"
                )
            if switches[group] and spread:
                raise ValueError(
                    f"uncertain.{group}: either is so or is not: write 0 where it is sure that it "
                    "is not, or leave it out"
                )

    @cached_property
    def sensors(self) -> int:
        """Number of touch sensors that the parts carry."""
        if self.touch == "outermost":
            return min(self._robot.touch_sensors, len(self.parts))
        return sum(part.sensor is not None for part in self.parts)

    @cached_property
    def tables(self) -> AttachmentTables:
        """The problem's mounts and hinges, and what is known of how parts are attached."""
        return AttachmentTables(self.mounts, self.hinges, self.parts)

    def base(self, capabilities: Capabilities) -> Base:
        """Returns the main body, which the robot's capabilities describe, with its mounts."""
        x, y, z = capabilities.base_size
        radius = capabilities.base_radius
        size = (x, y, z) if radius is None else (2 * radius, 2 * radius, z)
        return Base(
            size=size,
            mass=capabilities.base_mass,
            mounts=self.tables.base_mounts(size),
            round=radius is not None,
        )

    def settings(self, capabilities: Capabilities) -> WorldSettings:
        """The world in which models of this robot are simulated."""
        world = WorldSettings(
            steps=self.world.steps,
            step=self.world.step_s,
            friction=self.world.friction,
            slew=math.radians(self.motors.slew_deg_per_s),
        )
        sensor = capabilities.sensor("clearance")
        if sensor is None or sensor.upper is None:
            return world
        return replace(world, clearance_cap=sensor.upper)

    def program_range(self, capabilities: Capabilities) -> Array:
        """Lowest and highest target of each joint, rad, shape (joints, 2); 0 where not driven.

        Raises:
            ProblemError: A joint that must be driven is missing or cannot reach the range.
        """
        joints = capabilities.joints
        limits = np.zeros((len(joints), 2))
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
            limits[motor] = low, high
        return limits

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
            ProblemError: The robot does not fit the problem.
        """
        if not capabilities.sensors:
            raise ProblemError(
                f"robot {capabilities.robot!r} has no sensors, so nothing can be learnt from it; "
                "if it is a dry run, start robotd without --dry, or sim-robotd"
            )
        self._check_time(float(np.max(np.abs(self.program_range(capabilities)))))
        for modality in modalities:
            sensor = capabilities.sensor(modality)
            if sensor is None:
                raise ProblemError(
                    f"robot {capabilities.robot!r} has no {modality} sensor: leave {modality} out "
                    "of the modalities"
                )
            if MODALITIES[modality].on_parts and sensor.count != self.sensors:
                raise ProblemError(
                    f"robot {capabilities.robot!r} has {sensor.count} {modality} sensors, but "
                    f"problem {self.name!r} describes {self.sensors}: correct its parts, or leave "
                    f"{modality} out"
                )
        joints = len(capabilities.joints)
        for part in self.parts:
            if part.joint is not None and part.joint >= joints:
                raise ProblemError(
                    f"problem {self.name!r}: part {part.name!r} hangs on joint {part.joint + 1}, "
                    f"but robot {capabilities.robot!r} has only {joints} joints: choose another "
                    "problem"
                )
        return self.differences(capabilities)

    def differences(self, capabilities: Capabilities) -> tuple[str, ...]:
        """Sentences about differences of robot and problem that do not prevent a run."""
        return (*self._differing_speeds(capabilities), *self._differing_radii(capabilities, 0.1))

    def contradictions(self, capabilities: Capabilities) -> tuple[str, ...]:
        """Differences in parts that may touch the ground, which make lengths certain and wrong."""
        carriers = {part.parent for part in self.parts}
        return self._differing_radii(capabilities, 0.25, carriers)

    def _check_time(self, farthest: float) -> None:
        turn, slew = math.degrees(farthest), self.motors.slew_deg_per_s
        duration = self.world.steps * self.world.step_s
        if turn > slew * duration:
            raise ProblemError(
                f"problem {self.name!r}: {turn:.4g} degrees at {slew:.4g} degrees per second take "
                f"{turn / slew:.4g} s, and a simulation lasts {duration:.4g} s: correct motors or "
                "world"
            )

    def _differing_speeds(self, capabilities: Capabilities) -> list[str]:
        slew = self.motors.slew_deg_per_s
        driven = [capabilities.joints[motor] for motor in self.motors.driven]
        speeds = [(joint.name, math.degrees(joint.speed)) for joint in driven]
        return [
            f"joint {name} moves at {speed:.1f} degrees per second, the models at {slew:g}"
            for name, speed in speeds
            if abs(speed - slew) > 0.01 * slew
        ]

    def _differing_radii(
        self, capabilities: Capabilities, tolerance: float, but: Collection[int | None] = ()
    ) -> tuple[str, ...]:
        stated = capabilities.part_radii or ()
        if len(stated) != len(self.parts):
            return ()  # parts are not one to a joint, so there is nothing to compare
        parts: dict[tuple[float, float], list[str]] = {}
        for index, part in enumerate(self.parts):
            radius = stated[index if part.joint is None else part.joint]
            if index not in but and abs(part.radius - radius) > tolerance * radius:
                parts.setdefault((radius, part.radius), []).append(part.name)
        return tuple(
            f"the robot states a radius of {claimed * 1e3:.1f} mm for {', '.join(names)}, and the "
            f"problem {modelled * 1e3:.1f} mm: write radius = {claimed:.4g} there, or its lengths "
            "will be wrong"
            for (claimed, modelled), names in parts.items()
        )


def _lean(capabilities: Capabilities, zero_tilt: Sequence[float] | None) -> float:
    """The larger tilt in the zero pose, rad, where it is more than usual; else 0."""
    tilt = capabilities.sensor("tilt")
    lean = max(map(abs, zero_tilt or (0.0,)))
    usual = max(math.radians(_UNCERTAIN_TILT), _BY_CHANCE * tilt.noise if tilt else 0.0)
    return lean if lean > usual else 0.0
