"""``estimator show``: how far a run has come."""

from __future__ import annotations

from typing import Annotated

import typer

from estimator.cli.console import (
    errors_as_sentences,
    out,
    print_run_directory,
    unless_unwritable,
)
from estimator.cli.options import Directory
from estimator.report.formats import FORMATS
from estimator.report.run_files import write_files
from estimator.report.summarise import summarise
from estimator.report.tables import print_result
from estimator.storage.store import RunStore
from protocol.text.printable import printable


def command(
    directory: Directory,
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help=f"Print it as {', '.join(FORMATS.own)}, or as a plug-in does. Default: as tables.",
        ),
    ] = None,
) -> None:
    """Show how far a run has come; rewrites its result.json, readings.csv and plots if it can."""
    with errors_as_sentences(None), RunStore.open(directory, to_write=False) as store:
        write = None if form is None else FORMATS.load(form)
        result = summarise(store)
        if write is None:
            print_result(out, result)
        with unless_unwritable(directory):
            write_files(store, result)
            if write is None:
                print_run_directory(directory)
        if write is not None:
            typer.echo(printable(write(result, directory), keep="\n\t"))
