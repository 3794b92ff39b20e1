"""``estimator identify``: a run from start to end."""

from __future__ import annotations

import secrets
import time
from pathlib import Path
from typing import Annotated, cast

import typer

from estimator.cli.console import (
    err,
    errors_as_sentences,
    exit_if_unexplained,
    out,
    print_run_directory,
)
from estimator.cli.live import LIVE_BIND, LiveScreen, LiveView
from estimator.cli.options import CORES, Dask, Jobs, Keys, Live, LiveBind, Robot, Strict, computers
from estimator.exploration.rules import RULES
from estimator.identification.order import METHODS, MethodName, Order
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.run import identify
from estimator.physics.backends import BACKENDS
from estimator.readings.modalities.registry import MODALITIES
from estimator.report.run_files import write_report
from estimator.report.tables import print_result
from estimator.search.searches import SEARCHES


def command(
    *,
    robot: Robot,
    problem: Annotated[str, typer.Option(help="A problem's name, or a .toml file.")],
    interactions: Annotated[
        int | None, typer.Option(min=1, help="Default: the problem's, or all that were recorded.")
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="posterior: samples of every body that explains the readings, and how sure it is; "
            "paper: one population, optimised as in the paper."
        ),
    ] = next(iter(METHODS)),
    physics: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"What predicts a model's readings: {', '.join(BACKENDS.own)}, or a plug-in. "
            "Default: the method's.",
        ),
    ] = None,
    explore: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"What chooses motor programs: {', '.join(RULES.own)}, or a plug-in. "
            "Default: the method's.",
        ),
    ] = None,
    search: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"What optimises the paper's population: {', '.join(SEARCHES.own)}, or a plug-in. "
            "Default: the first.",
        ),
    ] = None,
    objective: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"What that minimises: {', '.join(OBJECTIVES.own)}, or a plug-in.",
        ),
    ] = next(iter(OBJECTIVES.own)),
    sure: Annotated[
        float | None,
        typer.Option(
            min=0.5,
            max=0.999,
            help="Of the method posterior: end as soon as the attachments are so probable, lengths "
            "known to 5 mm, and one more movement has left them so.",
        ),
    ] = None,
    strict: Strict = False,
    modalities: Annotated[
        str, typer.Option(help="Sensors that count, separated by commas.")
    ] = ",".join(MODALITIES),
    seed: Annotated[
        int | None, typer.Option(min=0, help="Source of all randomness. Default: a new one.")
    ] = None,
    population: Annotated[
        int | None, typer.Option(min=2, help="The paper's, an even number. Default: the problem's.")
    ] = None,
    generations: Annotated[
        int | None, typer.Option(min=1, help="After each interaction. Default: the problem's.")
    ] = None,
    full_steps: Annotated[
        bool, typer.Option("--full-steps", help="Simulate on after a body has come to rest.")
    ] = False,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
    live: Live = False,
    live_bind: LiveBind = LIVE_BIND,
    directory: Annotated[
        Path | None, typer.Option("--out", help="Run directory. Default: a new one in runs/.")
    ] = None,
) -> None:
    """Identify a robot: act, sense, model, again and again."""
    chosen = secrets.randbelow(2**32) if seed is None else seed
    name = f"{time.strftime('%Y%m%d-%H%M%S')}-{Path(problem).stem}-{chosen}"
    place = directory or Path("runs") / name
    order = Order(
        robot=robot,
        problem=problem,
        seed=chosen,
        method=cast(MethodName, method),  # identify refuses what is no method
        physics=physics,
        search=search,
        objective=objective,
        explore=explore,
        sure=sure,
        modalities=tuple(item.strip() for item in modalities.split(",")),
        interactions=interactions,
        population=population,
        generations=generations,
        full_steps=full_steps,
        keys=keys,
    )
    with errors_as_sentences(place), LiveView(place, live_bind if live else None) as live_view:
        with computers(jobs, dask) as opened, LiveScreen(err, live_view) as screen:
            result = identify(place, order, opened, screen, report=write_report)
        print_result(out, result)
        print_run_directory(place)
        live_view.stay(err)
    if strict:
        exit_if_unexplained(result)
