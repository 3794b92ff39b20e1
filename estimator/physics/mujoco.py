"""Bodies simulated in MuJoCo, an engine that shares nothing with PyBullet, in this process.

Settings of MuJoCo that matter:

* Joints are position servos whose targets move at the slew speed. They are so stiff that a body's
  weight at the end of its longest limb turns a joint by a fifth of the tolerance, and damped to
  follow within two steps.
* Each joint has ``armature``: inertia against its own turning and nothing else. MuJoCo's solver of
  contacts does not see how stiff a servo is. Without armature it takes light parts for loose ones,
  and bodies rock on them for seconds; with as much as the servo's stiffness is worth in one step,
  all links keep their true inertia and lie still.
* MuJoCo's contacts are soft. As set here a body of any mass sinks in by some micrometres.
* The friction of a pair is the larger one, so body and ground both have the pair's coefficient.
* Parts touch the ground alone, not each other.
* A body that flies apart stays so, instead of being put back to its start.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from estimator.body.morphology import (
    BASE,
    Array,
    Morphology,
    Part,
)
from estimator.errors import PhysicsError
from estimator.physics.base import GRAVITY, Pair, Physics, WorldSettings, sensor_count
from estimator.physics.rest import MainBody, RestWatch, fill_row
from estimator.readings.observation import PredictedReadings
from protocol.system.missing_library import install_command
from protocol.wire.readings import up_in_body

_YIELD: Final = 0.2  # turn under the body's weight, as a share of the joints' tolerance; not tuned
_SOFTNESS: Final = 3.0  # time constant of a contact, in steps; MuJoCo's least is 2
_IMPEDANCE: Final = (0.999, 0.9999, 0.001, 0.5, 2.0)  # solimp: bodies sink in by micrometres
_SHORTEST_CAPSULE: Final = 1e-6  # m; a capsule whose centres are closer is a sphere


class MuJoCoPhysics(Physics):
    """Simulates each interaction from the planar pose, and reads the body at the last step.

    Args:
        settings: Settings of the world.

    Raises:
        PhysicsError: MuJoCo is not installed.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self._settings = settings or WorldSettings()
        try:
            self._engine: Any = importlib.import_module("mujoco")
        except ImportError as error:
            raise PhysicsError(
                f"MuJoCo cannot be imported ({error}): {install_command('estimator')}"
            ) from error
        if self._engine.get_mju_user_warning() is None:
            # MuJoCo would write warnings into a file in the working directory.
            self._engine.set_mju_user_warning(_ignore_warning)

    def close(self) -> None:
        """Does nothing: no engine is kept between bodies."""

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair; see ``Physics.read``."""
        readings = PredictedReadings.empty(len(pairs), sensor_count(pairs))
        for row, (body, program) in enumerate(pairs):
            angles = body.part_angles(program)
            if not all(math.isfinite(angle) for angle in angles):
                raise PhysicsError(f"a motor program must be finite, not {list(program)}")
            self.simulations += 1
            try:
                model = build(self._engine, body, self._settings)
            except ValueError:  # what MuJoCo's compiler refuses
                readings.joint_miss[row] = math.inf
                continue
            driven = [index for index, part in enumerate(body.parts) if part.motor is not None]
            targets = np.array([angles[index] for index in driven])
            data = self._engine.MjData(model)
            if not body.lies_flat:
                self._turn(model, data, np.zeros_like(targets))
            self._turn(model, data, targets)
            # MuJoCo sorts joints and bodies depth first; actuators stay in the order added.
            addresses = [int(model.joint(f"joint {index}").qposadr[0]) for index in driven]
            if not (np.all(np.isfinite(data.qpos)) and np.all(np.isfinite(data.qvel))):
                readings.joint_miss[row] = math.inf
                continue  # it flew apart; the row stays invalid
            readings.joint_miss[row] = np.abs(data.qpos[addresses] - targets).max(initial=0.0)
            readings.valid[row] = readings.joint_miss[row] <= self._settings.joint_tolerance
            self._sense(model, data, body, readings, row)
        return readings

    def _turn(self, model: Any, data: Any, targets: Array) -> None:
        """Turns the joints from 0 to their targets; steps until the body rests, or all steps."""
        step, settings = self._engine.mj_step, self._settings
        pace = settings.slew * settings.step
        slewing = math.ceil(np.abs(targets).max(initial=0.0) / pace)
        steps_done = min(settings.steps, slewing)
        for turned in pace * np.arange(1, steps_done + 1):
            data.ctrl[:] = np.clip(targets, -turned, turned)
            step(model, data)
        watch = RestWatch(settings)
        while steps_done < settings.steps and not watch.rests:
            steps = min(watch.STEPS_PER_LOOK, settings.steps - steps_done)
            step(model, data, steps)
            steps_done += steps
            up = up_in_body(tuple(data.qpos[[4, 5, 6, 3]].tolist()))
            watch.look(MainBody(data.qvel[:3], data.qvel[3:6], float(data.qpos[2]), up))
        self.steps += steps_done

    def _sense(
        self, model: Any, data: Any, body: Morphology, readings: PredictedReadings, row: int
    ) -> None:
        """Fills one row of the readings, except for the joints, from the body's present pose."""
        self._engine.mj_kinematics(model, data)
        readings.speed[row] = np.linalg.norm(data.qvel[:3])
        gaps = []
        for index, part in enumerate(body.parts):
            link = data.body(f"part {index}")
            lowest = link.xmat[6] * np.array([part.near, part.far])
            gaps.append(link.xpos[2] + lowest.min() - part.below(link.xmat[6:]))
        main = data.body("main body")
        fill_row(
            readings, row, body, self._settings, height=main.xpos[2], up=main.xmat[6:], gaps=gaps
        )


def build(engine: Any, body: Morphology, settings: WorldSettings) -> Any:
    """A body on the ground in the planar pose, as a compiled model of MuJoCo.

    Part i is the body ``part i``, and where it moves its joint is ``joint i``; the actuators come
    in the parts' order.

    Args:
        engine: The module ``mujoco``.
        body: The body.
        settings: Settings of its world.

    Raises:
        ValueError: MuJoCo refuses the body.
    """
    spec = engine.MjSpec()
    spec.option.timestep = settings.step
    spec.option.gravity = (0, 0, -GRAVITY)
    spec.option.integrator = engine.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = engine.mjtCone.mjCONE_ELLIPTIC
    spec.option.disableflags |= engine.mjtDisableBit.mjDSBL_AUTORESET
    shape, contact = engine.mjtGeom, _contact(settings)
    spec.worldbody.add_geom(
        type=shape.mjGEOM_PLANE, size=(0, 0, 1), **contact | {"contype": 1, "conaffinity": 0}
    )
    main = spec.worldbody.add_body(name="main body", pos=(0, 0, body.planar_height))
    main.add_freejoint()
    x, y, z = (extent / 2 for extent in body.base.size)
    if body.base.round:
        main.add_geom(type=shape.mjGEOM_CYLINDER, size=(x, z, 0), **contact)
    else:
        main.add_geom(type=shape.mjGEOM_BOX, size=(x, y, z), **contact)
    main.explicitinertial, main.mass, main.ipos = True, body.base.mass, body.base.centre
    main.inertia = body.base.inertia
    stiffness = GRAVITY * body.mass * body.reach / (_YIELD * settings.joint_tolerance)
    links: list[Any] = []
    for index, (part, mass) in enumerate(zip(body.parts, body.masses.tolist(), strict=True)):
        link = (main if part.parent == BASE else links[part.parent]).add_body(
            name=f"part {index}", pos=body.place(index), quat=body.mount(index).quaternion
        )
        links.append(link)
        link.add_geom(**_shape(engine, part), mass=mass, **contact)
        if part.motor is not None:
            name = f"joint {index}"
            link.add_joint(
                name=name, axis=body.hinge(index).axis, armature=stiffness * settings.step**2
            )
            servo = spec.add_actuator(target=name, trntype=engine.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=stiffness, kv=2 * stiffness * settings.step)
    return spec.compile()


def _contact(settings: WorldSettings) -> dict[str, Any]:
    return {
        "friction": (settings.friction, 0, 0),
        "solref": (_SOFTNESS * settings.step, 1),
        "solimp": _IMPEDANCE,
        "contype": 0,
        "conaffinity": 1,
    }


def _shape(engine: Any, part: Part) -> dict[str, Any]:
    near, far = part.near, part.far
    size = (part.radius, 0, 0)
    if part.shape == "box":
        return {
            "type": engine.mjtGeom.mjGEOM_BOX,
            "pos": (part.middle, 0, 0),
            "size": [extent / 2 for extent in part.size],
        }
    if far - near > _SHORTEST_CAPSULE:
        return {
            "type": engine.mjtGeom.mjGEOM_CAPSULE,
            "fromto": (near, 0, 0, far, 0, 0),
            "size": size,
        }
    return {"type": engine.mjtGeom.mjGEOM_SPHERE, "pos": (far, 0, 0), "size": size}


def _ignore_warning(_: str) -> None:
    """Ignores a warning of MuJoCo: ``valid`` of the readings says whether they can be believed."""
