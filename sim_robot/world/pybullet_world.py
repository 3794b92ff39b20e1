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

MIN_INERTIA: Final = 0.001
"""Least moment of inertia of a link, kg·m²; not tuned."""
_ORIGIN: Final = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class PyBulletWorld(World):
    """One body in one PyBullet server; see ``World``."""

    def __init__(self, body: Body, *, log: logging.Logger):
        with native_output_discarded():
            self._client: int = pybullet.connect(pybullet.DIRECT)
        self._file = _new_body_file()
        super().__init__(body, log=log)

    def become(self, body: Body) -> None:
        """Replaces the body; from a file with the old name PyBullet would load the old one."""
        self._file = _new_body_file()
        super().become(body)

    def close(self) -> None:
        """Ends the PyBullet server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def angles(self) -> tuple[float, ...]:
        """Angle of each motor's joint, rad."""
        states = pybullet.getJointStates(self._robot, self._motors, physicsClientId=self._client)
        return tuple(state[0] for state in states)

    def torques(self) -> tuple[float, ...]:
        """Torque of each servo, as a share of the most that it can give."""
        states = pybullet.getJointStates(self._robot, self._motors, physicsClientId=self._client)
        efforts = [motor.effort for motor in self._body.motors]
        return tuple(state[3] / effort for state, effort in zip(states, efforts, strict=True))

    def _step(self) -> None:
        pybullet.stepSimulation(physicsClientId=self._client)

    def _contacts(self) -> Iterator[tuple[str, float]]:
        for contact in pybullet.getContactPoints(
            self._robot, self._ground, physicsClientId=self._client
        ):
            name = self._sensor_of.get(contact[3])
            if name is not None:
                yield name, contact[9]

    def _distances(self) -> Iterator[tuple[str, float]]:
        for index, name in self._sensor_of.items():
            for point in pybullet.getClosestPoints(
                self._robot, self._ground, MAX_GAP, index, physicsClientId=self._client
            ):
                yield name, point[8]

    def _pose(self) -> Pose:
        # PyBullet gives the root link's inertial frame.
        pose = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        return Pose(*pybullet.multiplyTransforms(*pose, *self._inertial_to_link))

    def _build(self) -> None:
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=client)
        pybullet.setTimeStep(STEP, physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        self._ground: int = pybullet.createMultiBody(0, plane, physicsClientId=client)
        self._robot: int = self._load(self._held or _ORIGIN)
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
        if self._body.base_radius is not None:  # else its rim is rounded
            pybullet.changeDynamics(self._robot, -1, collisionMargin=0.0, physicsClientId=client)
        info = pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=client)
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
                robot: int = pybullet.loadURDF(
                    str(self._file),
                    pose.position,
                    pose.orientation,
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


def _new_body_file() -> Path:
    return Path(tempfile.gettempdir(), f"body-{secrets.token_hex(8)}.urdf")
