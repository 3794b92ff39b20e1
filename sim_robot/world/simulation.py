"""The world: a body on a plane, its servos, and what its sensors are exposed to.

World steps are 1/240 s. An engine builds the body anew each time it is laid down: contacts left
over from an earlier pose would make readings depend on history.
"""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple, TypeAlias

from protocol.system.process import Closable
from protocol.wire.readings import belly_ray, up_in_body
from sim_robot.world.body import Body

STEP: Final = 1 / 240
GRAVITY: Final = 9.81
FRICTION: Final = 0.7
SERVO_SPEED: Final = math.radians(60)
HOLD_TOLERANCE: Final = math.radians(0.1)

_CALM_STEPS: Final = 72  # 0.3 s without motion is rest
_CALM_SPEED: Final = 1e-3  # m/s, of the main body
_CALM_SPIN: Final = 0.01  # rad/s, of a joint

Position: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]  # x, y, z, w


class Pose(NamedTuple):
    """Where the root link's frame is in the world."""

    position: Position
    orientation: Quaternion


class World(Closable):
    """One body in one engine; each engine is a subclass.

    Args:
        body: The body.
        log: Told when a servo cannot hold its angle.
    """

    def __init__(self, body: Body, *, log: logging.Logger):
        self._body = body
        self._log = log
        self._targets: list[float | None] = [0.0] * len(body.motors)
        self._steps = 0
        self._time = 0.0
        self._due = 0.0
        self._held: Pose | None = None
        self._pressed: dict[str, float] = {}
        self._calm = 0
        self._build()

    def lay_down(self) -> None:
        """Puts the body down upright, joints at their targets, lowest point on the ground.

        The next step begins now: when steps fall due does not depend on what was before.
        """
        self._held = None
        self._calm = 0
        self._time = self._due
        self._build()

    def hold(self, height: float, up: Sequence[float] = (0.0, 0.0, 1.0)) -> None:
        """Fixes the body in the air, as a stand or two hands do, until it is laid down again.

        Args:
            height: Of the belly's middle above the ground when the body is upright, m.
            up: The direction in the body frame that points up, of length 1.
        """
        center = self._body.base_center[2] - self._body.base_size[2] / 2
        self._held = Pose((0.0, 0.0, height - center), _turn_up(up))
        self._calm = 0
        self._build()

    def press(self, sensor: str, force: float) -> None:
        """Loads a touch sensor with a force (N), as a weight does, until told otherwise."""
        self._pressed[sensor] = force

    def set_targets(self, angles: Sequence[float | None]) -> None:
        """Commands the servos: an angle (rad) per motor, ``None`` for no pulses (limp)."""
        wanted = list(angles)
        if wanted != self._targets:
            self._targets = wanted
            self._calm = 0
            self._command()

    def advance_to(self, time: float) -> None:
        """Steps the world until ``time`` (s)."""
        self._due = time
        while self._time + STEP <= time + 1e-9:
            self._step()
            self._steps += 1
            self._time += STEP
            self._watch()

    @property
    def steps(self) -> int:
        """Steps done so far."""
        return self._steps

    def up(self) -> tuple[float, float, float]:
        """The world's up direction in the body frame."""
        return up_in_body(self._pose().orientation)

    def belly_ray(self) -> float:
        """From the belly's middle along its normal to the ground, m; infinite where it misses."""
        x, y, z = self._body.base_center
        belly = (x, y, z - self._body.base_size[2] / 2)
        position, orientation = self._pose()
        up = up_in_body(orientation)
        height = position[2] + sum(a * b for a, b in zip(up, belly, strict=True))
        return belly_ray(height, up)

    def loads(self) -> tuple[float, ...]:
        """Force of the ground, and of whoever presses, on each touch sensor, N."""
        forces = dict.fromkeys(self._body.touch, 0.0) | self._pressed
        for name, force in self._contacts():
            forces[name] += force
        return tuple(forces.values())

    def gaps(self) -> tuple[float, ...]:
        """Distance of each touch sensor's parts from the ground, m, at most 1."""
        gaps = dict.fromkeys(self._body.touch, 1.0)
        for name, gap in self._distances():
            gaps[name] = min(gaps[name], gap)
        return tuple(gaps.values())

    def largest_miss(self) -> float:
        """How far the worst servo is from its target, rad."""
        misses = [
            abs(angle - target)
            for angle, target in zip(self.angles(), self._targets, strict=True)
            if target is not None
        ]
        return max(misses, default=0.0)

    # --- what an engine does ----------------------------------------------------------------------

    @abstractmethod
    def angles(self) -> tuple[float, ...]:
        """Where each motor's joint is, rad."""

    @abstractmethod
    def speed(self) -> float:
        """Speed of the main body, m/s."""

    @abstractmethod
    def _build(self) -> None:
        """Builds the world, the body held or lying upright, its joints at their targets."""

    @abstractmethod
    def _command(self) -> None:
        """Passes the targets on to the servos."""

    @abstractmethod
    def _step(self) -> None:
        """Lets ``STEP`` pass."""

    @abstractmethod
    def _pose(self) -> Pose:
        """Where the main body is."""

    @abstractmethod
    def _spins(self) -> Iterable[float]:
        """How fast each motor's joint turns, rad/s."""

    @abstractmethod
    def _contacts(self) -> Iterator[tuple[str, float]]:
        """Touch sensors on the ground, each with the force, N; one may come several times."""

    @abstractmethod
    def _distances(self) -> Iterator[tuple[str, float]]:
        """Touch sensors with a part's distance from the ground, m; one may come several times."""

    # --- inside -----------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Logs, once a pose, that the robot rests without having reached its angles."""
        self._calm = self._calm + 1 if self.speed() < _CALM_SPEED else 0
        if self._calm == _CALM_STEPS and any(abs(spin) > _CALM_SPIN for spin in self._spins()):
            self._calm = 0  # legs in the air leave the main body still
        elif self._calm == _CALM_STEPS:
            miss = self.largest_miss()
            if miss > HOLD_TOLERANCE:
                self._log.warning(
                    "a servo is too weak for this pose: it rests %.2f° from its target "
                    "(torques are the <limit effort> of the URDF)",
                    math.degrees(miss),
                )


def _turn_up(up: Sequence[float]) -> Quaternion:
    """The shortest turn that brings a direction up."""
    x, y, z = up
    if z < -1 + 1e-9:
        return 1.0, 0.0, 0.0, 0.0
    length = math.sqrt(2 * (1 + z))
    return y / length, -x / length, 0.0, length / 2
