"""``estimator show``: how far a run has come.

What a finished run found is in its ``result.json``, so that nothing has to be computed or drawn,
and the libraries for that are not loaded.
"""

from __future__ import annotations

import importlib
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences, out, print_run_directory, unless_unwritable
from estimator.cli.options import Directory
from estimator.errors import EstimatorError
from estimator.report.formats import FORMATS
from estimator.report.outcome import print_result
from estimator.report.result import Result
from estimator.storage.database import is_locked
from estimator.storage.store import LOCK, RunStore
from protocol.text import command_line, printable


def show(
    directory: Directory,
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help=f"Print it as {', '.join(FORMATS.own)}, or as a plug-in does. Default: as tables.",
        ),
    ] = None,
    details: Annotated[
        bool, typer.Option("--details", help="Probabilities, rivals, each movement, costs.")
    ] = False,
) -> None:
    """Show how far a run has come; writes the files of one that was broken off, if it can."""
    with errors_as_sentences(None), RunStore.open(directory, to_write=False) as store:
        # A format that there is not is refused before anything is computed.
        write = None if form is None else FORMATS.load(form)
        version = store.version
        is_worked_on = is_locked(directory, LOCK)  # asked first, since the writer may end meanwhile
        finished_result = Result.of_finished(store)
        result = finished_result
        if result is None:
            result = importlib.import_module("estimator.report.summarise").summarise(store)
        if write is None:
            print_result(out, result, directory, details=details)
        if finished_result is None and not is_worked_on and store.version == version:
            command = command_line("estimator", "show", directory)
            with unless_unwritable(directory, f"`{command}` writes them once it can."):
                importlib.import_module("estimator.report.run_files").write_files(store, result)
        if write is None:
            print_run_directory(directory)
        else:
            text = write(result, directory)
            if not isinstance(text, str):
                raise EstimatorError(
                    f"the {FORMATS.kind} {FORMATS.described(form)} gave {text!r}: it must give text"
                )
            typer.echo(printable(text, keep="\n\t"))
