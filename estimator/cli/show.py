"""``estimator show``: how far a run has come."""

from __future__ import annotations

from estimator.cli.console import errors_as_sentences, out, print_run_directory, unless_unwritable
from estimator.cli.options import Directory
from estimator.identification.run import problem_of
from estimator.report.result import summarise
from estimator.report.run_files import write_files
from estimator.report.terminal_tables import print_result
from estimator.storage.store import RunStore


def command(directory: Directory) -> None:
    """Show how far a run has come; rewrites its result.json, readings.csv and plots if it can."""
    with errors_as_sentences(None), RunStore.open(directory, to_write=False) as store:
        problem = problem_of(store)
        result = summarise(store, problem)
        print_result(out, result)
        with unless_unwritable(directory):
            write_files(store, problem, result)
            print_run_directory(directory)
