"""Whether a sensor can tell depends on the lengths that a sample has itself."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.equivalence import Reference
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.indistinguishable import (
    indistinguishable_points,
    indistinguishable_shares,
    probability_of,
)
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Mode
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.conftest import BODY
from tests.estimator.two_unknown_rows import (
    MODALITIES,
    POINT,
    TWO_UNKNOWN_ROWS,
    equally_likely,
    programs,
)

MOUNT, HINGE, LENGTH = 0, 1, 2  # of leg 1
MOVEMENTS = programs(300, seed=7)


def turned(points: Array) -> Array:
    """The same bodies with another hinge of leg 1."""
    changed = points.copy()
    changed[:, HINGE] = np.where(points[:, HINGE] < 0.5, 0.9, 0.1)
    return changed


def test_pairs_are_compared_as_a_reference_compares(predictor: Predictor) -> None:
    rng = np.random.default_rng(3)
    ones = rng.random((40, POINT.size))
    ones[::2, LENGTH] *= 0.15  # most of them reach no ground
    others = turned(ones)
    same = indistinguishable_points(predictor, MOVEMENTS, MODALITIES, ones, others)
    unknowns = predictor.unknowns
    expected = [
        Reference(one, MOVEMENTS, StaticsPhysics(), MODALITIES).is_like(other)
        for one, other in zip(unknowns.decode_all(ones), unknowns.decode_all(others), strict=True)
    ]
    assert 5 < same.sum() < 35
    assert np.mean(same == expected) > 0.95  # a reference leaves out what says nothing, too
    assert indistinguishable_points(predictor, MOVEMENTS, MODALITIES, ones, ones).all()


def test_a_mode_is_alike_as_far_as_its_legs_are_short(predictor: Predictor) -> None:
    unknowns = predictor.unknowns
    values = np.tile(POINT, (8, 1))
    values[:, LENGTH] = [0.5, 0.5, 0, 0, 0, 0, 0.6, 0.6]
    values[2:] = turned(values[2:])
    first, second = unknowns.keys(values[[0, 2]])
    bare = values[3].copy()  # a body that no sample stands for
    bare[MOUNT] = 0.9
    (third,) = unknowns.keys(bare[None])
    modes = (
        Mode(first, 0.6, values[0], 50.0, (True,)),
        Mode(second, 0.3, values[7], 50.0, (True,)),
        Mode(third, 0.1, bare, 50.0, (True,)),
    )
    weights = np.array([0.3, 0.3, 0.08, 0.08, 0.08, 0.06, 0.05, 0.05])
    posterior = replace(equally_likely(values, POINT), weights=weights, modes=modes)
    alike = partial(indistinguishable_points, predictor, MOVEMENTS, MODALITIES)
    shares = indistinguishable_shares(modes, posterior, predictor, alike)
    assert shares[:2] == pytest.approx([1.0, 0.75])
    there = values[0].copy()
    there[LENGTH] = bare[LENGTH]
    assert shares[2] == alike(there[None], bare[None])[0]
    assert indistinguishable_shares(modes[:1], posterior, predictor, alike) == pytest.approx([1.0])


def test_attachments_are_as_probable_as_the_samples_that_feel_like_them(
    predictor: Predictor,
) -> None:
    values = np.tile(POINT, (8, 1))
    values[:, LENGTH] = np.linspace(0.1, 0.9, 8)
    values[6:] = turned(values[6:])
    posterior = equally_likely(values, values[-1])

    def never(ones: Array, others: Array) -> Flags:
        np.testing.assert_array_equal(turned(ones), others)
        return np.zeros(len(ones), dtype=bool)

    def always(ones: Array, others: Array) -> Flags:
        return ~never(ones, others)

    assert probability_of(POINT, posterior, predictor, never) == pytest.approx(6 / 8)
    assert probability_of(POINT, posterior, predictor, always) == pytest.approx(1.0)


def test_what_is_otherwise_than_stated_is_otherwise_of_both() -> None:
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    unknowns = Unknowns(Genome(problem, BODY), problem.table)
    built = Predictor(unknowns, StaticsPhysics())
    values = unknowns.as_stated(np.tile(POINT, (8, 1)))
    narrow = np.array([row.narrow for row in problem.table])
    rng = np.random.default_rng(4)
    values[1:, unknowns.genes_size :] = narrow * rng.standard_normal((7, len(narrow)))
    values[:, LENGTH] = 0.0  # reaches no ground
    values[4:] = turned(values[4:])
    first, second = unknowns.keys(values[[0, 4]])
    modes = (Mode(first, 0.5, values[0], 9.0, (True,)), Mode(second, 0.5, values[4], 9.0, (True,)))
    posterior = replace(equally_likely(values, values[0]), modes=modes)
    alike = partial(indistinguishable_points, built, MOVEMENTS, MODALITIES)
    assert indistinguishable_shares(modes, posterior, built, alike).tolist() == [1.0, 1.0]
    assert probability_of(values[0], posterior, built, alike) == pytest.approx(1.0)


def test_attachments_that_a_dead_servo_hides_are_not_taken_for_the_same() -> None:
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    unknowns = Unknowns(Genome(problem, BODY), problem.table)
    built = Predictor(unknowns, StaticsPhysics())
    names = [row.name for row in problem.table]
    dead = unknowns.as_stated(np.tile(POINT, (4, 1)))
    dead[:, unknowns.genes_size + names.index("servo of leg 1 dead")] = 1.0
    others = turned(dead)
    readings = [built.read_all(points[:1], MOVEMENTS) for points in (dead, others)]
    np.testing.assert_allclose(readings[0].tilt, readings[1].tilt, atol=1e-9)
    alike = partial(indistinguishable_points, built, MOVEMENTS, MODALITIES)
    assert alike(dead, dead).all()
    assert not alike(dead, others).any()
    half = equally_likely(np.vstack([dead, others]), dead[0])
    assert probability_of(dead[0], half, built, alike) == pytest.approx(0.5)
