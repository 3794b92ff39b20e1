"""The code between genes and bodies."""

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base
from estimator.errors import MorphologyError, SearchStateError
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem

BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
PARAMETRIC = Genome(Problem.load("parametric"), BODY)

# Two known legs with one long range, then two parts about which everything is to be found.
_PART = """
[[parts]]
name = "{name}"
parent = {parent}
mount = {side}
hinge = {hinge}
length = {length}
radius = 0.006
"""
MIXED = Genome(
    Problem.parse(
        """
name = "mixed"
description = "some known, some not"
density = 1000.0
[motors]
driven = [1]
range_deg = [-30, 30]
slew_deg_per_s = 60.0
[search]
population = 10
generations = 1
interactions = 1
"""
        + _PART.format(name="a", parent=0, side='"back"', hinge='"down"', length=0.1)
        + "motor = 1\n"
        + _PART.format(name="b", parent=1, side='"front"', hinge='"unknown"', length="[0.1, 0.4]")
        + _PART.format(
            name="c",
            parent='"unknown"',
            side='"unknown"',
            hinge='"unknown"',
            length="[0.02, 0.4]",
        ),
        "mixed.toml",
    ),
    BODY,
)


def test_parametric_genes_are_lengths_from_1_to_20_cm() -> None:
    assert PARAMETRIC.size == 8
    assert PARAMETRIC.genes[4].name == "length of left lower"
    shortest, longest = PARAMETRIC.decode(np.zeros(8)), PARAMETRIC.decode(np.ones(8))
    assert [part.length for part in shortest.parts] == pytest.approx([0.01] * 8)
    assert [part.length for part in longest.parts] == pytest.approx([0.20] * 8)
    assert [part.parent for part in longest.parts] == [BASE] * 4 + [0, 1, 2, 3]
    assert [part.mount for part in longest.parts] == [0, 1, 2, 3, 1, 1, 1, 1]
    assert longest.base is BODY


def test_genes_follow_the_papers_rows() -> None:
    assert tuple(gene.name for gene in MIXED.genes) == (
        "hinge of b",
        "length of b",
        "parent of c",
        "mount of c",
        "hinge of c",
        "length of c",
    )


@pytest.mark.parametrize(("gene", "parent"), [(0.0, -1), (0.33, -1), (0.34, 0), (0.67, 1), (1, 1)])
def test_row_3_chooses_among_the_main_body_and_two_parts(gene: float, parent: int) -> None:
    genes = np.full(6, 0.5)
    genes[2] = gene
    assert MIXED.decode(genes).parts[2].parent == parent


def test_choices_are_equally_likely() -> None:
    rng = np.random.default_rng(0)
    bodies = MIXED.decode_all(rng.random((2400, 6)))
    hinges = np.bincount([body.parts[2].hinge for body in bodies])
    sides = np.bincount([body.parts[2].mount for body in bodies])
    assert len(hinges) == 6
    assert hinges == pytest.approx(np.full(6, 400), abs=80)
    assert sides == pytest.approx(np.full(4, 600), abs=100)


@pytest.mark.parametrize("genes", [np.zeros(7), np.full(8, 1.1), np.full(8, np.nan)])
def test_impossible_genomes_are_refused(genes: Array) -> None:
    with pytest.raises(SearchStateError):
        PARAMETRIC.decode(genes)


def test_a_main_body_without_the_mounts_of_the_problem_is_refused() -> None:
    with pytest.raises(MorphologyError, match=r"has 4 mounts, and hexapod-18 is about 6: take it"):
        Genome(Problem.load("hexapod-18"), BODY)
