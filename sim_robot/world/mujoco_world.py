"""The world in MuJoCo, an engine that shares nothing with PyBullet.

Contacts are as soft as MuJoCo's own defaults make them. A servo is a position servo whose target
moves at its speed, no stronger than the URDF says; its joint has armature, inertia against its own
turning, because MuJoCo's solver of contacts does not see how stiff a servo is. The finer the step,
the less armature is needed, so one step of the world is several of MuJoCo's.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from typing import Any, Final

import mujoco
import numpy as np

from sim_robot.world.body import Body, Motor
from sim_robot.world.simulation import (
    FRICTION,
    GRAVITY,
    HOLD_TOLERANCE,
    MAX_GAP,
    SERVO_SPEED,
    STEP,
    Pose,
    World,
)
from sim_robot.world.urdf.declarations import Box, Collision, Cylinder, Link, Origin, Sphere, vector

_SUBSTEPS: Final = 4  # of MuJoCo in one step of the world
_STEP: Final = STEP / _SUBSTEPS  # s
_FULL_TORQUE_SHARE: Final = 0.2  # share of HOLD_TOLERANCE at which a servo gives its full torque
_MIN_INERTIA: Final = 1e-8  # kg·m²


class MuJoCoWorld(World):
    """One body in a model of MuJoCo; see ``World``."""

    def __init__(self, body: Body, *, log: logging.Logger):
        if mujoco.get_mju_user_warning() is None:
            # MuJoCo would write warnings into a file in the working directory.
            mujoco.set_mju_user_warning(log.debug)
        self._setpoints = np.zeros(len(body.motors))  # where the servos' slewing targets are
        super().__init__(body, log=log)

    def close(self) -> None:
        """Does nothing: MuJoCo's model goes with this object."""

    def angles(self) -> tuple[float, ...]:
        """Angle of each motor's joint, rad."""
        return tuple(self._data.qpos[self._qpos_indices].tolist())

    def torques(self) -> tuple[float, ...]:
        """Torque of each servo, as a share of the most that it can give."""
        efforts = [motor.effort for motor in self._body.motors]
        return tuple((self._data.actuator_force / efforts).tolist())

    def _pose(self) -> Pose:
        x, y, z = self._data.xpos[self._main_id].tolist()
        w, *axis = self._data.xquat[self._main_id].tolist()
        return Pose((x, y, z), (*axis, w))

    def _command(self) -> None:
        limp = np.array([target is None for target in self._targets])
        efforts = np.where(limp, 0.0, [motor.effort for motor in self._body.motors])
        self._model.actuator_forcerange[:] = np.stack([-efforts, efforts], axis=1)
        self._goals = np.array([target or 0.0 for target in self._targets])
        self._limp = limp

    def _step(self) -> None:
        max_turn = SERVO_SPEED * STEP
        self._setpoints += np.clip(self._goals - self._setpoints, -max_turn, max_turn)
        self._setpoints[self._limp] = self._data.qpos[self._qpos_indices][self._limp]
        self._data.ctrl[:] = self._setpoints
        mujoco.mj_step(self._model, self._data, _SUBSTEPS)

    def _contacts(self) -> Iterator[tuple[str, float]]:
        force = np.zeros(6)
        for index, contact in enumerate(self._data.contact):
            name = self._sensor_of.get(int(self._model.geom_bodyid[contact.geom].max()))
            if name is not None:
                mujoco.mj_contactForce(self._model, self._data, index, force)
                yield name, float(force[0])

    def _distances(self) -> Iterator[tuple[str, float]]:
        for geom in range(1, self._model.ngeom):
            name = self._sensor_of.get(int(self._model.geom_bodyid[geom]))
            if name is not None:
                yield name, min(MAX_GAP, self._lowest(geom))

    def _lowest(self, geom: int) -> float:
        """Height of the lowest point of a shape, m."""
        x, y, z = self._data.geom_xmat[geom][6:].tolist()  # climb of its axes, per metre
        size, kind = self._model.geom_size[geom], self._model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            depth = size[0]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            depth = np.abs((x, y, z)) @ size
        else:
            depth = abs(z) * size[1] + math.hypot(x, y) * size[0]
        return float(self._data.geom_xpos[geom][2] - depth)

    def _pull(self) -> None:
        self._model.opt.gravity = [-GRAVITY * value for value in self._up]

    def _build(self) -> None:
        body, held = self._body, self._held
        self._model = _model(body, held)
        self._data = mujoco.MjData(self._model)
        self._main_id = self._model.body(body.base).id
        joints = [self._model.joint(motor.name) for motor in body.motors]
        self._qpos_indices = [int(joint.qposadr[0]) for joint in joints]
        self._sensor_of = {
            self._model.body(link).id: name for name, group in body.touch.items() for link in group
        }
        self._pull()
        self._command()
        self._setpoints[:] = self._data.qpos[self._qpos_indices] = self._goals
        if held is None:
            mujoco.mj_kinematics(self._model, self._data)
            self._data.qpos[2] -= min(map(self._lowest, range(1, self._model.ngeom)))
        mujoco.mj_forward(self._model, self._data)


def _model(body: Body, held: Pose | None) -> Any:
    """The body over a plane, fixed where it is held, as a compiled model."""
    spec = mujoco.MjSpec()
    spec.option.timestep = _STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # Files have few digits: a moment may round to 0, or to a little more than the other two.
    spec.compiler.boundinertia = _MIN_INERTIA
    spec.compiler.balanceinertia = True
    friction = (FRICTION, 0, 0)
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), friction=friction, conaffinity=0
    )
    links = {link.name: link for link in body.robot.links}
    main = spec.worldbody.add_body(name=body.base)
    if held is None:
        main.add_freejoint()
    else:
        main.pos, main.quat = held.position, np.roll(held.orientation, 1)
    _furnish(main, links[body.base])
    carriers = {body.base: main}
    motors = {motor.name: motor for motor in body.motors}
    for joint in body.robot.joints:
        child = carriers[joint.parent.link].add_body(name=joint.child.link, **_place(joint.origin))
        carriers[joint.child.link] = child
        _furnish(child, links[joint.child.link])
        if joint.name in motors:
            hinge = child.add_joint(name=joint.name, axis=vector(joint.axis.xyz))
            hinge.armature = _stiffness(motors[joint.name]) * _STEP**2
    for motor in body.motors:  # actuators are found by number
        servo = spec.add_actuator(
            name=motor.name, target=motor.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        stiffness = _stiffness(motor)
        servo.set_to_position(kp=stiffness, kv=2 * stiffness * _STEP)
        servo.forcelimited = True
        servo.forcerange = (-1.0, 1.0)  # until commanded
    return spec.compile()


def _stiffness(motor: Motor) -> float:
    """Torque of a servo per angle that it is away from its target, N·m/rad."""
    return motor.effort / (_FULL_TORQUE_SHARE * HOLD_TOLERANCE)


def _furnish(element: Any, link: Link) -> None:
    """Gives a link its mass and its shapes."""
    inertial = link.inertial
    assert inertial is not None
    tensor = inertial.inertia
    assert tensor is not None
    element.explicitinertial = True
    element.mass = inertial.mass.value
    place = _place(inertial.origin)
    element.ipos, element.iquat = place["pos"], place["quat"]
    element.fullinertia = (
        *(tensor.ixx, tensor.iyy, tensor.izz),
        *(tensor.ixy, tensor.ixz, tensor.iyz),
    )
    for collision in link.collisions:
        element.add_geom(
            **_shape(collision),
            **_place(collision.origin),
            friction=(FRICTION, 0, 0),
            contype=0,
        )


def _shape(collision: Collision) -> dict[str, Any]:
    shape = collision.geometry.shape
    if isinstance(shape, Box):
        half_extents = [extent / 2 for extent in vector(shape.size)]
        return {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half_extents}
    if isinstance(shape, Cylinder):
        size = (shape.radius, shape.length / 2, 0)
        return {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": size}
    assert isinstance(shape, Sphere)
    return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": (shape.radius, 0, 0)}


def _place(origin: Origin) -> dict[str, Any]:
    """Position and quaternion of an origin; URDF's angles turn about the fixed axes x, y, z."""
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, vector(origin.rpy), "XYZ")
    return {"pos": vector(origin.xyz), "quat": quaternion}
