"""``estimator score`` and ``validate``: a run against the true body, and on fresh movements."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import (
    err,
    errors_as_sentences,
    out,
    print_json,
    unless_unwritable,
)
from estimator.cli.options import CORES, Dask, Directory, Jobs, Keys, Robot, executors
from estimator.cli.screen import Screen
from estimator.evaluation.score import Score
from estimator.evaluation.score import score as score_run
from estimator.evaluation.validate import validate as validate_run
from estimator.identification.run import reconnect
from estimator.physics.backends import in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.report.canvas import as_png
from estimator.report.evaluations import (
    SCORE,
    TRUTH,
    VALIDATION,
    print_score,
    print_validation,
    read_validation,
)
from estimator.report.plots import LENGTHS, run_plots
from estimator.report.result import PAGE, write_document
from estimator.report.run_files import LENGTHS_WITH_TRUTH, write_report
from estimator.storage.store import RunStore
from protocol.system.files import replace_bytes


def score(
    directory: Directory,
    truth: Annotated[Path, typer.Option(help="The robot's URDF.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    jobs: Jobs = CORES,
) -> None:
    """Compare the best model with the true body (the objective error)."""
    with errors_as_sentences(None), RunStore.open(directory, to_write=False) as store:
        with (
            closing(StaticsPhysics(store.world, jobs=jobs)) as physics,
            closing(in_this_process(store.settings.reference, store.world)) as reference,
        ):
            run_score = score_run(store, truth, physics, reference)
        if as_json:
            print_json(run_score.model_dump_json(indent=2))
        else:
            print_score(out, run_score)
        with unless_unwritable(directory):
            _plot_with_truth(store, run_score)
            replace_bytes(directory / TRUTH, truth.read_bytes())
            write_document(directory / SCORE, run_score)
            write_report(store, page=True)
            if not as_json:
                out.print(f"Plot: {directory / LENGTHS_WITH_TRUTH}", soft_wrap=True)
                out.print(f"Report, with the truth: {directory / PAGE}", soft_wrap=True)


def _plot_with_truth(store: RunStore, run_score: Score) -> None:
    plots = run_plots(store, run_score.joints, run_score.true_lengths_m)
    (lengths,) = (plot.figure for plot in plots if plot.name == LENGTHS)
    replace_bytes(store.directory / LENGTHS_WITH_TRUTH, as_png(lengths))


def validate(
    directory: Directory,
    robot: Robot,
    *,
    programs: Annotated[int, typer.Option(min=1, help="Fresh motor programs.")] = 20,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
) -> None:
    """Predict fresh motor programs, then perform them (the prediction error)."""
    with errors_as_sentences(None), RunStore.open(directory) as store:
        with (
            executors(jobs, dask) as workers,
            Screen(err) as screen,
            closing(workers.open_physics(store.settings.physics, store.world)) as physics,
            closing(reconnect(store, robot, screen, keys=keys)) as link,
        ):
            validation = validate_run(
                store,
                physics,
                link,
                programs=programs,
                saved=read_validation(directory),
                listener=screen,
            )
        print_validation(out, validation)
        with unless_unwritable(directory):
            write_document(directory / VALIDATION, validation)
            out.print(f"Saved: {directory / VALIDATION}", soft_wrap=True)
