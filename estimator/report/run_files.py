"""The derived files of a run directory; everything in them comes from the run's database."""

from __future__ import annotations

import json
from typing import Final

from estimator.identification.final_population import with_last_word
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings import readings_csv
from estimator.report import posterior_csv
from estimator.report.plots import plot_errors, plot_lengths
from estimator.report.posterior_plots import plot_belief, plot_interval_lengths
from estimator.report.result import Result, summarise
from estimator.storage.store import RunStore
from protocol.system.interrupts import interrupts_deferred
from protocol.system.replace_file import replace_file, replace_text

RESULT: Final = "result.json"
READINGS: Final = "readings.csv"
ROBOT: Final = "robot.json"
POSTERIOR: Final = "posterior.csv"
ERRORS: Final = "plots/errors.png"
BELIEF: Final = "plots/belief.png"
LENGTHS: Final = "plots/lengths.png"
LENGTHS_WITH_TRUTH: Final = "plots/lengths_with_truth.png"
VALIDATION: Final = "validation.json"


def write_report(store: RunStore, problem: Problem, *, plots: bool = True) -> Result:
    """Writes all derived files and returns what ``result.json`` holds.

    Each file is replaced as a whole, so nobody reads half of one.

    Args:
        store: The run.
        problem: Its problem.
        plots: Whether to draw, which takes longer than all the rest.
    """
    result = summarise(store, problem)
    write_files(store, problem, result, plots=plots)
    return result


def write_files(store: RunStore, problem: Problem, result: Result, *, plots: bool = True) -> None:
    """Writes the derived files for a result that is known already; arguments as above.

    Raises:
        OSError: The directory cannot be written.
    """
    with interrupts_deferred():
        _write(store, problem, result, plots=plots)


def _write(store: RunStore, problem: Problem, result: Result, *, plots: bool) -> None:
    joints = [joint.name for joint in store.capabilities.joints]
    replace_text(store.directory / RESULT, result.model_dump_json(indent=2) + "\n")
    replace_file(
        store.directory / READINGS,
        lambda path: readings_csv.write(path, joints, store.observations()),
    )
    robot = json.dumps(store.capabilities.to_map(), indent=2)
    replace_text(store.directory / ROBOT, robot + "\n")
    _write_posterior(store, problem, result, plots=plots)
    generations = with_last_word(store)
    if generations and plots:
        genome = Genome(problem, problem.base(store.capabilities))
        names = [leg.joint for leg in result.legs]
        replace_file(store.directory / ERRORS, lambda path: plot_errors(path, generations))
        replace_file(
            store.directory / LENGTHS, lambda path: plot_lengths(path, generations, genome, names)
        )


def _write_posterior(store: RunStore, problem: Problem, result: Result, *, plots: bool) -> None:
    beliefs = [belief for belief, _ in store.beliefs()]
    if not beliefs:
        return
    genome = Genome(problem, problem.base(store.capabilities))
    replace_file(
        store.directory / POSTERIOR, lambda path: posterior_csv.write(path, genome, beliefs[-1])
    )
    if plots:
        names = [leg.joint for leg in result.legs]
        expected = [item.bits for item in store.interactions()][: len(beliefs)]
        replace_file(store.directory / BELIEF, lambda path: plot_belief(path, beliefs, expected))
        replace_file(
            store.directory / LENGTHS,
            lambda path: plot_interval_lengths(path, beliefs, genome, names),
        )
