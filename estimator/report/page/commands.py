"""The commands that make a run again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from estimator.storage.run_config import RunSettings


def commands(settings: RunSettings, directory: Path, recorded: int) -> tuple[str, str]:
    """Command lines that make a run again: with its robot, and from its recorded readings.

    Args:
        settings: What the run was asked to do.
        directory: Where it is.
        recorded: How many interactions it has had so far.
    """
    again = settings.model_copy(update={"interactions": recorded})
    return (
        shlex.join(["estimator", "identify", "--robot", settings.robot, *_options(settings)]),
        shlex.join(["estimator", "identify", "--robot", f"replay:{directory}", *_options(again)]),
    )


def _options(settings: RunSettings) -> Iterator[str]:
    yield from ("--problem", settings.problem, "--method", settings.method)
    yield from ("--interactions", str(settings.interactions), "--seed", str(settings.seed))
    yield from ("--modalities", ",".join(settings.modalities))
    yield from ("--physics", settings.physics, "--explore", settings.explore)
    if settings.sure is not None:
        yield from ("--sure", str(settings.sure))
    if settings.method == "paper":
        yield from ("--search", settings.search, "--objective", settings.objective)
        yield from ("--population", str(settings.population))
        yield from ("--generations", str(settings.generations))
        if settings.full_steps:
            yield "--full-steps"
