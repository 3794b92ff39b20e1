"""What is only roughly known: priors, bodies from genes, and sentences for what cannot be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimator.body.arrays import Bodies
from estimator.body.morphology import BASE, Array, Base
from estimator.errors import ProblemError
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem

OPEN = """
[nuisance]
density = [500.0, 2000.0]
centre_of_mass_mm = 10.0
accelerometer_deg = 2.0
joint_zero_deg = 1.0
"""
MAIN = Base(size=(0.16, 0.1, 0.05), mass=0.5)
COUNT = 1 + 3 + 2 + 4


def genome(section: str = OPEN) -> Genome:
    return Genome(Problem.parse(Problem.load("parametric").source + section, "mine.toml"), MAIN)


def points(genes: Genome, **shares: float) -> Array:
    """The middle of the prior, but for parameters whose names hold a word."""
    values = np.full((1, genes.size), 0.5)
    for word, share in shares.items():
        columns = [word in gene.name for gene in genes.genes]
        assert any(columns)
        values[0, columns] = share
    return values


def test_they_are_genes_of_the_main_body_behind_those_of_the_parts() -> None:
    genes = genome().genes
    assert [gene.trait == "nuisance" for gene in genes] == [False] * 8 + [True] * COUNT
    assert {gene.part for gene in genes[8:]} == {BASE}
    assert [gene.unit for gene in genes[8:]] == ["kg/m³", *["mm"] * 3, *["deg"] * 6]
    assert [gene.name for gene in genome("[nuisance]\ndensity = [1.0, 2.0]").genes[8:]] == [
        "density of the parts"
    ]


def test_the_middle_of_the_prior_is_the_robot_as_it_was_meant() -> None:
    (body,) = genome().decode_all(points(genome()))
    assert body.density == pytest.approx(1000)
    assert body.base == MAIN
    assert {part.zero for part in body.parts} == {0.0}


def test_a_share_of_a_normal_prior_is_its_quantile() -> None:
    open_one = genome()
    shares = np.array([0.0, 0.025, 0.5, 0.975, 1.0])
    zeros = open_one.quantities(open_one.size - 1, shares)
    assert zeros[1:4] == pytest.approx([-1.96, 0.0, 1.96], abs=0.001)
    assert np.all(np.isfinite(zeros))
    density = open_one.quantities(8, shares)
    assert density[[0, 2, 4]] == pytest.approx([500, 1000, 2000])


def test_objects_and_arrays_are_the_same_bodies() -> None:
    values = np.random.default_rng(1).random((20, genome().size))
    arrays, objects = genome().bodies(values), Bodies.of(genome().decode_all(values))
    assert np.array_equal(arrays.zero, objects.zero)
    assert np.array_equal(arrays.base, objects.base)
    assert np.all(arrays.zero[:, :4] != 0)
    assert not arrays.zero[:, 4:].any()  # locked knees


def test_only_an_open_accelerometer_is_read_lying_flat() -> None:
    def reads_flat_first(section: str) -> bool:
        source = Problem.load("parametric").source
        return Problem.parse(source + section, "mine.toml").reads_flat_first

    assert reads_flat_first(OPEN)
    assert not reads_flat_first("[nuisance]\njoint_zero_deg = 1.0")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("density = 1000.0", "nuisance.density: must be [lowest, highest]"),
        ("density = [0.1, 10.0]", "nuisance.density: must be [lowest, highest] within 1 to 25000"),
        (
            "joint_zero_deg = -1.0",
            "nuisance.joint_zero_deg: must lie in 0.01 to 10 degrees, not -1",
        ),
        ("joint_zero_deg = 30.0", "nuisance.joint_zero_deg: must lie in 0.01 to 10 degrees"),
        ("centre_of_mass_mm = inf", "nuisance.centre_of_mass_mm: must be finite, not inf"),
        ("mass = 1.0", "nuisance.mass: is no key of a problem file"),
    ],
)
def test_what_cannot_be_is_a_sentence(line: str, sentence: str) -> None:
    with pytest.raises(ProblemError) as caught:
        genome(f"[nuisance]\n{line}")
    assert f"mine.toml: {sentence}" in str(caught.value)


def test_an_accelerometer_turned_on_a_level_body_reads_its_own_turn() -> None:
    values = points(genome(), accelerometer=0.975)
    (body,) = genome().decode_all(values)
    assert [math.degrees(turn) for turn in body.base.accelerometer] == pytest.approx(
        [3.92, 3.92], abs=0.01
    )
