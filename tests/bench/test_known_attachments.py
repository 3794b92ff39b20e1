"""``bench.known_attachments``: which true lengths lie in their intervals."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.known_attachments import KnownRun
from bench.simulation_based_calibration import Robots


@pytest.mark.parametrize(("robots", "dimensions"), [("exact", 4), ("built", 29)])
def test_a_run_leaves_which_lengths_are_inside(
    tmp_path: Path, robots: Robots, dimensions: int
) -> None:
    run = KnownRun(problem="topological", interactions=2, seed=3, robots=robots)
    run.file(tmp_path).parent.mkdir(parents=True)
    run.make(run.file(tmp_path).parent)
    told = run.figures(tmp_path)
    assert told["dimensions"] == dimensions
    assert len(told["particles"]) == len(told["equilibrated"]) == 4
    assert sum(told["equilibrated"]) >= 2
    assert run.sentence(tmp_path) == f"{sum(told['equilibrated'])} of 4 lengths inside"
