"""Bodies simulated in PyBullet, as in the paper, in this process.

Settings of PyBullet that matter:

* ``URDF_MAINTAIN_LINK_ORDER``, or ``createMultiBody`` reorders links and joint j is no longer
  part j.
* Every link gets a local inertia of at least ``WorldSettings.inertia_floor``. With the true inertia
  of light parts the solver misses joint angles by whole degrees, and a missed angle biases every
  length. With too much of it momentum carries bodies into other poses than the true ones.
* Position and velocity gain 1 with ample force: with the default gains a loaded joint never
  reaches its target.
* Every body is built anew: restoring a saved state is not repeatable to the bit, but removing a
  body and building the next one beside the same ground is (a test holds it to that), and saves a
  tenth of the time. PyBullet never frees the removed bodies' shapes, so that now and then the whole
  world is made anew.
* Most bodies rest after a quarter of the steps, and are read there: of 1,000 random bodies of each
  kind every one then read the same as after all steps, within 0.05° and 0.2 mm. ``full_steps``
  is the reference.
* Coefficients of friction multiply: the ground has 1, so that the parts' coefficient is the pair's.

Gaps to the ground are computed from the links' poses, not taken from ``getContactPoints``, which
lists near misses and may leave out an end of a capsule.
"""

from __future__ import annotations

import importlib
import math
import operator
from collections.abc import Iterator, Sequence
from typing import Any, Final

from estimator.body.morphology import Morphology, Part, box_inertia
from estimator.errors import PhysicsError
from estimator.physics.base import GRAVITY, Pair, Physics, WorldSettings, sensor_count
from estimator.physics.rest import MainBody, RestWatch, fill_row
from estimator.readings.observation import PredictedReadings
from protocol.system.missing_library import install_command
from protocol.system.process import native_output_discarded
from protocol.wire.readings import up_in_body

_FORCE: Final = 1e4  # N·m: the paper's motors are sufficiently strong
_MOST_PARTS: Final = 100  # PyBullet has room for 128 joint commands at a time, the base's included
_ALONG_X: Final = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))  # turns capsules from z to x
_UPRIGHT: Final = (0.0, 0.0, 0.0, 1.0)  # no turn; quaternions are x, y, z, w

_BODIES_PER_WORLD: Final = 200  # built before the world is made anew; not tuned


class PyBulletPhysics(Physics):
    """Simulates each interaction from the planar pose, and reads the body at the last step.

    Args:
        settings: Settings of the world.

    Raises:
        PhysicsError: PyBullet is not installed or does not start.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self._settings = settings or WorldSettings()
        self._bodies = 0  # how many were built in the present world
        self._body = -1  # the engine's number of the last one, which is still there
        self._client = -1
        with native_output_discarded():
            try:
                self._engine: Any = importlib.import_module("pybullet")
            except ImportError as error:
                raise PhysicsError(
                    f"PyBullet cannot be imported ({error}): {install_command('estimator')} "
                    "brings it to Python 3.11 on Linux (x86-64); take --physics mujoco elsewhere"
                ) from error
            self._client = self._engine.connect(self._engine.DIRECT)
        if self._client < 0:
            raise PhysicsError("PyBullet did not start: too many engines in one process?")

    def close(self) -> None:
        """Ends the engine; may be called twice."""
        if self._client >= 0:
            self._engine.disconnect(physicsClientId=self._client)
            self._client = -1

    def start_afresh(self) -> None:
        """Builds the next body in a new world, as if the engine had just been started."""
        self._bodies = 0

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair; see ``Physics.read``."""
        if self._client < 0:
            raise PhysicsError("this PyBullet engine was closed: make a new one")
        readings = PredictedReadings.empty(len(pairs), sensor_count(pairs))
        for row, (morphology, program) in enumerate(pairs):
            if len(morphology.parts) > _MOST_PARTS:
                raise PhysicsError(
                    f"PyBullet simulates bodies of at most {_MOST_PARTS} parts, not "
                    f"{len(morphology.parts)}"
                )
            angles = morphology.part_angles(program)
            if not all(math.isfinite(angle) for angle in angles):
                raise PhysicsError(f"a motor program must be finite, not {list(program)}")
            self.simulations += 1
            try:
                body = self._build(morphology)
                if not morphology.lies_flat:
                    self._turn(body, morphology, [0.0] * len(angles))
                self._turn(body, morphology, angles)
                self._sense(body, morphology, angles, readings, row)
            except self._engine.error as error:
                if not self._engine.isConnected(physicsClientId=self._client):
                    raise PhysicsError(f"PyBullet is gone: {error}") from error
                self.start_afresh()  # what is left in the world is not known
                readings.valid[row] = False
                readings.joint_miss[row] = math.inf
        return readings

    def _build(self, morphology: Morphology) -> int:
        """Builds a body in the planar pose, alone on the ground; returns its engine number."""
        engine, client, settings = self._engine, self._client, self._settings
        if self._bodies % _BODIES_PER_WORLD == 0:
            self._make_world()
        else:
            engine.removeBody(self._body, physicsClientId=client)
        self._bodies += 1
        base, parts = morphology.base, morphology.parts
        form: dict[str, Any] = {
            "shapeType": engine.GEOM_BOX,
            "halfExtents": [extent / 2 for extent in base.size],
        }
        if base.round:
            form = {
                "shapeType": engine.GEOM_CYLINDER,
                "radius": base.radius,
                "height": base.size[2],
            }
        shape = engine.createCollisionShape(**form, physicsClientId=client)
        self._body = engine.createMultiBody(
            base.mass,
            shape,
            -1,
            (0.0, 0.0, morphology.planar_height),
            _UPRIGHT,
            baseInertialFramePosition=base.centre,
            linkMasses=morphology.masses.tolist(),
            linkCollisionShapeIndices=[self._shape(part) for part in parts],
            linkVisualShapeIndices=[-1] * len(parts),
            linkPositions=[morphology.place(index) for index in range(len(parts))],
            linkOrientations=[
                (x, y, z, w)
                for w, x, y, z in (
                    morphology.mount(index).quaternion for index in range(len(parts))
                )
            ],
            linkInertialFramePositions=[(part.middle, 0.0, 0.0) for part in parts],
            linkInertialFrameOrientations=[_UPRIGHT] * len(parts),
            linkParentIndices=[part.parent + 1 for part in parts],
            linkJointTypes=[
                engine.JOINT_FIXED if part.motor is None else engine.JOINT_REVOLUTE
                for part in parts
            ],
            linkJointAxis=[morphology.hinge(index).axis for index in range(len(parts))],
            flags=engine.URDF_MAINTAIN_LINK_ORDER,
            physicsClientId=client,
        )
        if base.round:  # without this its rim would be rounded
            engine.changeDynamics(self._body, -1, collisionMargin=0.0, physicsClientId=client)
        floor = settings.inertia_floor(morphology)
        for link, inertia in enumerate(_inertias(morphology), start=-1):
            engine.changeDynamics(
                self._body,
                link,
                lateralFriction=settings.friction,
                localInertiaDiagonal=[max(moment, floor) for moment in inertia],
                physicsClientId=client,
            )
        return self._body

    def _make_world(self) -> None:
        engine, client = self._engine, self._client
        engine.resetSimulation(physicsClientId=client)
        engine.setGravity(0, 0, -GRAVITY, physicsClientId=client)
        engine.setPhysicsEngineParameter(fixedTimeStep=self._settings.step, physicsClientId=client)
        plane = engine.createCollisionShape(engine.GEOM_PLANE, physicsClientId=client)
        ground = engine.createMultiBody(0, plane, physicsClientId=client)
        engine.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)

    def _shape(self, part: Part) -> int:
        engine, client = self._engine, self._client
        middle, straight = (part.middle, 0.0, 0.0), part.far - part.near
        if part.shape == "box":
            shape: int = engine.createCollisionShape(
                engine.GEOM_BOX,
                halfExtents=[extent / 2 for extent in part.size],
                collisionFramePosition=middle,
                physicsClientId=client,
            )
        elif straight > 0:
            shape = engine.createCollisionShape(
                engine.GEOM_CAPSULE,
                radius=part.radius,
                height=straight,
                collisionFramePosition=middle,
                collisionFrameOrientation=_ALONG_X,
                physicsClientId=client,
            )
        else:
            shape = engine.createCollisionShape(
                engine.GEOM_SPHERE,
                radius=part.radius,
                collisionFramePosition=middle,
                physicsClientId=client,
            )
        return shape

    def _turn(self, body: int, morphology: Morphology, angles: Sequence[float]) -> None:
        """Turns the joints to their targets, and steps until the body rests or steps run out."""
        engine, client, settings = self._engine, self._client, self._settings
        for link, (part, angle) in enumerate(zip(morphology.parts, angles, strict=True)):
            if part.motor is not None:
                engine.setJointMotorControl2(
                    body,
                    link,
                    engine.POSITION_CONTROL,
                    targetPosition=angle,
                    positionGain=1.0,
                    velocityGain=1.0,
                    force=_FORCE,
                    maxVelocity=settings.slew,
                    physicsClientId=client,
                )
        slewing = max(map(abs, angles), default=0.0) / (settings.slew * settings.step)
        unwatched = settings.steps if settings.full_steps else slewing + 3
        watch, steps_done = RestWatch(settings), 0
        while steps_done < settings.steps and not watch.rests:
            engine.stepSimulation(physicsClientId=client)
            steps_done += 1
            if steps_done > unwatched and steps_done % watch.STEPS_PER_LOOK == 0:
                watch.look(self._main_body(body))
        self.steps += steps_done

    def _main_body(self, body: int) -> MainBody:
        engine, client = self._engine, self._client
        position, (x, y, z, w) = engine.getBasePositionAndOrientation(body, physicsClientId=client)
        velocity, spin = engine.getBaseVelocity(body, physicsClientId=client)
        return MainBody(velocity, spin, position[2], up_in_body((x, y, z, w)))

    def _sense(
        self,
        body: int,
        morphology: Morphology,
        angles: Sequence[float],
        readings: PredictedReadings,
        row: int,
    ) -> None:
        """Fills one row of the readings from the body's present pose."""
        engine, client, settings = self._engine, self._client, self._settings
        position, (x, y, z, w) = engine.getBasePositionAndOrientation(body, physicsClientId=client)
        velocity, _ = engine.getBaseVelocity(body, physicsClientId=client)
        links = range(len(morphology.parts))
        joints = engine.getJointStates(body, links, physicsClientId=client) if links else ()
        misses = [
            abs(joint[0] - angle)
            for joint, angle, part in zip(joints, angles, morphology.parts, strict=True)
            if part.motor is not None
        ]
        if not all(map(math.isfinite, (*position, x, y, z, w, *velocity, *misses))):
            readings.joint_miss[row] = math.inf
            return  # it flew apart; the row stays invalid
        readings.speed[row] = math.hypot(*velocity)
        readings.joint_miss[row] = max(misses, default=0.0)
        readings.valid[row] = readings.joint_miss[row] <= settings.joint_tolerance
        up = up_in_body((x, y, z, w))
        # PyBullet tells where the centre of mass is.
        centre_rise = sum(map(operator.mul, up, morphology.base.centre))
        fill_row(
            readings,
            row,
            morphology,
            settings,
            height=position[2] - centre_rise,
            up=up,
            gaps=self._gaps(body, morphology) if links else (),
        )

    def _gaps(self, body: int, morphology: Morphology) -> list[float]:
        """Distance of each part's lowest point from the ground, m; negative when it sinks in."""
        states = self._engine.getLinkStates(
            body,
            range(len(morphology.parts)),
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        gaps = []
        for part, state in zip(morphology.parts, states, strict=True):
            height, up = state[4][2], up_in_body(state[5])
            lowest = min(up[0] * part.near, up[0] * part.far)
            gaps.append(height + lowest - part.below(up))
        return gaps


def _inertias(morphology: Morphology) -> Iterator[tuple[float, float, float]]:
    """Moments of inertia about the centre of mass: the main body's, then each part's, kg·m²."""
    yield morphology.base.inertia
    for part, weight in zip(morphology.parts, morphology.masses.tolist(), strict=True):
        if part.shape == "box":
            yield box_inertia(part.size, weight)
            continue
        across = weight * (3 * part.radius**2 + part.size[0] ** 2) / 12
        yield weight * part.radius**2 / 2, across, across
