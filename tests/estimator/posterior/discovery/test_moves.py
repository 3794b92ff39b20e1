"""Every other row of a part is tried; parts that may not share mounts change places."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from estimator.posterior.discovery.moves import (
    exchange_parts,
    exchange_places,
    other_attachments,
    propose,
    reflected,
)
from estimator.posterior.model.unknowns import Unknowns
from estimator.problem.genome import Genome
from tests.estimator.exploration.test_few_limbs import genome_of


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
            for index, columns in unknowns.parts.items()
            if np.array_equal(first[row, columns], other[row, columns])
            and np.array_equal(second[row, columns], one[row, columns])
        ]
        assert len(exchanged) == 1
        kept = np.setdiff1d(np.arange(unknowns.size), unknowns.parts[exchanged[0]])
        assert np.array_equal(first[row, kept], one[row, kept])
        assert np.array_equal(second[row, kept], other[row, kept])


def column(genome: Genome, part: int, trait: str) -> int:
    (found,) = (
        index
        for index, gene in enumerate(genome.genes)
        if gene.part == part and gene.trait == trait
    )
    return found


def test_a_part_with_a_known_parent_is_tried_on_every_mount_with_every_hinge() -> None:
    genome, rng = genome_of("hexapod-12"), np.random.default_rng(2)
    unknowns = Unknowns(genome)
    leader = unknowns.permitted(rng.random((1, unknowns.size)))[0]
    for part, mounts, hinges in ((0, 6, 4), (5, 6, 4), (8, 3, 4)):
        points = other_attachments(leader, unknowns.parts[part], unknowns, rng)
        assert not unknowns.forbidden(points).any()
        decided = unknowns.decided(points)
        own = [column(genome, part, trait) for trait in ("mount", "hinge")]
        tried = Counter(map(tuple, decided[:, own].tolist()))
        assert len(tried) == mounts * hinges
        assert len(set(tried.values())) == 1
        length = points[:, column(genome, part, "length")]
        assert len(np.unique(length)) == len(length)


def test_who_sat_there_goes_to_where_the_newcomer_was() -> None:
    genome, rng = genome_of("hexapod-12"), np.random.default_rng(3)
    unknowns = Unknowns(genome)
    before = unknowns.permitted(rng.random((50, unknowns.size)))
    mounts = [column(genome, part, "mount") for part in range(6)]
    after = before.copy()
    after[:, mounts[4]] = before[:, mounts[1]]
    exchange_places(after, before, unknowns)
    assert np.array_equal(after[:, mounts[1]], before[:, mounts[4]])
    assert np.array_equal(after[:, mounts[4]], before[:, mounts[1]])
    rest = np.setdiff1d(np.arange(unknowns.size), [mounts[1], mounts[4]])
    assert np.array_equal(after[:, rest], before[:, rest])


def test_where_parents_are_unknown_rows_are_random() -> None:
    genome, rng = genome_of("topological"), np.random.default_rng(4)
    unknowns = Unknowns(genome)
    leader = rng.random(unknowns.size)
    points = other_attachments(leader, unknowns.parts[3], unknowns, rng)
    others = np.setdiff1d(np.arange(unknowns.size), unknowns.parts[3])
    assert np.all(points[:, others] == leader[others])
    assert len(np.unique(unknowns.decided(points)[:, unknowns.parts[3]], axis=0)) > 90
