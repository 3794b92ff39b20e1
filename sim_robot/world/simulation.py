"""The world: a PyBullet body on a plane, its servos, and what its sensors are exposed to.

World steps are 1/240 s. Light links make the solver miss joint angles, so every link gets at least
``MIN_INERTIA``. The world is built anew each time the body is laid down: contacts left over from an
earlier pose would make readings depend on history.
"""

from __future__ import annotations

import logging
import math
import secrets
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from protocol.sockets.closable import Closable
from protocol.system.native_output import native_output_discarded
from protocol.wire.readings import belly_ray, up_in_body
from sim_robot.world.body import Body

with native_output_discarded():
    import pybullet

STEP: Final = 1 / 240
GRAVITY: Final = 9.81
FRICTION: Final = 0.7
MIN_INERTIA: Final = 0.001
SERVO_SPEED: Final = math.radians(60)
HOLD_TOLERANCE: Final = math.radians(0.1)

_CALM_STEPS: Final = 72  # 0.3 s without motion is rest
_CALM_SPEED: Final = 1e-3  # m/s, of the main body
_CALM_SPIN: Final = 0.01  # rad/s, of a joint


class World(Closable):
    """One body in one PyBullet server.

    Args:
        body: The body.
        log: Told when a servo cannot hold its angle.
    """

    def __init__(self, body: Body, *, log: logging.Logger):
        self._body = body
        self._log = log
        with native_output_discarded():
            self._client: int = pybullet.connect(pybullet.DIRECT)
        self._file = Path(tempfile.gettempdir(), f"body-{secrets.token_hex(8)}.urdf")
        self._targets: list[float | None] = [0.0] * len(body.motors)
        self._steps = 0
        self._time = 0.0
        self._held: tuple[tuple[float, float, float], tuple[float, float, float, float]] | None
        self._held = None
        self._pressed: dict[str, float] = {}
        self._build()

    def close(self) -> None:
        """Ends the PyBullet server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def lay_down(self) -> None:
        """Puts the body down upright, joints at their targets, lowest point on the ground."""
        self._held = None
        self._build()

    def hold(self, height: float, up: Sequence[float] = (0.0, 0.0, 1.0)) -> None:
        """Fixes the body in the air, as a stand or two hands do, until it is laid down again.

        Args:
            height: Of the belly's middle above the ground when the body is upright, m.
            up: The direction in the body frame that points up, of length 1.
        """
        center = self._body.base_center[2] - self._body.base_size[2] / 2
        self._held = (0.0, 0.0, height - center), _turn_up(up)
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
        while self._time + STEP <= time + 1e-9:
            pybullet.stepSimulation(physicsClientId=self._client)
            self._steps += 1
            self._time += STEP
            self._watch()

    @property
    def steps(self) -> int:
        """Steps done so far."""
        return self._steps

    def up(self) -> tuple[float, float, float]:
        """The world's up direction in the body frame."""
        return up_in_body(self._base_pose()[1])

    def belly_ray(self) -> float:
        """From the belly's middle along its normal to the ground, m; infinite where it misses."""
        x, y, z = self._body.base_center
        belly = (x, y, z - self._body.base_size[2] / 2)
        position, orientation = self._base_pose()
        up = up_in_body(orientation)
        height = position[2] + sum(a * b for a, b in zip(up, belly, strict=True))
        return belly_ray(height, up)

    def loads(self) -> tuple[float, ...]:
        """Force of the ground, and of whoever presses, on each touch sensor, N."""
        forces = dict.fromkeys(self._body.touch, 0.0) | self._pressed
        for contact in pybullet.getContactPoints(
            self._robot, self._ground, physicsClientId=self._client
        ):
            name = self._sensor_of.get(contact[3])
            if name is not None:
                forces[name] += contact[9]
        return tuple(forces.values())

    def gaps(self) -> tuple[float, ...]:
        """Distance of each touch sensor's parts from the ground, m, at most 1."""
        gaps = dict.fromkeys(self._body.touch, 1.0)
        for index, name in self._sensor_of.items():
            for point in pybullet.getClosestPoints(
                self._robot, self._ground, 1.0, index, physicsClientId=self._client
            ):
                gaps[name] = min(gaps[name], point[8])
        return tuple(gaps.values())

    def angles(self) -> tuple[float, ...]:
        """Where each motor's joint is, rad."""
        states = pybullet.getJointStates(self._robot, self._motors, physicsClientId=self._client)
        return tuple(state[0] for state in states)

    def largest_miss(self) -> float:
        """How far the worst servo is from its target, rad."""
        misses = [
            abs(angle - target)
            for angle, target in zip(self.angles(), self._targets, strict=True)
            if target is not None
        ]
        return max(misses, default=0.0)

    def speed(self) -> float:
        """Speed of the main body, m/s."""
        linear, _ = pybullet.getBaseVelocity(self._robot, physicsClientId=self._client)
        return math.hypot(*linear)

    # --- inside -----------------------------------------------------------------------------------

    def _build(self) -> None:
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=client)
        pybullet.setTimeStep(STEP, physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        self._ground: int = pybullet.createMultiBody(0, plane, physicsClientId=client)
        position, orientation = self._held or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        self._robot: int = self._load(position, orientation)
        self._index_links()
        # Coefficients multiply, so with 1 for the ground the body's is the pair's.
        pybullet.changeDynamics(self._ground, -1, lateralFriction=1.0, physicsClientId=client)
        for link in range(-1, pybullet.getNumJoints(self._robot, physicsClientId=client)):
            inertia = pybullet.getDynamicsInfo(self._robot, link, physicsClientId=client)[2]
            pybullet.changeDynamics(
                self._robot,
                link,
                lateralFriction=FRICTION,
                localInertiaDiagonal=[max(MIN_INERTIA, value) for value in inertia],
                physicsClientId=client,
            )
        info = pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=client)
        self._upright = info[4]
        self._inertial_to_link = pybullet.invertTransform(info[3], info[4])
        self._place()
        self._command()
        self._calm = 0

    def _load(self, position: Sequence[float], orientation: Sequence[float]) -> int:
        """Loads the body into PyBullet, from a file that exists only meanwhile.

        So who is killed leaves nothing behind. The name stays: PyBullet remembers each for ever.
        """
        with open(self._file, "x", encoding="utf-8") as file:
            file.write(self._body.urdf)
        try:
            with native_output_discarded():
                robot: int = pybullet.loadURDF(
                    str(self._file),
                    position,
                    orientation,
                    useFixedBase=self._held is not None,
                    flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
                    physicsClientId=self._client,
                )
        finally:
            self._file.unlink()
        return robot

    def _index_links(self) -> None:
        joints: dict[str, int] = {}
        links = {self._body.base: -1}
        for index in range(pybullet.getNumJoints(self._robot, physicsClientId=self._client)):
            info = pybullet.getJointInfo(self._robot, index, physicsClientId=self._client)
            joints[info[1].decode()] = index
            links[info[12].decode()] = index
        self._motors = [joints[motor.name] for motor in self._body.motors]
        self._sensor_of = {
            links[link]: name for name, group in self._body.touch.items() for link in group
        }

    def _place(self) -> None:
        for joint, target in zip(self._motors, self._targets, strict=True):
            pybullet.resetJointState(
                self._robot, joint, target or 0.0, physicsClientId=self._client
            )
        if self._held is not None:
            return
        lift = 10.0
        pybullet.resetBasePositionAndOrientation(
            self._robot, [0, 0, lift], self._upright, physicsClientId=self._client
        )
        points = pybullet.getClosestPoints(
            self._robot, self._ground, 2 * lift, physicsClientId=self._client
        )
        lowest = min(point[8] for point in points)
        pybullet.resetBasePositionAndOrientation(
            self._robot, [0, 0, lift - lowest], self._upright, physicsClientId=self._client
        )

    def _command(self) -> None:
        for joint, motor, target in zip(
            self._motors, self._body.motors, self._targets, strict=True
        ):
            pybullet.setJointMotorControl2(
                self._robot,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=target or 0.0,
                positionGain=1.0,
                velocityGain=1.0,
                maxVelocity=SERVO_SPEED,
                force=motor.effort if target is not None else 0.0,
                physicsClientId=self._client,
            )

    def _watch(self) -> None:
        """Logs, once a pose, that the robot rests without having reached its angles."""
        self._calm = self._calm + 1 if self.speed() < _CALM_SPEED else 0
        if self._calm == _CALM_STEPS and self._slews():
            self._calm = 0  # legs in the air leave the main body still
        elif self._calm == _CALM_STEPS:
            miss = self.largest_miss()
            if miss > HOLD_TOLERANCE:
                self._log.warning(
                    "a servo is too weak for this pose: it rests %.2f° from its target "
                    "(torques are the <limit effort> of the URDF)",
                    math.degrees(miss),
                )

    def _slews(self) -> bool:
        states = pybullet.getJointStates(self._robot, self._motors, physicsClientId=self._client)
        return any(abs(state[1]) > _CALM_SPIN for state in states)

    def _base_pose(self) -> tuple[tuple[float, float, float], tuple[float, ...]]:
        """Position and orientation of the root link's frame (PyBullet gives its inertial one)."""
        position, orientation = pybullet.getBasePositionAndOrientation(
            self._robot, physicsClientId=self._client
        )
        return pybullet.multiplyTransforms(  # type: ignore[no-any-return]
            position, orientation, *self._inertial_to_link
        )


def _turn_up(up: Sequence[float]) -> tuple[float, float, float, float]:
    """The shortest turn, as a quaternion x, y, z, w, that brings a direction up."""
    x, y, z = up
    if z < -1 + 1e-9:
        return 1.0, 0.0, 0.0, 0.0
    length = math.sqrt(2 * (1 + z))
    return y / length, -x / length, 0.0, length / 2
