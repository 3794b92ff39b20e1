"""PyBullet against our own kinematics and against geometry that can be done by hand."""

import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.body.morphology import BASE, Part
from estimator.errors import PhysicsError
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import PredictedReadings
from tests.estimator.physics.four_legs import (
    BELLY,
    MakeBody,
    assert_links_where_kinematics_says,
    legs,
    random_pairs,
    read_one,
)


def test_kinematics_agree_link_by_link(physics: PyBulletPhysics, random_tree: MakeBody) -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        body = random_tree(rng)
        assert_links_where_kinematics_says(physics, body, rng.uniform(-np.pi, np.pi, 8))


def sense(physics: PyBulletPhysics, height: float, turn: list[float]) -> PredictedReadings:
    """Reads a body that hangs in the air, turned by a quaternion (x, y, z, w)."""
    body, angles = legs(0.1), [0.0] * 4
    number, engine = physics._build(body), physics._engine
    place = {"physicsClientId": physics._client}
    engine.resetBasePositionAndOrientation(number, [0.3, -0.2, height], turn, **place)
    readings = PredictedReadings.empty(1, 4)
    physics._sense(number, body, angles, readings, 0)
    return readings


@pytest.mark.parametrize("seed", range(10))
def test_sensors_follow_their_definitions(physics: PyBulletPhysics, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    x, y, z, w = turn
    rows = physics._engine.getMatrixFromQuaternion(turn.tolist())
    to_world = np.reshape(rows, (3, 3))
    up = to_world.T @ [0, 0, 1]  # world up, seen from the body
    felt = sense(physics, 0.12, [x, y, z, w])
    assert np.sin(felt.tilt[0]) == pytest.approx([up[1], up[0]], abs=1e-6)
    belly, normal = [0, 0, 0.12] + to_world @ [0, 0, -BELLY], to_world @ [0, 0, -1]
    away = -belly[2] / normal[2] if normal[2] else math.inf
    assert felt.clearance[0] == pytest.approx(away if 0 <= away < 0.2 else 0.2, abs=1e-6)


def test_an_upside_down_body_sees_no_ground(physics: PyBulletPhysics) -> None:
    felt = sense(physics, 0.12, [1.0, 0.0, 0.0, 0.0])
    assert felt.clearance[0] == pytest.approx(0.2)
    assert felt.saturated[0]


def test_a_body_that_flies_apart_is_invalid(physics: PyBulletPhysics) -> None:
    body, angles = legs(0.1), [0.0] * 4
    number, engine = physics._build(body), physics._engine
    engine.resetBaseVelocity(number, [math.nan] * 3, physicsClientId=physics._client)
    readings = PredictedReadings.empty(1, 4)
    physics._sense(number, body, angles, readings, 0)
    assert not readings.valid[0]
    assert readings.joint_miss[0] == math.inf


class Moody:
    """PyBullet that now and then refuses a call."""

    def __init__(self, engine: Any, call: str, moods: Iterator[bool]):
        self._engine, self._call, self._moods = engine, call, moods

    def __getattr__(self, name: str) -> Any:
        if name == self._call and next(self._moods, False):
            raise self._engine.error("not today")
        return getattr(self._engine, name)


@pytest.mark.parametrize("call", ["createMultiBody", "stepSimulation", "getLinkStates"])
def test_a_body_that_the_engine_refuses_is_invalid_and_costs_no_other(
    random_tree: MakeBody, call: str
) -> None:
    pairs = random_pairs(random_tree, 3, seed=6)
    with PyBulletPhysics() as physics:
        expected = physics.read(pairs)
        physics._engine = Moody(physics._engine, call, iter([True]))
        felt = physics.read(pairs)
        assert felt.valid.tolist() == [False, True, True]
        assert felt.joint_miss[0] == math.inf
        assert np.array_equal(felt.tilt[1:], expected.tilt[1:])
        assert physics.simulations == 6


def test_an_engine_that_is_gone_is_an_error() -> None:
    with PyBulletPhysics() as physics:
        physics._engine.disconnect(physicsClientId=physics._client)
        with pytest.raises(PhysicsError, match="PyBullet is gone: Not connected"):
            read_one(physics, legs(0.1), 0, 0, 0, 0)
        physics._client = -1


def test_the_least_inertia_is_no_more_than_needed(
    physics: PyBulletPhysics, random_quadruped: MakeBody
) -> None:
    """It grows with weight, reach and step; a tenth of it is not enough."""
    coarse, fine = WorldSettings(), WorldSettings(step=1 / 240)
    body = legs(0.1)
    heavy = replace(body, base=replace(body.base, mass=2 * body.mass - body.masses.sum()))
    floor = coarse.inertia_floor(body)
    assert coarse.inertia_floor(heavy) == pytest.approx(2 * floor)
    assert fine.inertia_floor(body) == pytest.approx(floor / 16)
    pairs = random_pairs(random_quadruped, 40, seed=3, motors=4)
    with PyBulletPhysics(replace(coarse, least_inertia=coarse.least_inertia / 10)) as light:
        assert not light.read(pairs).valid.all()


def test_too_many_parts_and_a_closed_engine_are_refused(physics: PyBulletPhysics) -> None:
    crowded = replace(
        legs(0.1), parts=(Part(parent=BASE, mount=0, hinge=0, length=1, radius=1),) * 101
    )
    with pytest.raises(PhysicsError, match="at most 100 parts, not 101"):
        read_one(physics, crowded)
    closed = PyBulletPhysics()
    closed.close()
    closed.close()
    with pytest.raises(PhysicsError, match="closed"):
        closed.read([])


def test_pybullets_chatter_stays_out_of_our_output() -> None:
    program = """
import numpy as np
from estimator.body.morphology import Base, Morphology
from estimator.physics.pybullet import PyBulletPhysics
body = Morphology(base=Base(size=(0.1, 0.1, 0.1), mass=1.0), parts=(), density=1.0)
with PyBulletPhysics() as physics:
    physics.read([(body, np.zeros(0))])
print("ours")
"""
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
    )
    assert printed.stdout == "ours\n"
    assert printed.stderr == ""


def test_a_body_reads_the_same_in_a_used_world(random_tree: MakeBody) -> None:
    pairs = random_pairs(random_tree, 40, seed=22)
    with PyBulletPhysics() as used:
        used.read(pairs)
        again = used.read(pairs[::-1])
    for row, pair in enumerate(pairs[::-1]):
        if row % 8 == 0:
            with PyBulletPhysics() as fresh:
                alone = fresh.read([pair])
            assert alone.tilt.tobytes() == again.tilt[row : row + 1].tobytes()
            assert alone.clearance.tobytes() == again.clearance[row : row + 1].tobytes()
