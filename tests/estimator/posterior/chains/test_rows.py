"""Every other row of a part is tried; parts that may not share mounts change places."""

from __future__ import annotations

from collections import Counter

import numpy as np

from estimator.posterior.chains.rows import exchange_places, other_attachments
from estimator.posterior.model.unknowns import Unknowns
from estimator.problem.genome import Genome
from tests.estimator.exploration.test_few_limbs import genome_of


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
