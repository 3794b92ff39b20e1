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
