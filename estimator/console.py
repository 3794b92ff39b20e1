"""What the command says at a terminal, and how it ends when something went wrong."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NoReturn

import typer
from rich.console import Console

from estimator.database import holds_run
from estimator.errors import RunDirectoryError
from protocol.errors import BodyschemaError

out: Final = Console()
err: Final = Console(stderr=True)


@contextmanager
def sentences(run: Path | None) -> Iterator[None]:
    """Turns what can go wrong into a sentence and exit code 1.

    Args:
        run: The run directory, when its work can be resumed.
    """
    try:
        yield
    except KeyboardInterrupt:
        fail("interrupted", run)
    except RunDirectoryError as error:
        fail(str(error), None)
    except (BodyschemaError, OSError, sqlite3.Error) as error:
        fail(str(error), run)


def fail(sentence: str, run: Path | None) -> NoReturn:
    """Says what went wrong, where the run is if it can be resumed, and exits with 1."""
    err.print(f"estimator: {sentence}", markup=False, highlight=False, soft_wrap=True)
    if run is not None and holds_run(run):
        err.print(
            f"The run is safe in {run}. Go on with: estimator resume {run}",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
    raise typer.Exit(1)
