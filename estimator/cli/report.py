"""``estimator report``: a run, or a reproduction, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences, out
from estimator.cli.options import Directory
from estimator.errors import RunDirectoryError
from estimator.report.page.run_page import PageSources, run_page
from estimator.report.run_files import PAGE, write_files
from estimator.report.summarise import summarise
from estimator.reproduction.report import reproduction_page
from estimator.storage.store import RunStore
from protocol.system.files import replace_text


def command(
    directory: Directory,
    *,
    paper: Annotated[
        bool, typer.Option("--paper", help="DIR is what estimator reproduce made.")
    ] = False,
    file: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: report.html and plots in DIR."),
    ] = None,
) -> None:
    """Write report.html: the body to be turned and posed, and all that is known of it."""
    place = file or directory / PAGE
    with errors_as_sentences(None):
        if paper:
            replace_text(place, reproduction_page(directory))
        else:
            _write_run(directory, file)
    out.print(f"Report: {place}", soft_wrap=True)


def _write_run(directory: Path, file: Path | None) -> None:
    with RunStore.open(directory, to_write=False) as store:
        result = summarise(store)
        if not result.complete:
            out.print("The run is not finished: the report says what is known so far.")
        if file is None:
            try:
                write_files(store, result, page=True)
            except OSError as error:
                raise RunDirectoryError(
                    f"{directory} cannot be written ({error.strerror}): say where the report is "
                    "to go, with --out FILE."
                ) from error
        else:
            sources = PageSources.of(store, result)
            replace_text(file, run_page(store, sources))
