"""Deterministic crowding: its rules, its niches, and that it can be saved at any moment."""

import json
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from estimator.errors import SearchOrderError, SearchStateError
from estimator.identification.paper.search import DeterministicCrowding
from estimator.problem.operators import GaussianMutation, Operators, UniformCrossover

Array = NDArray[np.float64]


def sphere(genes: Array) -> Array:
    errors: Array = np.sum((genes - 0.3) ** 2, axis=1)
    return errors


def search(seed: int = 0, size: int = 20, genes: int = 3) -> DeterministicCrowding:
    return DeterministicCrowding(size, genes, np.random.default_rng(seed))


def evaluated(seed: int = 0, size: int = 20, genes: int = 3) -> DeterministicCrowding:
    crowd = search(seed, size, genes)
    crowd.tell(sphere(crowd.ask()))
    return crowd


def m1(x: Array) -> Array:
    """Five equal peaks, evenly spaced (Deb and Goldberg 1989)."""
    return np.asarray(np.sin(5 * np.pi * x) ** 6)


def m3(x: Array) -> Array:
    """Five equal peaks, unevenly spaced."""
    return np.asarray(np.sin(5 * np.pi * (x**0.75 - 0.05)) ** 6)


@pytest.mark.parametrize(
    ("function", "peaks"),
    [
        (m1, [0.1, 0.3, 0.5, 0.7, 0.9]),
        (m3, [(0.15 + 0.2 * k) ** (4 / 3) for k in range(5)]),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_all_five_peaks_are_kept(
    function: Callable[[Array], Array], peaks: list[float], seed: int
) -> None:
    crowd = search(seed, size=100, genes=1)
    for _ in range(201):
        crowd.tell(1 - function(crowd.ask()[:, 0]))
    for peak in peaks:
        near = np.abs(crowd.population[:, 0] - peak) < 0.02
        assert near.sum() >= 3
        assert function(crowd.population[near, 0]).max() > 0.999


def test_the_population_comes_first_then_children() -> None:
    crowd = search()
    assert np.array_equal(crowd.ask(), crowd.population)
    assert np.all(np.isinf(crowd.limits))
    crowd.tell(sphere(crowd.population))
    assert not np.array_equal(crowd.ask(), crowd.population)
    assert crowd.state()["generation"] == 0
    crowd.tell(np.full(20, np.inf))
    assert crowd.state()["generation"] == 1


def test_ask_and_tell_take_turns() -> None:
    crowd = search()
    for ahead_of_ask in (lambda: crowd.tell(np.zeros(20)), lambda: crowd.limits):
        with pytest.raises(SearchOrderError, match="call ask"):
            ahead_of_ask()
    with pytest.raises(SearchOrderError, match="errors are unknown"):
        _ = crowd.errors
    crowd.ask()
    with pytest.raises(SearchOrderError, match="twice"):
        crowd.ask()
    with pytest.raises(SearchOrderError, match="between ask"):
        crowd.forget_errors()


def test_only_a_strictly_better_child_replaces_its_rival() -> None:
    crowd = evaluated()
    before, errors = crowd.population, crowd.errors
    crowd.ask()
    crowd.tell(crowd.limits)  # every child is exactly as good as its rival
    assert np.array_equal(crowd.population, before)
    children, limits = crowd.ask(), crowd.limits
    crowd.tell(limits - 1e-12)
    assert sorted(map(tuple, crowd.population)) == sorted(map(tuple, children))
    assert np.sort(crowd.errors) == pytest.approx(np.sort(errors), abs=1e-11)


def test_every_member_has_exactly_one_rival() -> None:
    crowd = evaluated()
    for _ in range(20):
        crowd.ask()
        assert np.array_equal(np.sort(crowd.limits), np.sort(crowd.errors))
        crowd.tell(np.full(20, np.inf))


def test_a_child_competes_with_the_parent_that_it_resembles() -> None:
    parents = np.array([[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]])
    crowd = DeterministicCrowding(
        2,
        3,
        np.random.default_rng(0),
        operators=Operators(crossover=UniformCrossover(), mutation=GaussianMutation(rate=0.0)),
        population=parents,
    )
    crowd.tell(crowd.ask()[:, 0])  # the errors tell the parents apart: 0.1 and 0.9
    for _ in range(20):
        children = crowd.ask()
        nearer = np.where(np.sum(children, axis=1) < 1.5, 0.1, 0.9)
        assert np.array_equal(crowd.limits, nearer)
        crowd.tell(np.full(2, np.inf))


def test_nan_loses_and_anything_replaces_it() -> None:
    crowd = search()
    crowd.ask()
    crowd.tell(np.full(20, np.nan))
    assert np.all(np.isinf(crowd.errors))
    crowd.ask()
    crowd.tell(np.where(np.arange(20) < 10, 1.0, np.nan))
    assert np.sum(crowd.errors == 1.0) == 10


def test_an_evaluation_may_stop_at_its_limit() -> None:
    exact, hasty = evaluated(), evaluated()
    for _ in range(30):
        exact.tell(sphere(exact.ask()))
        errors = sphere(hasty.ask())
        hasty.tell(np.where(errors < hasty.limits, errors, hasty.limits))
    assert exact.state() == hasty.state()


def test_the_population_is_carried_over_when_errors_are_forgotten() -> None:
    crowd = evaluated()
    before = crowd.population
    crowd.forget_errors()
    assert np.array_equal(crowd.ask(), before)
    crowd.tell(np.arange(20.0))
    assert crowd.best == 0
    assert crowd.state()["generation"] == 0


@settings(max_examples=30)
@given(stop=st.integers(0, 12), pending=st.booleans())
def test_a_saved_search_goes_on_identically(stop: int, pending: bool) -> None:
    def advance(crowd: DeterministicCrowding, turns: range) -> DeterministicCrowding:
        for turn in turns:
            if turn == 6:
                crowd.forget_errors()
            errors = sphere(crowd.ask())
            errors[errors > 0.3] = np.inf
            crowd.tell(errors)
        return crowd

    straight = advance(search(), range(13))
    saved = advance(search(), range(stop))
    if pending and stop != 6:
        saved.ask()
    state = json.loads(json.dumps(saved.state(), allow_nan=False))
    resumed = advance(DeterministicCrowding.from_state(state), range(stop, 13))
    assert resumed.state() == straight.state()


def test_it_finds_a_minimum() -> None:
    crowd = search(size=60)
    for _ in range(60):
        crowd.tell(sphere(crowd.ask()))
    assert crowd.errors[crowd.best] < 1e-3


def test_impossible_searches_are_refused() -> None:
    for size in (0, 1, 7):
        with pytest.raises(SearchStateError, match=f"even and at least 2, not {size}"):
            search(size=size)
    with pytest.raises(SearchStateError, match="at least one gene"):
        search(genes=0)
    with pytest.raises(SearchStateError, match="PCG64"):
        DeterministicCrowding(2, 1, np.random.Generator(np.random.MT19937(0)))
    with pytest.raises(SearchStateError, match="shape"):
        DeterministicCrowding(2, 1, np.random.default_rng(0), population=np.zeros((2, 2)))
    with pytest.raises(SearchStateError, match="0 to 1"):
        DeterministicCrowding(2, 1, np.random.default_rng(0), population=np.full((2, 1), 2.0))


def test_impossible_errors_are_refused() -> None:
    crowd = search()
    crowd.ask()
    with pytest.raises(SearchStateError, match="20 errors, not an array of shape"):
        crowd.tell(np.zeros(19))
    with pytest.raises(SearchStateError, match="minus infinity"):
        crowd.tell(np.full(20, -np.inf))
    crowd.tell(np.zeros(20))


def test_damaged_states_are_refused() -> None:
    good = evaluated().state()
    for key in ("population", "errors", "random", "generation"):
        with pytest.raises(SearchStateError, match="damaged"):
            DeterministicCrowding.from_state({name: good[name] for name in good if name != key})
    for key, value in (("population", [1, 2]), ("errors", [1.0]), ("random", {})):
        with pytest.raises(SearchStateError, match="damaged"):
            DeterministicCrowding.from_state({**good, key: value})
