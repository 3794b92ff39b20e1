"""What no robot can be and no sensor can read: slips of a unit, sensors gone mad, frozen robots.

A search would fit whatever it is given. Each check returns what is wrong, as the part of a
sentence that says so, or ``None``.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.readings.modalities import MODALITIES, ROUNDING
from estimator.readings.observation import Observation, Program
from protocol.wire.capabilities import Capabilities

LENGTHS: Final = (1e-4, 10.0)
"""Least and largest length of anything on a robot, m; one outside is a slip of the unit."""

DENSITIES: Final = (1.0, 25_000.0)
"""Least and largest density, from a hull full of air to solid platinum, kg/m³."""

_COINCIDENCES: Final = 4  # equal noisy numbers in a row; fewer may be coarse, or chance


def implausible_body(robot: Capabilities) -> str | None:
    """What is wrong with the sizes and masses that a robot says it has."""
    low, high = LENGTHS
    sizes = [("base_size", size) for size in robot.base_size]
    for name, length in [*sizes, *(("part_radii", radius) for radius in robot.part_radii or ())]:
        if not low <= length <= high:
            return f"{name} holds {length:g} m, and must lie in {low:g} to {high:g} m"
    volume = math.prod(robot.base_size)
    if robot.base_radius is not None:
        volume *= math.pi / 4
    density = robot.base_mass / volume
    if not DENSITIES[0] <= density <= DENSITIES[1]:
        x, y, z = robot.base_size
        return (
            f"a main body of {x:g} x {y:g} x {z:g} m (base_size) with {robot.base_mass:g} kg "
            f"(base_mass) has a density of {density:.3g} kg/m³, and nothing is built outside "
            f"{DENSITIES[0]:g} to {DENSITIES[1]:g}"
        )
    for sensor in robot.sensors:
        wrong = MODALITIES[sensor.modality].wrong_sensor(sensor)
        if wrong is not None:
            return wrong
    return None


def impossible_reading(observation: Observation, robot: Capabilities) -> str | None:
    """What in an observation this robot cannot have taken or measured."""
    for joint, angle in zip(robot.joints, observation.angles, strict=True):
        slack = joint.resolution + ROUNDING
        if not joint.lower - slack <= angle <= joint.upper + slack:
            return (
                f"an angle of {_degrees(angle)} of joint {joint.name}, which reaches "
                f"{_degrees(joint.lower)} to {_degrees(joint.upper)}"
            )
    for joint, measured in zip(robot.joints, observation.measured, strict=False):
        if (joint.measured_noise is None) != (measured is None):
            return f"{'no' if measured is None else 'a'} measured angle of joint {joint.name}"
        if measured is not None and abs(measured) > 2 * math.pi:
            return f"a measured angle of {_degrees(measured)} of joint {joint.name}"
    for modality in MODALITIES.values():
        wrong = modality.wrong_reading(observation, robot.sensor(modality.name))
        if wrong is not None:
            return wrong
    return None


class AnswerChecks:
    """Checks what a robot answers against what was asked of it, and against its answers before.

    Args:
        robot: What the robot said that it is.
    """

    def __init__(self, robot: Capabilities):
        self._robot = robot
        self._last: Observation | None = None
        self._coincidences = 0

    def wrong(self, program: Program, observation: Observation) -> str | None:
        """What in the observation of a motor program cannot be.

        If nothing, it is remembered for the checks of later ones.
        """
        coincidences = self._coincidences + self._repeated(observation)
        wrong = (
            impossible_reading(observation, self._robot)
            or self._wrong_angles(program, observation)
            or self._backward_time(observation)
        )
        if wrong is None and coincidences >= _COINCIDENCES:
            wrong = (
                "the very readings that it reported before, to the last bit, after other movements "
                "and though its sensors are noisy: sensors or servos are frozen"
            )
        if wrong is None:
            self._last, self._coincidences = observation, coincidences
        return wrong

    def _wrong_angles(self, program: Program, observation: Observation) -> str | None:
        """What is wrong with angles: they lie within one step of their targets (SPEC.md, 7.4)."""
        joints = self._robot.joints
        for joint, target, angle in zip(joints, program, observation.angles, strict=True):
            if abs(angle - target) > joint.resolution + ROUNDING:
                matches = [
                    candidate.name
                    for candidate, its_target in zip(joints, program, strict=True)
                    if abs(angle - its_target) <= candidate.resolution + ROUNDING
                ]
                return (
                    f"an angle of {_degrees(angle)} of joint {joint.name}, which was told to go to "
                    f"{_degrees(target)} and has steps of {_degrees(joint.resolution)}"
                    + (f"; that is the target of {' and '.join(matches)}" if matches else "")
                )
        return None

    def _backward_time(self, observation: Observation) -> str | None:
        last_time = None if self._last is None else self._last.robot_time
        time = observation.robot_time
        if last_time is None or time is None or time >= last_time:
            return None
        return f"a robot time of {time:.2f} s, after one of {last_time:.2f} s"

    def _repeated(self, observation: Observation) -> int:
        """How many noisy numbers equal those of the last observation, after another movement.

        Where one differs, or the movement is the same, minus the count so far, which begins anew.
        """
        if self._last is None or observation.angles == self._last.angles:
            return -self._coincidences
        last_values, values = self._noisy_numbers(self._last), self._noisy_numbers(observation)
        return len(values) if values == last_values else -self._coincidences

    def _noisy_numbers(self, observation: Observation) -> list[float]:
        """Numbers of sensors that announce noise, except those at the end of a range.

        Touch bits are left out: those of a healthy robot often repeat.
        """
        return [
            value
            for sensor in self._robot.sensors
            for value in MODALITIES[sensor.modality].values(observation)
            if sensor.noise > 0 and isinstance(value, float) and value != sensor.upper
        ]


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
