"""``bench.known_attachments``: which true lengths lie in their intervals."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.known_attachments import BodyRun


@pytest.mark.parametrize("stated", [False, True])
def test_a_run_leaves_which_lengths_are_inside(tmp_path: Path, stated: bool) -> None:
    run = BodyRun(problem="topological", robot="quadruped", interactions=2, seed=3, stated=stated)
    run.file(tmp_path).parent.mkdir(parents=True)
    run.make(run.file(tmp_path).parent)
    told = run.told(tmp_path)
    assert told["dimensions"] == (4 if stated else 28)
    assert len(told["particles"]) == len(told["settled"]) == 4
    assert sum(told["settled"]) >= 2
    assert run.sentence(tmp_path) == f"{sum(told['settled'])} of 4 lengths inside"
