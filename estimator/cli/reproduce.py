"""``estimator reproduce``: the runs and figures of the paper."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import err, errors_as_sentences, fail, out
from estimator.cli.options import CORES, Dask
from estimator.cli.screen import Screen
from estimator.cluster import Cluster
from estimator.physics.backends import BACKENDS, REFERENCE
from estimator.reproduction.paper_runs import FIGURES, SEEDS, Budget
from estimator.reproduction.report import REPORT
from estimator.reproduction.reproduce import figures_of, reproduce
from protocol.text import command_line


def command(
    figure: Annotated[str, typer.Argument(help=f"{', '.join(FIGURES)} or all.", metavar="FIGURE")],
    *,
    runs: Annotated[
        int | None,
        typer.Option(min=1, max=len(SEEDS), help="Seeds. Default: the paper's 30 and 10."),
    ] = None,
    interactions: Annotated[
        int | None, typer.Option(min=1, help="Of each run. Default: the paper's 4 and 9.")
    ] = None,
    population: Annotated[
        int | None, typer.Option(min=2, help="Models, an even number. Default: the paper's.")
    ] = None,
    generations: Annotated[
        int | None, typer.Option(min=1, help="After each interaction. Default: the paper's.")
    ] = None,
    physics: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"What predicts a model's readings: {', '.join(BACKENDS.own)}, or a plug-in.",
        ),
    ] = REFERENCE,
    jobs: Annotated[
        int, typer.Option(min=1, help="Runs at a time; the result does not depend on it.")
    ] = CORES,
    dask: Dask = None,
    directory: Annotated[
        Path | None, typer.Option("--out", help="Default: runs/reproduction-PHYSICS.")
    ] = None,
) -> None:
    """Do the paper's runs on simulated robots, and draw its figures; goes on where it was left."""
    place = directory or Path("runs") / f"reproduction-{physics}"
    budget = Budget(
        physics=physics, interactions=interactions, population=population, generations=generations
    )
    with (
        errors_as_sentences(None),
        nullcontext() if dask is None else Cluster(dask) as cluster,
        Screen(err) as screen,
    ):
        failures = reproduce(
            place,
            figures_of(figure),
            screen,
            runs=runs,
            budget=budget,
            jobs=jobs,
            cluster=cluster,
            command=command_line("estimator", *sys.argv[1:]),
        )
    out.print(f"Report: {place / REPORT}", soft_wrap=True)
    if failures:
        runs_failed = "1 run" if len(failures) == 1 else f"{len(failures)} runs"
        fail(f"{runs_failed} failed: the same command tries again", None)
