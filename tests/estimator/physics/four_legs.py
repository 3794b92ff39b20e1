"""Bodies on four equal legs, and random ones with random motor programs."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.body.mounts import BaseMount
from estimator.physics.base import Pair, Physics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import PredictedReadings
from tests.estimator.kinematics import part_frames

MakeBody = Callable[[np.random.Generator], Morphology]
BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
BELLY = 0.085 / 2
RIGHT_ANGLE = math.radians(90)


def legs(
    *lengths: float,
    radius: float = 0.006,
    pieces: int = 1,
    hinge: int = 2,
    density: float = 1000.0,
) -> Morphology:
    """Four straight legs, each of one or two rigid pieces; the last piece feels touch.

    Args:
        *lengths: Of each leg, m; or one for all of them.
        radius: Of all pieces, m.
        pieces: Of a leg.
        hinge: On the main body.
        density: Of all pieces, kg/m³.
    """
    upper = [
        Part(
            parent=BASE,
            mount=leg,
            hinge=hinge,
            length=length / pieces,
            radius=radius,
            motor=leg,
            sensor=leg if pieces == 1 else None,
        )
        for leg, length in enumerate(lengths * (4 // len(lengths)))
    ]
    lower = [
        replace(part, parent=part.mount, mount=1, motor=None, sensor=part.mount) for part in upper
    ]
    parts = tuple(upper) if pieces == 1 else (*upper, *lower)
    return Morphology(base=BODY, parts=parts, density=density)


def read_one(physics: Physics, body: Morphology, *angles: float) -> PredictedReadings:
    return physics.read([(body, np.array(angles))])


def random_pairs(make: MakeBody, count: int, seed: int, motors: int = 8) -> list[Pair]:
    rng = np.random.default_rng(seed)
    pairs = []
    for _ in range(count):
        program = np.zeros(8)
        program[:motors] = np.radians(rng.uniform(-30, 30, motors))
        pairs.append((make(rng), program))
    return pairs


def assert_links_where_kinematics_says(
    physics: PyBulletPhysics, body: Morphology, angles: Array
) -> None:
    """PyBullet's links, at given angles of the motors, stand as ``part_frames`` says."""
    engine, client = physics._engine, physics._client
    turned = body.part_angles(angles)
    number = physics._build(body)
    for link, angle in enumerate(turned):
        engine.resetJointState(number, link, angle, physicsClientId=client)
    base, _ = engine.getBasePositionAndOrientation(number, physicsClientId=client)
    states = engine.getLinkStates(
        number, range(len(turned)), computeForwardKinematics=True, physicsClientId=client
    )
    origins, rotations = part_frames(body, angles)
    for link, state in enumerate(states):
        matrix = np.reshape(engine.getMatrixFromQuaternion(state[5]), (3, 3))
        assert np.array(state[4]) - base == pytest.approx(origins[link], abs=1e-5)
        assert matrix == pytest.approx(rotations[link], abs=1e-5)


PLATE = (0.14, 0.02)  # width and height, m
STILT = 0.08  # m


def plate(turn: float = 0.0) -> Morphology:
    """A round plate with a leg on its rim, which lifts; all turned about the plate's axis, rad."""
    width, height = PLATE
    at = (width / 2 * math.cos(turn), width / 2 * math.sin(turn), 0.0)
    base = Base(
        size=(width, width, height),
        mass=1.0,
        mounts=(BaseMount(name="rim", at=at, yaw=turn),),
        round=True,
    )
    leg = Part(parent=BASE, mount=0, hinge=2, length=STILT, radius=0.006, motor=0, sensor=0)
    return Morphology(base=base, parts=(leg,), density=1000.0)


def plate_lean() -> tuple[float, float]:
    """How far the plate leans on its leg, straight down, rad, and its clearance, m.

    A sphere at the leg's end and the rim opposite touch the ground.
    """
    (width, height), radius = PLATE, 0.006
    rise = STILT - radius - height / 2
    lean = math.atan2(rise, width) + math.asin(radius / math.hypot(width, rise))
    return lean, width / 2 * math.tan(lean)
