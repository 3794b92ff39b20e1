"""A robot whose legs hang: its description is read as the problem's mounts have them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.evaluation.attachments import Comparison, Truth
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.evaluation.test_attachments import numbered, robot, wrong
from tests.estimator.urdf_bodies import write_urdf

HANGING = """
name = "hanging"
description = "Two legs of two parts, at four corners, some straight down."
density = 1000.0
touch = "outermost"

[motors]
driven = "all"
range_deg = [-30.0, 30.0]
slew_deg_per_s = 60.0

[search]
population = 10
generations = 1
interactions = 1
"""
for _number, _yaw in enumerate((45, 135, -135, -45)):
    HANGING += f"""
[[mounts]]
name = "corner {_number}"
at = [{0.07 if abs(_yaw) < 90 else -0.07}, {0.07 if _yaw > 0 else -0.07}, 0.0]
yaw_deg = {_yaw}
elevation_deg = {-90 if _number % 2 else -30}
"""
for _name, _elevation in (("on", 0), ("bent", 60)):
    HANGING += f"""
[[mounts]]
name = "{_name}"
at = 1.0
yaw_deg = 10
elevation_deg = {_elevation}
"""
for _row in range(4):
    HANGING += f"""
[[parts]]
name = "part {_row}"
parent = {max(0, _row - 1)}
mount = "unknown"
hinge = "unknown"
length = [0.05, 0.20]
radius = 0.006
motor = {_row + 1}
"""


def test_what_hangs_is_read_as_it_hangs(tmp_path: Path) -> None:
    capabilities = robot(numbered(4), 3)
    problem = Problem.parse(HANGING, "hanging.toml").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    rng = np.random.default_rng(2)
    for _ in range(10):
        body = genome.decode(rng.random(genome.size))
        truth = Truth.read(
            write_urdf(tmp_path / "t.urdf", body, numbered(4)), problem, capabilities
        )
        assert wrong(Comparison(problem, genome, body, truth).configurations()) == []
        first, *others = body.parts
        away = replace(body, parts=(replace(first, mount=(first.mount + 1) % 4), *others))
        comparison = Comparison(problem, genome, away, truth)
        assert wrong(comparison.configurations()) == [("part 0", "mount")]
