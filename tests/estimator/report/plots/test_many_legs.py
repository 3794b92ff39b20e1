"""Plots of robots with more joints than there are markers."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Base
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.plots.canvas import as_png
from estimator.report.plots.posterior import plot_interval_lengths
from estimator.storage.beliefs import Belief


@pytest.mark.parametrize("name", ["hexapod-12", "hexapod-18"])
def test_each_leg_of_a_hexapod_is_drawn(name: str) -> None:
    problem, size = Problem.load(name), (0.24, 0.12, 0.06)
    base = Base(size=size, mass=0.8, mounts=problem.tables.base_mounts(size))
    genome = Genome(problem, base)
    genes = genome.permitted(np.random.default_rng(1).random((3, genome.size)))
    belief = Belief(
        genes=tuple(map(tuple, genes.tolist())),
        scales=((0.0, 0.0),) * 3,
        weights=(0.5, 0.3, 0.2),
        best=tuple(genes[0].tolist()),
        modes=(),
        within_problem=1.0,
        foretold=(),
        unexplained=(),
        noisy=(),
    )
    names = [f"joint {number}" for number in range(1, len(problem.parts) + 1)]
    figure = plot_interval_lengths([belief, belief], genome, names, [0.1] * len(names))
    (axes,) = figure.axes
    assert as_png(figure)
    _, labels = axes.get_legend_handles_labels()
    assert sorted(labels) == sorted([*names, "true length"])
