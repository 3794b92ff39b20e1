"""Mounts anywhere and hinges aslant: both back-ends move and rest as forward kinematics says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.arrays import Bodies
from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.body.mounts import PartMount
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from tests.estimator.conftest import MakeBody
from tests.estimator.kinematics import part_frames
from tests.estimator.physics.four_legs import assert_links_where_kinematics_says
from tests.estimator.physics.test_statics_wild import assert_rests


@pytest.fixture
def pybullet() -> Iterator[PyBulletPhysics]:
    with PyBulletPhysics() as physics:
        yield physics


def test_statics_rests_where_the_parts_are(
    statics: StaticsPhysics, random_tree_of_own_tables: MakeBody
) -> None:
    rng = np.random.default_rng(8)
    for _ in range(100):
        body = random_tree_of_own_tables(rng)
        program = rng.uniform(-2, 2, 8)
        felt = statics.read([(body, program)])
        assert felt.valid[0]
        assert_rests(body, program, felt)


def test_bodies_of_several_tables_are_read_together(
    statics: StaticsPhysics, random_tree: MakeBody, random_tree_of_own_tables: MakeBody
) -> None:
    rng = np.random.default_rng(9)
    bodies = [make(rng) for make in (random_tree, random_tree_of_own_tables) for _ in range(5)]
    program = rng.uniform(-0.5, 0.5, 8)
    together = statics.read([(body, program) for body in bodies])
    for row, body in enumerate(bodies):
        alone = statics.read([(body, program)])
        assert alone.tilt[0].tolist() == together.tilt[row].tolist()
    assert len(Bodies.of([bodies[0]] * 3).hinges) == 6


def test_pybullet_builds_what_forward_kinematics_says(
    pybullet: PyBulletPhysics, random_tree_of_own_tables: MakeBody
) -> None:
    rng = np.random.default_rng(10)
    for _ in range(30):
        body = random_tree_of_own_tables(rng)
        assert_links_where_kinematics_says(pybullet, body, rng.uniform(-np.pi, np.pi, 8))


def test_the_engines_agree(
    statics: StaticsPhysics, pybullet: PyBulletPhysics, random_tree_of_own_tables: MakeBody
) -> None:
    rng = np.random.default_rng(11)
    pairs = [(random_tree_of_own_tables(rng), rng.uniform(-0.5, 0.5, 8)) for _ in range(40)]
    by_statics, simulated = statics.read(pairs), pybullet.read(pairs)
    sure = statics.path_margins(pairs) > np.radians(1)
    away = np.degrees(np.abs(by_statics.tilt - simulated.tilt).max(axis=1))
    assert sure.sum() > 10
    assert np.mean(away[sure & simulated.valid] < 0.5) > 0.9


def test_a_knee_that_is_fixed_at_an_angle_touches_as_one_that_is_held_there(
    statics: StaticsPhysics,
) -> None:
    """It is lower than both ends of a leg that goes down, then up."""
    leg = Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.01, motor=0)
    bent = PartMount(name="bent", fraction=1.0, yaw=0.0, elevation=1.2)
    fixed = Part(parent=0, mount=0, hinge=2, length=0.1, radius=0.01, sensor=0)
    base = Base(size=(0.14, 0.14, 0.085), mass=1.0)
    body = Morphology(base=base, parts=(leg, fixed), density=1000.0, part_mounts=(bent,))
    held = replace(body, parts=(leg, replace(fixed, motor=1)))
    program = np.radians([-60, 0])
    felt, expected = statics.read([(body, program)]), statics.read([(held, program)])
    assert expected.touch.all()
    assert felt.tilt == pytest.approx(expected.tilt, abs=1e-12)
    assert felt.touch.all()


def test_a_mount_below_the_belly_lifts_it(
    statics: StaticsPhysics, random_tree_of_own_tables: MakeBody
) -> None:
    body = random_tree_of_own_tables(np.random.default_rng(1))
    origins, turns = part_frames(body, np.zeros(8))
    lowest = [
        part.radius - (origin + along * turn[:, 0])[2]
        for part, origin, turn in zip(body.parts, origins, turns, strict=True)
        for along in (part.near, part.far)
    ]
    assert body.planar_height == pytest.approx(max(body.base.size[2] / 2, *lowest))
    assert WorldSettings().inertia_floor(body) > 0
    assert np.max(np.linalg.norm(origins, axis=1)) <= body.reach
