"""``estimator export``: a model of a run as a file for simulators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from estimator.cli.console import errors_as_sentences
from estimator.cli.options import Directory
from estimator.errors import EstimatorError
from estimator.export.formats import FORMATS, Format, in_words_of
from estimator.storage.final_population import FinalPopulation
from estimator.storage.store import RunStore
from protocol.system.files import replace_text


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
        population = FinalPopulation.of(store)
        if not len(population):
            raise EstimatorError(f"{directory} has no model yet: resume the run first")
        if sample >= len(population):
            raise EstimatorError(
                f"{directory} holds {len(population)} models, so there is no sample {sample}: "
                f"choose 0 to {len(population) - 1}"
            )
        body = store.genome.decode(population.genes[population.order[sample]])
        return FORMATS[form](in_words_of(store.problem, store.capabilities, body))
