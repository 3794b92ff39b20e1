"""What a posterior is over: attachments are choices that may be felt."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.conftest import BODY


@pytest.mark.parametrize(("part", "felt"), [(1, True), (4, True), (5, False), (8, False)])
def test_hinges_of_locked_parts_are_no_attachments(part: int, felt: bool) -> None:
    genome = Genome(Problem.load("topological-20"), BODY)
    unknowns = Unknowns(genome)
    (column,) = (at for at, one in enumerate(genome.genes) if one.name == f"hinge of part {part}")
    rng = np.random.default_rng(part)
    points = rng.random((20, unknowns.size))
    turned = points.copy()
    turned[:, column] = np.mod(points[:, column] + 0.5, 1.0)
    alike = [one == other for one, other in zip(*map(unknowns.keys, (points, turned)), strict=True)]
    assert alike == [not felt] * 20
    assert (column in unknowns.choices) == felt
    predictor = Predictor(unknowns, StaticsPhysics())
    programs = rng.uniform(-0.5, 0.5, (5, 8))
    one, other = (predictor.read_all(some, programs).tilt for some in (points, turned))
    assert np.array_equal(one, other) == (not felt)


def test_large_deviations_are_those_of_the_best_body_and_small_ones_means() -> None:
    problem = Problem.load("topological")
    unknowns = Unknowns(Genome(problem, BODY), problem.table)
    names = [row.name for row in problem.table]
    zero, jammed, dead = map(
        names.index, ("zero of leg 1", "servo of leg 1 jammed", "servo of leg 2 dead")
    )
    values = unknowns.as_stated(np.full((4, unknowns.genes_size), 0.5))
    own = values[:, unknowns.genes_size :]
    own[:, zero] = 0.01, 0.02, 0.03, 0.04
    own[:, jammed] = 0.2, 0.2, -0.2, -0.2  # on opposite hinges
    own[1:, dead] = 1.0
    mean = unknowns.mean_deviations(values, values[2])
    assert mean[[zero, jammed, dead]] == pytest.approx([0.025, -0.2, 1.0])
    assert np.count_nonzero(mean) == 3
    assert not np.any(unknowns.mean_deviations(values, values[0])[dead])
    weighed = unknowns.mean_deviations(values, values[2], np.array([0.7, 0.1, 0.1, 0.1]))
    assert weighed[[zero, jammed, dead]] == pytest.approx([0.016, -0.2, 1.0])


def test_bodies_differ_by_their_attachments_or_by_lengths_that_samples_have_not() -> None:
    problem = Problem.load("topological")
    unknowns = Unknowns(Genome(problem, BODY), problem.table)
    known = unknowns.as_stated(np.full((200, unknowns.genes_size), 0.5))
    wide, narrow = unknowns.continuous[:2]
    known[:, wide] += np.random.default_rng(0).normal(0.0, 0.05, len(known))
    points = known[:1].repeat(7, axis=0)
    points[:, wide] = 0.5
    points[1, unknowns.choices[0]] = 0.01
    points[2, wide], points[3, wide] = 0.58, 0.62
    points[4, narrow], points[5, narrow] = 0.51, 0.53
    points[6, unknowns.genes_size :] = 1.0  # deviations make no other body
    assert np.flatnonzero(unknowns.differ(points, known)).tolist() == [1, 3, 5]
