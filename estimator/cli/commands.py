"""``estimator``: identifies a robot's body, and says how good the result is.

Exit codes: 0 done, 1 failed (with a sentence), 2 wrong usage.
"""

from __future__ import annotations

import os
import secrets
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
import typer
from rich.text import Text

from estimator.cli.console import err, fail, out, print_json, sentences
from estimator.cli.doctor import ExaminedItem, Fitness, examine
from estimator.cli.screen import Screen
from estimator.evaluation.score import Score, score
from estimator.evaluation.validate import validate
from estimator.identification.exploration import RULES
from estimator.identification.final_population import with_last_word
from estimator.identification.run import Order, identify, problem_of, reconnect, resume, world_of
from estimator.identification.subjective_error import MODALITIES
from estimator.parallel.cluster import Cluster
from estimator.physics.backends import (
    BACKENDS,
    REFERENCE,
    OpenPhysics,
    in_processes,
    in_this_process,
    on_cluster,
)
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.report.plots import plot_lengths
from estimator.report.result import summarise
from estimator.report.run_files import (
    LENGTHS_WITH_TRUTH,
    VALIDATION,
    write_files,
    write_report,
)
from estimator.report.terminal_tables import print_result, print_score, print_validation
from estimator.reproduction.report import REPORT
from estimator.reproduction.reproduce import ReproductionRequest, figures_of, reproduce
from estimator.reproduction.runs.plan import FIGURES, SEEDS, Budget
from estimator.storage.store import RunStore
from protocol.system.replace_file import replace_file

app = typer.Typer(
    help="Identifies a robot's body from what it feels when it moves.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
Directory: TypeAlias = Annotated[Path, typer.Argument(help="A run directory.", metavar="DIR")]
Robot: TypeAlias = Annotated[
    str, typer.Option(help="tcp://HOST:PORT, file:READINGS.csv or replay:DIR.")
]
Jobs: TypeAlias = Annotated[
    int, typer.Option(min=1, help="Worker processes; the result does not depend on it.")
]
Dask: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS",
        help="Scheduler of a Dask cluster, which does the work in place of --jobs processes here.",
    ),
]
Keys: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Key directory, where the robot asks for keys: robotd keys new makes one.",
    ),
]
CORES = len(os.sched_getaffinity(0))


@app.command("identify")
def identify_command(
    *,
    robot: Robot,
    problem: Annotated[str, typer.Option(help="A problem's name, or a .toml file.")],
    interactions: Annotated[
        int | None, typer.Option(min=1, help="Default: the problem's, or all that were recorded.")
    ] = None,
    physics: Annotated[
        str, typer.Option(help=f"What predicts a model's readings: {', '.join(BACKENDS)}.")
    ] = BACKENDS[0],
    explore: Annotated[
        str, typer.Option(help=f"What chooses motor programs: {', '.join(RULES)}.")
    ] = RULES[0],
    modalities: Annotated[
        str, typer.Option(help="Sensors that count, separated by commas.")
    ] = ",".join(MODALITIES),
    seed: Annotated[
        int | None, typer.Option(min=0, help="Source of all randomness. Default: a new one.")
    ] = None,
    population: Annotated[
        int | None, typer.Option(min=2, help="Models, an even number. Default: the problem's.")
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
        physics=physics,
        explore=explore,
        modalities=tuple(item.strip() for item in modalities.split(",")),
        interactions=interactions,
        population=population,
        generations=generations,
        full_steps=full_steps,
        keys=keys,
    )
    with sentences(place), _physics(jobs, dask) as physics_of, Screen(err) as screen:
        result = identify(place, order, physics_of, screen, report=write_report)
    print_result(out, result)
    _print_place(place)


@app.command("resume")
def resume_command(
    directory: Directory,
    robot: Annotated[
        str | None, typer.Option(help="Where the robot is now. Default: where it was.")
    ] = None,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
) -> None:
    """Go on with an interrupted run; the result is that of an uninterrupted one."""
    with sentences(directory), _physics(jobs, dask) as physics_of, Screen(err) as screen:
        result = resume(directory, physics_of, screen, robot=robot, keys=keys, report=write_report)
    print_result(out, result)
    _print_place(directory)


@app.command("show")
def show_command(directory: Directory) -> None:
    """Show how far a run has come; rewrites its result.json, readings.csv and plots if it can."""
    with sentences(None), RunStore.open(directory, to_write=False) as store:
        problem = problem_of(store)
        result = summarise(store, problem)
        print_result(out, result)
        with _unless_unwritable(directory):
            write_files(store, problem, result)
            _print_place(directory)


@app.command("score")
def score_command(
    directory: Directory,
    truth: Annotated[Path, typer.Option(help="The robot's URDF.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    jobs: Jobs = CORES,
) -> None:
    """Compare the best model with the true body (the objective error)."""
    with sentences(None), RunStore.open(directory, to_write=False) as store:
        problem = problem_of(store)
        world = world_of(store, problem)
        with (
            closing(StaticsPhysics(world, jobs=jobs)) as physics,
            closing(in_this_process(REFERENCE, world)) as reference,
        ):
            found = score(store, problem, truth, physics, reference)
        if as_json:
            print_json(found.model_dump_json(indent=2))
        else:
            print_score(out, found)
        with _unless_unwritable(directory):
            _plot_with_truth(store, found)
            if not as_json:
                out.print(f"Plot: {directory / LENGTHS_WITH_TRUTH}", soft_wrap=True)


@app.command("validate")
def validate_command(
    directory: Directory,
    robot: Robot,
    *,
    programs: Annotated[int, typer.Option(min=1, help="Fresh motor programs.")] = 20,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
) -> None:
    """Predict fresh motor programs, then perform them (the prediction error)."""
    with (
        sentences(None),
        RunStore.open(directory) as store,
        _physics(jobs, dask) as physics_of,
        Screen(err) as screen,
    ):
        problem = problem_of(store)
        world = world_of(store, problem)
        with (
            closing(physics_of(store.settings.physics, world)) as physics,
            closing(reconnect(store, problem, robot, screen, keys=keys)) as link,
        ):
            found = validate(store, problem, physics, link, programs=programs, listener=screen)
        text = found.model_dump_json(indent=2) + "\n"
        replace_file(directory / VALIDATION, lambda path: path.write_text(text, encoding="utf-8"))
    print_validation(out, found)
    out.print(f"Saved: {directory / VALIDATION}", soft_wrap=True)


@app.command("doctor")
def doctor_command(*, robot: Robot, keys: Keys = None) -> None:
    """Find out whether a robot can be identified, and why not; moves nothing."""
    with sentences(None):
        verdicts = [_print_finding(finding) for finding in examine(robot, keys)]
    if Fitness.BAD in verdicts:
        raise typer.Exit(1)


@app.command("reproduce")
def reproduce_command(
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
        str, typer.Option(help=f"What predicts a model's readings: {', '.join(BACKENDS)}.")
    ] = BACKENDS[0],
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
        sentences(None),
        nullcontext() if dask is None else Cluster(dask) as cluster,
        Screen(err) as screen,
    ):
        request = ReproductionRequest(
            figures=figures_of(figure),
            runs=runs,
            budget=budget,
            jobs=jobs,
            command=shlex.join(["estimator", *sys.argv[1:]]),
        )
        outcome = reproduce(place, request, screen, cluster=cluster)
    out.print(f"Report: {place / REPORT}", soft_wrap=True)
    if outcome.failures:
        fail(f"{len(outcome.failures)} runs failed: the same command tries them again", None)


def _plot_with_truth(store: RunStore, found: Score) -> None:
    problem = problem_of(store)
    genome = Genome(problem, problem.base(store.capabilities))
    generations = with_last_word(store)
    replace_file(
        store.directory / LENGTHS_WITH_TRUTH,
        lambda path: plot_lengths(
            path, generations, genome, found.joints, np.array(found.true_lengths_m).tolist()
        ),
    )


@contextmanager
def _unless_unwritable(directory: Path) -> Iterator[None]:
    """Leaves the files of a directory as they are where they cannot be written, and says so."""
    try:
        yield
    except OSError as error:
        note = (
            f"Note: {directory} cannot be written ({error.strerror}): its files are as they were."
        )
        err.print(note, highlight=False, soft_wrap=True)


def _print_finding(finding: ExaminedItem) -> Fitness:
    colour = {Fitness.FINE: "green", Fitness.NOTE: "yellow", Fitness.BAD: "red"}[finding.verdict]
    line = Text.assemble(
        (f"{finding.verdict.value:<6}", colour), f"{finding.subject:<13}", finding.sentence
    )
    out.print(line, soft_wrap=True)
    return finding.verdict


def _print_place(directory: Path) -> None:
    out.print(f"Run: {directory} (result.json, readings.csv, plots/)", soft_wrap=True)


@contextmanager
def _physics(jobs: int, dask: str | None) -> Iterator[OpenPhysics]:
    """Where models are simulated: in processes of this computer, or on a cluster."""
    if dask is None:
        yield in_processes(jobs)
    else:
        with Cluster(dask) as cluster:
            yield on_cluster(cluster)
