"""Where parts may not share a mount, no method ever puts two of them on one."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from estimator.identification.paper.fit import Modeller
from estimator.identification.paper.objectives import LargestError
from estimator.identification.paper.search import DeterministicCrowding
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.discovery.moves import propose
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.operators import Operators
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from estimator.storage.records import Counters
from tests.estimator.problem.test_tables import HEAD, PART, genome_of

THREE = (
    HEAD.replace("[1, 2, 3, 4]", "[1, 2, 3]")
    + '[[mounts]]\nname = "tail"\nat = [-0.05, 0, 0]\nyaw_deg = 180\n'
    + "".join(
        PART.format(name=name, motor=motor).replace('parent = "unknown"', "parent = 0")
        for motor, name in enumerate("abc", 1)
    )
)
FELT = Observation(angles=(0.3, -0.4, 0.1), tilt=(0.1, 0.05), clearance=0.02)


@pytest.fixture
def genome() -> Genome:
    return genome_of(Problem.parse(THREE, "three.toml"))


def test_parts_change_places_evenly(genome: Genome) -> None:
    """The proposals are symmetric: all six orders of three parts come equally often."""
    unknowns, rng = Unknowns(genome), np.random.default_rng(4)
    mounts = [column for column, gene in enumerate(genome.genes) if gene.trait == "mount"]
    values = unknowns.permitted(rng.random((600, unknowns.size)))
    rows = np.arange(600)
    orders: Counter[tuple[int, ...]] = Counter()
    for step in range(120):
        partners = rng.permuted(np.tile(rows, (2, 1)), axis=1).T
        fresh = propose(values, rows, partners, unknowns, rng)
        allowed = ~unknowns.forbidden(fresh)
        values[allowed] = fresh[allowed]
        if step >= 60 and step % 10 == 0:
            orders.update(map(tuple, genome.choices(values)[:, mounts].tolist()))
    assert len(orders) == 6
    assert min(orders.values()) > 0.85 * sum(orders.values()) / 6


def test_a_population_starts_on_permitted_places(genome: Genome, statics: StaticsPhysics) -> None:
    predictor = Predictor(Unknowns(genome), statics)
    population = Population.of_prior(
        predictor, np.random.default_rng(5), levels=3, chains_per_level=8
    )
    assert not genome.forbidden(population.values).any()


def test_the_search_breeds_no_doubles(genome: Genome) -> None:
    rng = np.random.default_rng(6)
    operators = Operators(permit=genome.permitted)
    search = DeterministicCrowding(40, genome.size, rng, operators=operators)
    for _ in range(10):
        asked = search.ask()
        assert not genome.forbidden(asked).any()
        search.tell(rng.random(len(asked)))


def test_a_forbidden_model_is_not_simulated_and_loses(
    genome: Genome, statics: StaticsPhysics
) -> None:
    genes = np.random.default_rng(7).random((30, genome.size))
    forbidden = genome.forbidden(genes)
    assert 0 < forbidden.sum() < 30
    before = statics.simulations
    search = DeterministicCrowding(30, genome.size, np.random.default_rng(8), population=genes)
    modeller = Modeller(genome, statics, ["tilt"], Counters(), objective=LargestError())
    modeller.evolve(search, [FELT])
    assert np.array_equal(np.isinf(search.errors), forbidden)
    assert statics.simulations - before == 30 - forbidden.sum()
