"""The world: a body on a plane, its servos, and what its sensors are exposed to.

World steps are 1/240 s. An engine builds the body anew each time it is laid down: contacts left
over from an earlier pose would make readings depend on history. PyBullet is the default where it
is installed. MuJoCo shares nothing with it: its contacts are soft, and another solver finds the
forces.
"""

from __future__ import annotations

import importlib
import logging
import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

from protocol.system.missing_library import install_command
from protocol.system.process import Closable
from protocol.wire.readings import belly_ray, up_in_body
from sim_robot.errors import EngineError
from sim_robot.world.body import Body

STEP: Final = 1 / 240
"""Step of the simulation, s: PyBullet's own default."""
GRAVITY: Final = 9.81
"""Acceleration of gravity, m/s²."""
FRICTION: Final = 0.7
"""Coulomb coefficient of the ground; not tuned."""
SERVO_SPEED: Final = math.radians(60)
"""Largest speed of a servo, rad/s."""
HOLD_TOLERANCE: Final = math.radians(0.1)
"""Distance from its target, rad, beyond which a servo at rest is too weak."""
MAX_GAP: Final = 1.0
"""Largest distance from the ground that is told, m, also of what is farther."""

_LOOK_STEPS: Final = 12  # steps from one look at the pose to the next: 0.05 s
_CALM_LOOKS: Final = 10  # 0.5 s in one pose are rest; low speed alone is not, if a body tips over
_SAME_HEIGHT: Final = 5e-5  # m
_SAME_ANGLE: Final = math.radians(0.02)

ENGINES: Final = MappingProxyType(
    {
        "pybullet": ("sim_robot.world.pybullet_world", "PyBulletWorld"),
        "mujoco": ("sim_robot.world.mujoco_world", "MuJoCoWorld"),
    }
)
"""Modules and classes of the engines, by name: imported only when asked for."""
DEFAULT_ENGINE: Final = "mujoco" if find_spec("pybullet") is None else "pybullet"

_ADVICE: Final = MappingProxyType(
    {
        "pybullet": " brings it to Python 3.11 on Linux (x86-64); take --engine mujoco elsewhere",
        "mujoco": "",
    }
)

Position: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]  # x, y, z, w


Direction: TypeAlias = tuple[float, float, float]

_LEVEL: Final[Direction] = (0.0, 0.0, 1.0)


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
        self._due_time = 0.0
        self._held: Pose | None = None
        self._up: Direction = _LEVEL
        self._pressed: dict[str, float] = {}
        self._rest_pose: tuple[float, ...]  # the pose since which looks are counted
        self._calm_looks, self._rest_pose = 0, ()
        self._build()

    def lay_down(self) -> None:
        """Puts the body down upright, joints at their targets, lowest point on the ground.

        The next step begins now: when steps fall due does not depend on what was before.
        """
        self._held = None
        self._pressed.clear()
        self._calm_looks, self._rest_pose = 0, ()
        self._time = self._due_time
        self._build()

    def become(self, body: Body) -> None:
        """Puts another body, with joints and sensors of the same names, down instead of this."""
        self._body = body
        self.lay_down()

    def hold(self, height: float, up: Sequence[float] = (0.0, 0.0, 1.0)) -> None:
        """Fixes the body in the air, as a stand or two hands do, until it is laid down again.

        Args:
            height: Height of the belly's middle above the ground when the body is upright, m.
            up: The direction in the body frame that points up, of length 1.
        """
        center = self._body.base_center[2] - self._body.base_size[2] / 2
        self._held = Pose((0.0, 0.0, height - center), _turn_up(up))
        self._pressed.clear()
        self._calm_looks, self._rest_pose = 0, ()
        self._build()

    def incline(self, up: Direction) -> None:
        """Lets the ground slope from now on.

        Args:
            up: The direction against gravity, of length 1; the ground's own normal is the z axis.
        """
        if up != self._up:
            self._up = up
            self._calm_looks, self._rest_pose = 0, ()
            self._pull()

    def press(self, sensor: str, force: float) -> None:
        """Loads a touch sensor with a force (N), as a weight does, until the body is put anew."""
        self._pressed[sensor] = force

    def set_targets(self, angles: Sequence[float | None]) -> None:
        """Commands the servos: an angle (rad) per motor, ``None`` for no pulses (limp)."""
        targets = list(angles)
        if targets != self._targets:
            self._targets = targets
            self._calm_looks, self._rest_pose = 0, ()
            self._command()

    def advance_to(self, time: float) -> None:
        """Steps the world until ``time`` (s)."""
        self._due_time = time
        while self._time + STEP <= time + 1e-9:
            self._step()
            self._steps += 1
            self._time += STEP
            self._watch()

    @property
    def steps(self) -> int:
        """Number of steps done so far."""
        return self._steps

    def up(self) -> Direction:
        """The direction against gravity in the body frame."""
        return _in_body(self._up, self._pose().orientation)

    def belly_ray(self) -> float:
        """Distance from the belly's middle along its normal to the ground, m; infinite for none."""
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
        """Distance of each touch sensor's parts from the ground, m, at most ``MAX_GAP``."""
        gaps = dict.fromkeys(self._body.touch, MAX_GAP)
        for name, gap in self._distances():
            gaps[name] = min(gaps[name], gap)
        return tuple(gaps.values())

    def largest_miss(self) -> float:
        """Distance of the worst servo from its target, rad."""
        misses = [
            abs(angle - target)
            for angle, target in zip(self.angles(), self._targets, strict=True)
            if target is not None
        ]
        return max(misses, default=0.0)

    # --- what an engine does ----------------------------------------------------------------------

    @abstractmethod
    def angles(self) -> tuple[float, ...]:
        """Angle of each motor's joint, rad."""

    @abstractmethod
    def torques(self) -> tuple[float, ...]:
        """Torque of each servo, as a share of the most that it can give, signed as its angle."""

    @abstractmethod
    def _build(self) -> None:
        """Builds the world, the body held or lying upright, its joints at their targets."""

    @abstractmethod
    def _pull(self) -> None:
        """Passes the direction of gravity on."""

    @abstractmethod
    def _command(self) -> None:
        """Passes the targets on to the servos."""

    @abstractmethod
    def _step(self) -> None:
        """Lets ``STEP`` pass."""

    @abstractmethod
    def _pose(self) -> Pose:
        """Pose of the root link's frame in the world."""

    @abstractmethod
    def _contacts(self) -> Iterator[tuple[str, float]]:
        """Touch sensors on the ground, each with the force, N; one may come several times."""

    @abstractmethod
    def _distances(self) -> Iterator[tuple[str, float]]:
        """Touch sensors with a part's distance from the ground, m; one may come several times."""

    # --- inside -----------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Logs, once a pose, that the robot rests without having reached its angles."""
        if self._steps % _LOOK_STEPS:
            return
        pose = (self._pose().position[2], *self.up(), *self.angles())
        limits = (_SAME_HEIGHT, *[_SAME_ANGLE] * (len(pose) - 1))
        if not self._rest_pose or any(
            abs(value - rest_value) > limit
            for value, rest_value, limit in zip(pose, self._rest_pose, limits, strict=True)
        ):
            self._calm_looks, self._rest_pose = 0, pose
            return
        self._calm_looks += 1
        miss = self.largest_miss() if self._calm_looks == _CALM_LOOKS else 0.0
        if miss > HOLD_TOLERANCE:
            self._log.warning(
                "a servo is too weak for this pose: it rests %.2f° from its target "
                "(torques are the <limit effort> of the URDF)",
                math.degrees(miss),
            )


def _in_body(direction: Direction, orientation: Quaternion) -> Direction:
    """A direction of the world in the frame of a body."""
    (x, y, z, w), (a, b, c) = orientation, direction
    up = up_in_body(orientation)
    return (
        a * (1 - 2 * (y * y + z * z)) + b * 2 * (x * y + w * z) + c * up[0],
        a * 2 * (x * y - w * z) + b * (1 - 2 * (x * x + z * z)) + c * up[1],
        a * 2 * (x * z + w * y) + b * 2 * (y * z - w * x) + c * up[2],
    )


def _turn_up(up: Sequence[float]) -> Quaternion:
    """The shortest turn that brings a direction up."""
    x, y, z = up
    if z < -1 + 1e-9:
        return 1.0, 0.0, 0.0, 0.0
    length = math.sqrt(2 * (1 + z))
    return y / length, -x / length, 0.0, length / 2


def open_world(body: Body, *, log: logging.Logger, engine: str = DEFAULT_ENGINE) -> World:
    """Puts a body into a world.

    Args:
        body: The body.
        log: Told when a servo cannot hold its angle.
        engine: A name in ``ENGINES``.

    Raises:
        EngineError: The engine is not installed.
    """
    module, name = ENGINES[engine]
    if find_spec(engine) is None:
        raise EngineError(f"{engine} is not installed: {install_command('sim')}{_ADVICE[engine]}")
    world: World = getattr(importlib.import_module(module), name)(body, log=log)
    return world
