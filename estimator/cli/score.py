"""``estimator score``: a run beside the true body."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences, out, print_json, unless_unwritable
from estimator.cli.options import CORES, Directory, Jobs
from estimator.evaluation.score import Score, score
from estimator.identification.final_population import with_last_word
from estimator.identification.run import problem_of, world_of
from estimator.physics.backends import REFERENCE, in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.report.plots import plot_lengths
from estimator.report.posterior_plots import plot_interval_lengths
from estimator.report.run_files import LENGTHS_WITH_TRUTH
from estimator.report.terminal_tables import print_score
from estimator.storage.store import RunStore
from protocol.system.replace_file import replace_file


def command(
    directory: Directory,
    truth: Annotated[Path, typer.Option(help="The robot's URDF.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    jobs: Jobs = CORES,
) -> None:
    """Compare the best model with the true body (the objective error)."""
    with errors_as_sentences(None), RunStore.open(directory, to_write=False) as store:
        problem = problem_of(store)
        world = world_of(store, problem)
        with (
            closing(StaticsPhysics(world, jobs=jobs)) as physics,
            closing(in_this_process(REFERENCE, world)) as reference,
        ):
            run_score = score(store, problem, truth, physics, reference)
        if as_json:
            print_json(run_score.model_dump_json(indent=2))
        else:
            print_score(out, run_score)
        with unless_unwritable(directory):
            _plot_with_truth(store, run_score)
            if not as_json:
                out.print(f"Plot: {directory / LENGTHS_WITH_TRUTH}", soft_wrap=True)


def _plot_with_truth(store: RunStore, run_score: Score) -> None:
    problem = problem_of(store)
    genome = Genome(problem, problem.base(store.capabilities))
    joints, targets = run_score.joints, list(run_score.true_lengths_m)
    beliefs = [belief for belief, _ in store.beliefs()]
    generations = with_last_word(store)

    def draw(path: Path) -> None:
        if beliefs:
            plot_interval_lengths(path, beliefs, genome, joints, targets)
        else:
            plot_lengths(path, generations, genome, joints, targets)

    replace_file(store.directory / LENGTHS_WITH_TRUTH, draw)
