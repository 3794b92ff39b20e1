"""Genomes, kinematics, PyBullet and the scorer's reading of URDF agree on random trees."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.body.mounts import HINGES, SIDES
from estimator.evaluation.truth.body import true_limbs
from estimator.physics.pybullet import PyBulletPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.kinematics import part_frames
from tests.estimator.physics.four_legs import assert_links_where_kinematics_says
from tests.estimator.urdf_bodies import write_urdf

BODY = Base(size=(0.16, 0.12, 0.06), mass=1.0)
NAMES = [f"joint_{row}" for row in range(8)]


def of_genome(problem: str) -> Callable[[np.random.Generator], Morphology]:
    genome = Genome(Problem.load(problem), BODY)
    return lambda rng: genome.decode(rng.random(genome.size))


def chain(rng: np.random.Generator) -> Morphology:
    """Each part on the one before it, as deep as a tree of eight can be."""
    parts = [
        Part(
            parent=row - 1,
            mount=int(rng.integers(len(SIDES))),
            hinge=int(rng.integers(len(HINGES))),
            length=float(rng.uniform(0.02, 0.2)),
            radius=0.006,
            motor=row,
        )
        for row in range(8)
    ]
    return Morphology(base=BODY, parts=tuple(parts), density=1000.0)


def all_hinges(rng: np.random.Generator) -> Morphology:
    """Each kind of hinge on the main body and again on a part."""
    parts = [
        Part(
            parent=BASE if row < 2 else row % 2,
            mount=int(rng.integers(len(SIDES))),
            hinge=row % len(HINGES),
            length=float(rng.uniform(0.02, 0.2)),
            radius=0.013,
            motor=row,
        )
        for row in range(8)
    ]
    return Morphology(base=BODY, parts=tuple(parts), density=1000.0)


MAKERS = {
    "topological": of_genome("topological"),
    "topological-20": of_genome("topological-20"),
    "topological-24": of_genome("topological-24"),
    "chain": chain,
    "all hinges": all_hinges,
}
KINDS = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


@pytest.fixture(scope="module")
def own() -> Iterator[PyBulletPhysics]:
    """An engine whose world these tests may leave in disorder."""
    with PyBulletPhysics() as engine:
        yield engine


@KINDS
def test_pybullet_puts_every_part_where_our_kinematics_do(
    own: PyBulletPhysics, make: Callable[[np.random.Generator], Morphology]
) -> None:
    rng = np.random.default_rng(11)
    for _ in range(25):
        assert_links_where_kinematics_says(own, make(rng), rng.uniform(-np.pi, np.pi, 8))


@KINDS
def test_a_urdf_of_the_same_tree_moves_the_same_and_reads_back(
    own: PyBulletPhysics, tmp_path: Path, make: Callable[[np.random.Generator], Morphology]
) -> None:
    engine, client = own._engine, own._client
    rng = np.random.default_rng(12)
    for number in range(15):
        body = make(rng)
        rows = len(body.parts)
        file = tmp_path / f"{number}.urdf"  # PyBullet remembers files by name
        path = write_urdf(file, body, NAMES[:rows])
        limbs = true_limbs(path, {name: row for row, name in enumerate(NAMES[:rows])})
        for part, read_back in zip(body.parts, limbs, strict=True):
            assert read_back.limb.parent == part.parent
            assert (read_back.mount, read_back.hinge) == (part.mount, part.hinge)
            assert read_back.limb.length == pytest.approx(part.length)
            assert not read_back.not_representable

        angles = rng.uniform(-3, 3, 8)
        moving = replace(
            body, parts=tuple(replace(part, motor=row) for row, part in enumerate(body.parts))
        )
        origins, rotations = part_frames(moving, angles)
        tree = engine.loadURDF(str(path), physicsClientId=client)
        joints = [engine.getJointInfo(tree, index, physicsClientId=client) for index in range(rows)]
        order = [NAMES.index(joint[1].decode()) for joint in joints]
        for index, row in enumerate(order):
            engine.resetJointState(tree, index, angles[row], physicsClientId=client)
        for index, row in enumerate(order):
            state = engine.getLinkState(
                tree, index, computeForwardKinematics=True, physicsClientId=client
            )
            matrix = np.reshape(engine.getMatrixFromQuaternion(state[5]), (3, 3))
            assert np.array(state[4]) == pytest.approx(origins[row], abs=1e-5)
            assert matrix == pytest.approx(rotations[row], abs=1e-5)


def standing(problem: str) -> tuple[Genome, Array]:
    """Genes of a body whose parts can all be felt: legs that reach the ground, on every side."""
    loaded = Problem.load(problem)
    genome = Genome(loaded, Base(size=(0.14, 0.14, 0.03), mass=0.5))
    lower = len(loaded.parts) // 2 if len(loaded.parts) > 4 else len(loaded.parts)
    genes = np.empty(genome.size)
    for index, gene in enumerate(genome.genes):
        row = gene.part
        if gene.trait == "parent":
            choice = 0 if row < lower else row - lower + 1
            genes[index] = (choice + 0.5) / gene.choices
        elif gene.trait == "mount":
            genes[index] = ((row if row < lower else 1) + 0.5) / gene.choices
        elif gene.trait == "hinge":
            genes[index] = 2.5 / gene.choices
        else:
            genes[index] = 0.5
    return genome, genes


@pytest.mark.parametrize("name", ["topological", "topological-20", "topological-24"])
def test_every_gene_that_can_be_felt_changes_some_reading(
    physics: PyBulletPhysics, name: str
) -> None:
    genome, genes = standing(name)
    problem = Problem.load(name)
    rng = np.random.default_rng(5)
    programs = []
    for _ in range(6):
        program = np.zeros(8)
        driven = list(problem.motors.driven)
        program[driven] = np.radians(rng.uniform(-30, 0, len(driven)))  # so that all legs touch
        programs.append(program)

    def readings(values: Array) -> Array:
        at_rest = physics.read([(genome.decode(values), program) for program in programs])
        return np.column_stack([at_rest.tilt, at_rest.clearance])

    before = readings(genes)
    for index, gene in enumerate(genome.genes):
        changed = genes.copy()
        changed[index] = (genes[index] + (1 / gene.choices if gene.choices else 0.2)) % 1
        felt = bool(np.abs(readings(changed) - before).max() > 1e-4)
        locked = problem.parts[gene.part].motor is None and gene.trait == "hinge"
        assert felt == (gene.choices != 1 and not locked), gene
