"""Bodies simulated in MuJoCo, an independent engine, in the same world as in PyBullet.

Settings of MuJoCo that matter:

* Joints are position actuators whose targets move at the slew speed. They are stiff enough to hold
  a tenth of a degree; what misses its target is no valid reading, as for PyBullet. Their damping
  makes them follow within two steps, which is as stiff as a step allows.
* ``boundinertia`` is the floor under the inertia of every link, ``WorldSettings.inertia_floor``.
* MuJoCo's contacts are soft. With these a body of any mass sinks in by 0.01 mm.
* The friction of a pair is the larger one, so body and ground both have the pair's coefficient.
* Parts touch the ground alone, not each other.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from estimator.body.morphology import (
    BASE,
    HINGE_AXES,
    SIDE_YAWS,
    Array,
    Morphology,
    Part,
    attachment,
)
from estimator.errors import PhysicsError
from estimator.physics.base import BackEnd, Pair, Readings, WorldSettings, sensor_count

_STIFFNESS: Final = 5000.0  # N·m/rad
_SOFTNESS: Final = 6.0  # time constant of a contact, in steps; with less, bodies rock for seconds
_IMPEDANCE: Final = "0.95 0.99 0.001"
_SHORTEST: Final = 1e-6  # m; a capsule whose centres are closer is a sphere


class MuJoCoPhysics(BackEnd):
    """Simulates each interaction from the planar pose with ``mujoco.rollout``; see ``Physics``.

    Args:
        settings: The world.

    Raises:
        PhysicsError: MuJoCo is not installed.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self._settings = settings or WorldSettings()
        try:
            self._engine: Any = importlib.import_module("mujoco")
            self._rollout: Any = importlib.import_module("mujoco.rollout").rollout
        except ImportError as error:
            raise PhysicsError(
                f"MuJoCo cannot be imported ({error}): pip install 'bodyschema[dev]'"
            ) from error

    def close(self) -> None:
        """Does nothing: no engine is kept between batches."""

    def read(self, pairs: Sequence[Pair]) -> Readings:
        """Simulates one interaction per pair; see ``Physics.read``."""
        readings = Readings.empty(len(pairs), sensor_count(pairs))
        for row, (body, program) in enumerate(pairs):
            self._read_one(body, program, readings, row)
        self.simulations += len(pairs)
        self.steps += len(pairs) * self._settings.steps
        return readings

    def _read_one(self, body: Morphology, program: Array, readings: Readings, row: int) -> None:
        engine, settings = self._engine, self._settings
        try:
            model = engine.MjModel.from_xml_string(mjcf(body, settings))
        except ValueError as error:
            raise PhysicsError(f"MuJoCo cannot build a body: {error}") from error
        data = engine.MjData(model)
        start = np.empty(engine.mj_stateSize(model, engine.mjtState.mjSTATE_FULLPHYSICS))
        engine.mj_getState(model, data, start, engine.mjtState.mjSTATE_FULLPHYSICS)
        targets = np.array(
            [
                angle
                for angle, part in zip(body.part_angles(program), body.parts, strict=True)
                if part.motor is not None
            ]
        )
        turned = settings.slew * settings.step * np.arange(1, settings.steps + 1)[:, None]
        control = np.clip(targets, -turned, turned)
        if targets.size:
            self._rollout(model, data, start[None], control[None], chunk_size=1)
        else:
            self._rollout(model, data, start[None], nstep=settings.steps, chunk_size=1)
        engine.mj_forward(model, data)
        # MuJoCo sorts joints and bodies depth first; actuators stay in the order written
        places = [
            int(model.joint(f"j{index}").qposadr[0])
            for index, part in enumerate(body.parts)
            if part.motor is not None
        ]
        misses = np.abs(data.qpos[places] - targets)
        if not (np.all(np.isfinite(data.qpos)) and np.all(np.isfinite(data.qvel))):
            readings.joint_miss[row] = math.inf
            return  # it flew apart; the row stays invalid
        links = [model.body(f"p{index}").id for index in range(len(body.parts))]
        _sense(body, data, links, settings=settings, readings=readings, row=row)
        readings.joint_miss[row] = misses.max(initial=0.0)
        readings.valid[row] = readings.joint_miss[row] <= settings.joint_tolerance


def _sense(
    body: Morphology,
    data: Any,
    links: Sequence[int],
    *,
    settings: WorldSettings,
    readings: Readings,
    row: int,
) -> None:
    """Fills one row of the readings, except for the joints, from the bodies' present poses."""
    readings.speed[row] = np.linalg.norm(data.qvel[:3])
    gaps = []
    for number, part in zip(links, body.parts, strict=True):
        height, climb = data.xpos[number, 2], data.xmat[number].reshape(3, 3)[2, 0]
        lowest = min(climb * part.near_centre, climb * part.far_centre)
        gaps.append(height + lowest - part.radius)
    readings.fill_row(
        row,
        body,
        settings,
        height=data.xpos[1, 2],
        up=data.xmat[1].reshape(3, 3)[2],
        gaps=gaps,
    )


def mjcf(body: Morphology, settings: WorldSettings) -> str:
    """A body on the ground, in MuJoCo's format, in the planar pose.

    Part i is the body ``p{i}``, and where it moves its joint is ``j{i}``; the actuators come in the
    parts' order.
    """
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(
        root, "compiler", angle="radian", boundinertia=repr(settings.inertia_floor(body))
    )
    ElementTree.SubElement(
        root,
        "option",
        timestep=repr(settings.step),
        integrator="implicitfast",
        cone="elliptic",
    )
    default = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(
        default,
        "geom",
        friction=f"{settings.friction} 0 0",
        solref=f"{_SOFTNESS * settings.step} 1",
        solimp=_IMPEDANCE,
        contype="0",
        conaffinity="1",
    )
    world = ElementTree.SubElement(root, "worldbody")
    ElementTree.SubElement(world, "geom", type="plane", size="0 0 1", contype="1", conaffinity="0")
    height = max([body.base.size[2] / 2, *(part.radius for part in body.parts)])
    main = ElementTree.SubElement(world, "body", pos=f"0 0 {height!r}")
    ElementTree.SubElement(main, "freejoint")
    ElementTree.SubElement(
        main,
        "geom",
        type="box",
        size=_numbers(extent / 2 for extent in body.base.size),
        mass=repr(body.base.mass),
    )
    actuators = ElementTree.SubElement(root, "actuator")
    _add_parts(body, BASE, main)
    for index, part in enumerate(body.parts):
        if part.motor is not None:
            ElementTree.SubElement(
                actuators,
                "position",
                joint=f"j{index}",
                kp=repr(_STIFFNESS),
                kv=repr(2 * _STIFFNESS * settings.step),
            )
    return ElementTree.tostring(root, encoding="unicode")


def _add_parts(body: Morphology, parent: int, carrier: ElementTree.Element) -> None:
    for index, part in enumerate(body.parts):
        if part.parent == parent:
            on = None if parent == BASE else body.parts[parent]
            yaw = SIDE_YAWS[part.side]
            element = ElementTree.SubElement(
                carrier,
                "body",
                name=f"p{index}",
                pos=_numbers(attachment(body.base, on, part.side)),
                quat=_numbers((math.cos(yaw / 2), 0, 0, math.sin(yaw / 2))),
            )
            if part.motor is not None:
                ElementTree.SubElement(
                    element, "joint", name=f"j{index}", axis=_numbers(HINGE_AXES[part.hinge])
                )
            _add_shape(part, float(body.masses[index]), element)
            _add_parts(body, index, element)


def _add_shape(part: Part, mass: float, element: ElementTree.Element) -> None:
    near, far = part.near_centre, part.far_centre
    if far - near > _SHORTEST:
        shape = {"type": "capsule", "fromto": _numbers((near, 0, 0, far, 0, 0))}
    else:
        shape = {"type": "sphere", "pos": _numbers((far, 0, 0))}
    ElementTree.SubElement(element, "geom", shape, size=repr(part.radius), mass=repr(mass))


def _numbers(values: Iterator[float] | Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
