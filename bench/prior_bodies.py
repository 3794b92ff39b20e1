"""Bodies drawn from a problem's prior, as URDF: ``sim-robotd --body`` makes robots of them."""

from __future__ import annotations

from functools import cache

import numpy as np

from estimator.body.morphology import Array
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.export.formats import in_words_of, urdf
from protocol.wire.capabilities import Capabilities
from robot.service.daemon import describe
from sim_robot.simulator.electronics_sets import pc104
from sim_robot.world.body import DEFAULT, body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels


def drawn_body(problem: str, seed: int) -> str:
    """URDF of a body drawn from a problem's prior, with the default robot's joints."""
    loaded, genome, robot = on_robot(problem)
    body = genome.decode(drawn_genes(genome, np.random.default_rng([seed, 1])))
    return urdf(in_words_of(loaded, robot, body))


def drawn_genes(genome: Genome, rng: np.random.Generator) -> Array:
    """Genes of one body that the problem allows, shape (size,)."""
    genes: Array = genome.permitted(rng.random((1, genome.size)))[0]
    return genes


@cache
def on_robot(name: str, body: str = DEFAULT) -> tuple[Problem, Genome, Capabilities]:
    """A problem written out for a simulated robot, its genome, and the robot's capabilities.

    Args:
        name: Name of a problem that ships, or a problem file; or the text of one.
        body: Name or file of the robot's body.
    """
    robot = describe(pc104(load_body(body_path(body)), NoiseLevels()))
    problem = Problem.parse(name, "the problem") if "\n" in name else Problem.load(name)
    problem = problem.for_robot(robot)
    return problem, Genome(problem, problem.base(robot)), robot
