"""``estimator score``: a run beside the true body."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences, out, print_json, unless_unwritable
from estimator.cli.options import CORES, Directory, Jobs
from estimator.evaluation.score import Score, score
from estimator.physics.backends import in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.report.canvas import as_png
from estimator.report.evaluations import print_score, write_score
from estimator.report.plots import LENGTHS, run_plots
from estimator.report.run_files import LENGTHS_WITH_TRUTH, PAGE, write_report
from estimator.storage.store import RunStore
from protocol.system.replace_file import replace_bytes


def command(
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
            run_score = score(store, truth, physics, reference)
        if as_json:
            print_json(run_score.model_dump_json(indent=2))
        else:
            print_score(out, run_score)
        with unless_unwritable(directory):
            _plot_with_truth(store, run_score)
            write_score(directory, run_score, truth)
            write_report(store, page=True)
            if not as_json:
                out.print(f"Plot: {directory / LENGTHS_WITH_TRUTH}", soft_wrap=True)
                out.print(f"Report, with the truth: {directory / PAGE}", soft_wrap=True)


def _plot_with_truth(store: RunStore, run_score: Score) -> None:
    plots = run_plots(store, run_score.joints, run_score.true_lengths_m)
    (lengths,) = (plot.figure for plot in plots if plot.name == LENGTHS)
    replace_bytes(store.directory / LENGTHS_WITH_TRUTH, as_png(lengths))
