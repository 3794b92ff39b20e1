import numpy as np
import pytest

from estimator.posterior.chains.moves import exchange_parts, propose, reflected
from estimator.posterior.model.unknowns import Unknowns


def test_values_are_folded_back_at_both_ends() -> None:
    assert reflected(np.array([-0.25, 0.5, 1.25, 2.25, -1.5])) == pytest.approx(
        [0.25, 0.5, 0.75, 0.25, 0.5]
    )


def test_proposals_leave_the_prior_as_it_is(unknowns: Unknowns) -> None:
    from scipy import stats  # takes a second, which other tests need not wait for

    rng = np.random.default_rng(1)
    count = 4000
    values = rng.random((count, unknowns.size))
    movers, still = np.arange(0, count, 2), np.arange(1, count, 2)
    for _ in range(20):  # symmetric proposals from a uniform distribution give a uniform one
        partners = rng.permuted(np.tile(still, (2, 1)), axis=1).T
        values[movers] = propose(values, movers, partners, unknowns, rng)
    for column in range(unknowns.size):
        assert stats.kstest(values[movers, column], "uniform").pvalue > 1e-4


def test_proposals_change_what_they_say(unknowns: Unknowns) -> None:
    rng = np.random.default_rng(2)
    values = rng.random((400, unknowns.size))
    rows = np.arange(0, 400, 2)
    partners = np.stack([np.arange(1, 400, 2), np.roll(np.arange(1, 400, 2), 1)], axis=1)
    fresh = propose(values, rows, partners, unknowns, rng)
    assert fresh.shape == (200, unknowns.size)
    assert np.all((fresh >= 0) & (fresh <= 1))
    moved = fresh != values[rows]
    assert moved.any(axis=1).mean() > 0.99
    assert moved[:, unknowns.choices].any(axis=0).all()
    assert moved[:, unknowns.continuous].any(axis=0).all()


def test_parts_are_exchanged_whole(unknowns: Unknowns) -> None:
    rng = np.random.default_rng(3)
    one, other = rng.random((50, unknowns.size)), rng.random((50, unknowns.size))
    first, second = exchange_parts(one, other, unknowns, rng)
    for row in range(50):
        exchanged = [
            index
            for index, columns in enumerate(unknowns.parts)
            if np.array_equal(first[row, columns], other[row, columns])
            and np.array_equal(second[row, columns], one[row, columns])
        ]
        assert len(exchanged) == 1
        kept = np.setdiff1d(np.arange(unknowns.size), unknowns.parts[exchanged[0]])
        assert np.array_equal(first[row, kept], one[row, kept])
        assert np.array_equal(second[row, kept], other[row, kept])
