"""Plots of robots with more joints than there are markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.plots.canvas import as_png
from estimator.report.plots.posterior import plot_interval_lengths
from tests.estimator.model_robot import make_capabilities, make_posterior


@pytest.mark.parametrize("name", ["hexapod-12", "hexapod-18"])
def test_each_leg_of_a_hexapod_is_drawn(name: str) -> None:
    problem = Problem.load(name)
    robot = replace(make_capabilities(), base_size=(0.24, 0.12, 0.06), base_mass=0.8)
    genome = Genome(problem, problem.base(robot))
    genes = genome.permitted(np.random.default_rng(1).random((3, genome.size)))
    posterior = make_posterior(problem, robot, genes, best=genes[0])
    names = [f"joint {number}" for number in range(1, len(problem.parts) + 1)]
    figure = plot_interval_lengths([posterior, posterior], names, [0.1] * len(names))
    (axes,) = figure.axes
    assert as_png(figure)
    _, labels = axes.get_legend_handles_labels()
    assert sorted(labels) == sorted([*names, "true length"])
