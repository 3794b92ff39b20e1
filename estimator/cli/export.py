"""``estimator export``: a model of a run as a file for simulators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences
from estimator.cli.options import Directory
from estimator.errors import EstimatorError
from estimator.posterior.fitted import FittedPosterior
from estimator.report.export.formats import FORMATS, Format, in_words_of
from estimator.storage.store import RunStore
from protocol.system.replace_file import replace_text


def command(
    directory: Directory,
    form: Annotated[Format, typer.Option("--format", help="Of the file.")],
    sample: Annotated[
        int, typer.Option(min=0, help="Another than the best model (0): 1 is the second best.")
    ] = 0,
    file: Annotated[
        Path | None, typer.Option("--out", dir_okay=False, help="Default: standard output.")
    ] = None,
) -> None:
    """Write a run's best model, or another one, as URDF, MJCF or JSON."""
    with errors_as_sentences(None):
        text = exported(directory, form, sample)
        if file is None:
            typer.echo(text, nl=False)
        else:
            replace_text(file, text)


def exported(directory: Path, form: Format, sample: int) -> str:
    """A model of a run in a format.

    Raises:
        EstimatorError: The run has no such model.
    """
    with RunStore.open(directory, to_write=False) as store:
        fitted = FittedPosterior.of(store)
    if fitted is None:
        raise EstimatorError(f"{directory} has no model yet: resume the run first")
    count = len(fitted.models)
    if sample >= count:
        raise EstimatorError(
            f"{directory} holds {count} models, so there is no sample {sample}: choose 0 to "
            f"{count - 1}"
        )
    body = fitted.genome.decode(fitted.models[fitted.ranked[sample]])
    return FORMATS[form](in_words_of(fitted.problem, fitted.capabilities, body))
