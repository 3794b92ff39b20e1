"""The world in PyBullet.

Light links make the solver miss joint angles, so every link gets at least ``MIN_INERTIA``.
"""

from __future__ import annotations

import logging
import secrets
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from protocol.system.process import native_output_discarded
from sim_robot.world.body import Body
from sim_robot.world.simulation import FRICTION, GRAVITY, MAX_GAP, SERVO_SPEED, STEP, Pose, World

with native_output_discarded():
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

MIN_INERTIA: Final = 0.001
"""Least moment of inertia of a link, kg·m²; not tuned."""
_ORIGIN: Final = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class PyBulletWorld(World):
    """One body in one PyBullet server; see ``World``."""

    def __init__(self, body: Body, *, log: logging.Logger):
        with native_output_discarded():
            self._bullet = BulletClient(pybullet.DIRECT)
        self._file = _new_body_file()
        super().__init__(body, log=log)

    def become(self, body: Body) -> None:
        """Replaces the body; from a file with the old name PyBullet would load the old one."""
        self._file = _new_body_file()
        super().become(body)

    def close(self) -> None:
        """Ends the PyBullet server."""
        if self._bullet.isConnected():
            self._bullet.disconnect()

    def angles(self) -> tuple[float, ...]:
        """Angle of each motor's joint, rad."""
        states = self._bullet.getJointStates(self._robot, self._motors)
        return tuple(state[0] for state in states)

    def torques(self) -> tuple[float, ...]:
        """Torque of each servo, as a share of the most that it can give."""
        states = self._bullet.getJointStates(self._robot, self._motors)
        efforts = [motor.effort for motor in self._body.motors]
        return tuple(state[3] / effort for state, effort in zip(states, efforts, strict=True))

    def _step(self) -> None:
        self._bullet.stepSimulation()

    def _contacts(self) -> Iterator[tuple[str, float]]:
        for contact in self._bullet.getContactPoints(self._robot, self._ground):
            name = self._sensor_of.get(contact[3])
            if name is not None:
                yield name, contact[9]

    def _distances(self) -> Iterator[tuple[str, float]]:
        for index, name in self._sensor_of.items():
            for point in self._bullet.getClosestPoints(self._robot, self._ground, MAX_GAP, index):
                yield name, point[8]

    def _pose(self) -> Pose:
        # PyBullet gives the root link's inertial frame.
        pose = self._bullet.getBasePositionAndOrientation(self._robot)
        return Pose(*pybullet.multiplyTransforms(*pose, *self._inertial_to_link))

    def _pull(self) -> None:
        self._bullet.setGravity(*(-GRAVITY * value for value in self._up))

    def _build(self) -> None:
        bullet = self._bullet
        bullet.resetSimulation()
        self._pull()
        bullet.setTimeStep(STEP)
        plane = bullet.createCollisionShape(pybullet.GEOM_PLANE)
        self._ground: int = bullet.createMultiBody(0, plane)
        self._robot: int = self._load(self._held or _ORIGIN)
        self._index_links()
        # Coefficients multiply, so with 1 for the ground the body's is the pair's.
        bullet.changeDynamics(self._ground, -1, lateralFriction=1.0)
        for link in range(-1, bullet.getNumJoints(self._robot)):
            inertia = bullet.getDynamicsInfo(self._robot, link)[2]
            bullet.changeDynamics(
                self._robot,
                link,
                lateralFriction=FRICTION,
                localInertiaDiagonal=[max(MIN_INERTIA, value) for value in inertia],
            )
        if self._body.base_radius is not None:  # else its rim is rounded
            bullet.changeDynamics(self._robot, -1, collisionMargin=0.0)
        info = bullet.getDynamicsInfo(self._robot, -1)
        self._upright = info[4]
        self._inertial_to_link = pybullet.invertTransform(info[3], info[4])
        self._place()
        self._command()

    def _load(self, pose: Pose) -> int:
        """Loads the body into PyBullet, from a file that exists only meanwhile.

        So a process that is killed leaves nothing behind. The name stays the same, because PyBullet
        remembers each for ever.
        """
        with open(self._file, "x", encoding="utf-8") as file:
            file.write(self._body.urdf)
        try:
            with native_output_discarded():
                robot: int = self._bullet.loadURDF(
                    str(self._file),
                    pose.position,
                    pose.orientation,
                    useFixedBase=self._held is not None,
                    flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
                )
        finally:
            self._file.unlink()
        return robot

    def _index_links(self) -> None:
        joints: dict[str, int] = {}
        links = {self._body.base: -1}
        for index in range(self._bullet.getNumJoints(self._robot)):
            info = self._bullet.getJointInfo(self._robot, index)
            joints[info[1].decode()] = index
            links[info[12].decode()] = index
        self._motors = [joints[motor.name] for motor in self._body.motors]
        self._sensor_of = {
            links[link]: name for name, group in self._body.touch.items() for link in group
        }

    def _place(self) -> None:
        for joint, target in zip(self._motors, self._targets, strict=True):
            self._bullet.resetJointState(self._robot, joint, target or 0.0)
        if self._held is not None:
            return
        lift = 10.0
        self._bullet.resetBasePositionAndOrientation(self._robot, [0, 0, lift], self._upright)
        points = self._bullet.getClosestPoints(self._robot, self._ground, 2 * lift)
        lowest = min(point[8] for point in points)
        self._bullet.resetBasePositionAndOrientation(
            self._robot, [0, 0, lift - lowest], self._upright
        )

    def _command(self) -> None:
        for joint, motor, target in zip(
            self._motors, self._body.motors, self._targets, strict=True
        ):
            self._bullet.setJointMotorControl2(
                self._robot,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=target or 0.0,
                positionGain=1.0,
                velocityGain=1.0,
                maxVelocity=SERVO_SPEED,
                force=motor.effort if target is not None else 0.0,
            )


def _new_body_file() -> Path:
    return Path(tempfile.gettempdir(), f"body-{secrets.token_hex(8)}.urdf")
