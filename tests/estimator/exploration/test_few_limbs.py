"""Programs of robots with many legs move few of them at a time, as long as much is open."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.morphology import Array, Base
from estimator.exploration.few_limbs import limbs_of, with_few_limbs
from estimator.posterior.model.unknowns import Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem

BASE = Base(size=(0.24, 0.12, 0.06), mass=0.8)


def genome_of(name: str) -> Genome:
    problem = Problem.load(name)
    mounts = problem.tables.base_mounts(BASE.size)
    return Genome(problem, Base(size=BASE.size, mass=BASE.mass, mounts=mounts))


def moved(programs: Array) -> Flags:
    """Which of the six legs of a hexapod of two or three joints each program moves."""
    legs: Flags = np.any(programs.reshape(len(programs), -1, 6) != 0, axis=1)
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
    programs = rng.uniform(0.1, 0.5, (20, 4))
    decided = genome.choices(rng.random((200, genome.size)))
    assert with_few_limbs(programs, limbs, decided, 0, rng) is programs


@pytest.mark.parametrize(("name", "driven"), [("topological-20", 4), ("topological-24", 8)])
def test_parts_that_may_sit_on_each_other_are_moved_one_or_two_at_a_time(
    name: str, driven: int
) -> None:
    genome, rng = genome_of(name), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    assert [motors.tolist() for motors in limbs.motors] == [[part] for part in range(driven)]
    for part, choices in enumerate(limbs.choices):
        assert {genome.genes[column].part for column in choices.tolist()} == {part}
    programs = rng.uniform(0.1, 0.5, (300, driven))
    decided = genome.choices(rng.random((200, genome.size)))
    few = with_few_limbs(programs, limbs, decided, 0, rng)
    assert set(np.count_nonzero(few, axis=1).tolist()) <= {1, 2}
    assert np.all(np.count_nonzero(few, axis=0) > 0)  # every part has its interaction


def test_few_legs_move_while_all_is_open_and_all_once_it_is_known() -> None:
    genome, rng = genome_of("hexapod-12"), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    programs = rng.uniform(0.1, 0.5, (300, 12))
    samples = rng.random((200, genome.size))
    few = with_few_limbs(programs, limbs, genome.choices(samples), 0, rng)
    assert set(moved(few).sum(axis=1).tolist()) <= {2, 3}
    assert np.all(moved(few).mean(axis=0) > 0.25)  # every leg has its interaction
    assert np.all((few == 0) | (few == programs))
    together = few.reshape(300, 2, 6) != 0
    assert np.array_equal(together[:, 0], together[:, 1])  # both joints of a leg
    known = np.tile(samples[:1], (200, 1))
    assert with_few_limbs(programs, limbs, genome.choices(known), 12, rng) is programs
    legs = np.concatenate(limbs.choices[:3])
    half = samples.copy()
    half[:, legs] = samples[0, legs]
    some = with_few_limbs(programs, limbs, genome.choices(half), 0, rng)
    assert moved(some)[:, :3].mean() > moved(few)[:, :3].mean()


def test_parts_that_samples_agree_on_too_soon_stay_among_the_few() -> None:
    genome, rng = genome_of("topological-24"), np.random.default_rng(1)
    limbs = limbs_of(Unknowns(genome))
    programs = rng.uniform(0.1, 0.5, (300, 8))
    agreed = genome.choices(np.tile(rng.random((1, genome.size)), (200, 1)))
    most = [
        np.count_nonzero(with_few_limbs(programs, limbs, agreed, interactions, rng), axis=1).max()
        for interactions in range(10)
    ]
    assert most == sorted(most)
    assert most[0] == 1
    assert most[6] < 8  # readings cannot have informed about all parts
    assert most[9] == 8
