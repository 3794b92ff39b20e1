"""Runs small enough for tests: real in every other respect."""

from __future__ import annotations

from pathlib import Path

import pytest

from estimator.report.evaluations import TRUTH
from estimator.reproduction.paper_runs import Budget, PlannedRun, topological_runs
from estimator.reproduction.robot_process import print_body

TINY = Budget(physics="statics", interactions=2, population=4, generations=1)


@pytest.fixture
def topological() -> PlannedRun:
    (run,) = topological_runs(1, TINY)
    return run


@pytest.fixture(scope="session")
def body() -> str:
    return print_body()


@pytest.fixture
def root(tmp_path: Path, body: str) -> Path:
    """A directory with the truth in it."""
    (tmp_path / TRUTH).write_text(body)
    return tmp_path
