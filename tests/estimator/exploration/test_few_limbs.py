"""Programs of robots with many legs move few of them at a time, as long as much is open."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.morphology import Base
from estimator.exploration.few_limbs import limbs_of, moved_motors
from estimator.posterior.model.unknowns import Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem

BASE = Base(size=(0.24, 0.12, 0.06), mass=0.8)


def genome_of(name: str) -> Genome:
    problem = Problem.load(name)
    mounts = problem.tables.base_mounts(BASE.size)
    return Genome(problem, Base(size=BASE.size, mass=BASE.mass, mounts=mounts))


def moved_legs(moved: Flags) -> Flags:
    """Which of the six legs of a hexapod of two or three joints each program moves."""
    legs: Flags = np.any(moved.reshape(len(moved), -1, 6), axis=1)
    return legs


@pytest.mark.parametrize(("name", "joints"), [("hexapod-12", 2), ("hexapod-18", 3)])
def test_limbs_are_chains_from_the_tip_to_the_main_body(name: str, joints: int) -> None:
    genome = genome_of(name)
    limbs = limbs_of(Unknowns(genome))
    assert len(limbs.motors) == 6
    for leg, (motors, choices) in enumerate(zip(limbs.motors, limbs.choices, strict=True)):
        assert sorted(motors.tolist()) == [leg + 6 * row for row in range(joints)]
        parts = [genome.genes[column].part for column in choices.tolist()]
        traits = [genome.genes[column].trait for column in choices.tolist()]
        assert sorted(set(parts)) == sorted(motors.tolist())
        assert sorted(traits) == ["hinge"] * joints + ["mount"] * joints


@pytest.mark.parametrize("name", ["parametric", "topological"])
def test_where_little_is_open_from_the_beginning_all_limbs_move(name: str) -> None:
    genome, rng = genome_of(name), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    decided = genome.choices(rng.random((200, genome.size)))
    assert moved_motors((20, 4), limbs, decided, 0, rng).all()


@pytest.mark.parametrize(("name", "driven"), [("topological-20", 4), ("topological-24", 8)])
def test_parts_that_may_sit_on_each_other_are_moved_one_or_two_at_a_time(
    name: str, driven: int
) -> None:
    genome, rng = genome_of(name), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    assert [motors.tolist() for motors in limbs.motors] == [[part] for part in range(driven)]
    for part, choices in enumerate(limbs.choices):
        assert {genome.genes[column].part for column in choices.tolist()} == {part}
    decided = genome.choices(rng.random((200, genome.size)))
    few = moved_motors((300, driven), limbs, decided, 0, rng)
    assert set(np.count_nonzero(few, axis=1).tolist()) <= {1, 2}
    assert np.all(np.count_nonzero(few, axis=0) > 0)  # every part has its interaction


def test_few_legs_move_while_all_is_open_and_all_once_it_is_known() -> None:
    genome, rng = genome_of("hexapod-12"), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    samples = rng.random((200, genome.size))
    few = moved_motors((300, 12), limbs, genome.choices(samples), 0, rng)
    assert set(moved_legs(few).sum(axis=1).tolist()) <= {2, 3}
    assert np.all(moved_legs(few).mean(axis=0) > 0.25)  # every leg has its interaction
    together = few.reshape(300, 2, 6)
    assert np.array_equal(together[:, 0], together[:, 1])  # both joints of a leg
    known = np.tile(samples[:1], (200, 1))
    assert moved_motors((300, 12), limbs, genome.choices(known), 12, rng).all()
    legs = np.concatenate(limbs.choices[:3])
    half = samples.copy()
    half[:, legs] = samples[0, legs]
    some = moved_motors((300, 12), limbs, genome.choices(half), 0, rng)
    assert moved_legs(some)[:, :3].mean() > moved_legs(few)[:, :3].mean()


def test_parts_that_samples_agree_on_too_soon_stay_among_the_few() -> None:
    genome, rng = genome_of("topological-24"), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    agreed = genome.choices(np.tile(rng.random((1, genome.size)), (200, 1)))
    most = [
        np.count_nonzero(moved_motors((300, 8), limbs, agreed, interactions, rng), axis=1).max()
        for interactions in range(10)
    ]
    assert most == sorted(most)
    assert most[0] == 1
    assert most[6] < 8  # readings cannot have informed about all parts
    assert most[9] == 8
