"""Crossover and mutation keep genes in [0, 1] and favour no end of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.problem.operators import (
    BlendCrossover,
    Crossover,
    GaussianMutation,
    Mutation,
    ResetMutation,
    UniformCrossover,
    euclidean,
    reflect,
)

CROSSOVERS = [UniformCrossover(), BlendCrossover(alpha=0.5), BlendCrossover(alpha=3.0)]
MUTATIONS = [GaussianMutation(rate=1.0, sigma=0.05), GaussianMutation(sigma=9.0), ResetMutation()]


@given(st.floats(-1e6, 1e6))
def test_reflection_stays_inside(value: float) -> None:
    assert 0 <= reflect(np.array([value]))[0] <= 1


@pytest.mark.parametrize(
    ("outside", "inside"), [(-0.25, 0.25), (1.25, 0.75), (0.5, 0.5), (1.0, 1.0), (0.0, 0.0)]
)
def test_reflection_is_a_mirror(outside: float, inside: float) -> None:
    assert reflect(np.array([outside]))[0] == pytest.approx(inside)


@pytest.mark.parametrize("crossover", CROSSOVERS)
def test_crossover_keeps_the_interval_and_depends_on_the_generator_alone(
    crossover: Crossover,
) -> None:
    first, second = np.random.default_rng(0).random((2, 50, 8))
    once = crossover(first, second, np.random.default_rng(1))
    again = crossover(first, second, np.random.default_rng(1))
    assert np.array_equal(once, again)
    assert np.min(once) >= 0
    assert np.max(once) <= 1
    assert not np.array_equal(once[0], first)


@pytest.mark.parametrize("crossover", [UniformCrossover(rate=0.0), BlendCrossover(rate=0.0)])
def test_without_crossover_children_are_their_parents(crossover: Crossover) -> None:
    first, second = np.random.default_rng(0).random((2, 50, 8))
    one, two = crossover(first, second, np.random.default_rng(1))
    assert np.array_equal(one, first)
    assert np.array_equal(two, second)


def test_uniform_crossover_only_exchanges() -> None:
    first, second = np.random.default_rng(0).random((2, 50, 8))
    one, two = UniformCrossover()(first, second, np.random.default_rng(1))
    assert one + two == pytest.approx(first + second)
    assert np.mean(one == first) == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("crossover", CROSSOVERS)
def test_equal_parents_have_equal_children(crossover: Crossover) -> None:
    genes = np.random.default_rng(0).random((50, 8))
    one, two = crossover(genes, genes, np.random.default_rng(1))
    assert one == pytest.approx(genes)
    assert two == pytest.approx(genes)


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_mutation_favours_no_length(mutation: Mutation) -> None:
    rng = np.random.default_rng(0)
    genes = rng.random((2000, 10))
    for _ in range(5):
        genes = mutation(genes, rng)
    shares = np.histogram(genes, bins=10, range=(0, 1))[0] / genes.size
    assert shares == pytest.approx(np.full(10, 0.1), abs=0.01)


@pytest.mark.parametrize("mutation", [GaussianMutation(), ResetMutation()])
def test_one_gene_per_child_changes_on_average(mutation: Mutation) -> None:
    genes = np.random.default_rng(0).random((2000, 8))
    changed = mutation(genes, np.random.default_rng(1)) != genes
    assert changed.sum(axis=1).mean() == pytest.approx(1.0, abs=0.1)


def test_distance_is_euclids() -> None:
    assert euclidean(np.array([[0.0, 0.0]]), np.array([[0.3, 0.4]])) == pytest.approx([0.5])
