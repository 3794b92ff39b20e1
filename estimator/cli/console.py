"""Output to the terminal: text, and the end of a command that failed."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from estimator.errors import RunDirectoryError
from estimator.plugins import packages_named_when_failing
from estimator.storage.database import ADVICE, code_of, holds_run
from protocol.errors import BodyschemaError
from protocol.text import command_line, printable

if TYPE_CHECKING:
    from estimator.report.result import Result


class Terminal(Console):
    """A console that prints text verbatim: no markup, no control characters.

    Names, sentences and phases come from robots, runs and files that others made: square brackets
    are no markup, and what is not printable is shown as an escape.

    Args:
        **options: Options of ``rich.console.Console``.
    """

    def __init__(self, **options: Any):
        super().__init__(markup=False, emoji=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Escapes what is not printable; all output passes through here."""
        for segment in super().render(renderable, options):
            text = segment.text if segment.control else printable(segment.text, keep="\n")
            yield Segment(text, segment.style, segment.control)


out: Final = Terminal()
err: Final = Terminal(stderr=True)


def print_json(text: str) -> None:
    """Prints JSON, with every character that is not printable as JSON escapes it."""
    typer.echo(
        "".join(
            char if char.isprintable() or char == "\n" else json.dumps(char)[1:-1] for char in text
        )
    )


@contextmanager
def errors_as_sentences(run: Path | None) -> Iterator[None]:
    """Turns expected errors into a sentence on standard error and exit code 1.

    Args:
        run: The run directory, when its work can be resumed.
    """
    try:
        with packages_named_when_failing():
            yield
    except KeyboardInterrupt:
        fail("interrupted", run)
    except RunDirectoryError as error:
        fail(str(error), None)
    except sqlite3.Error as error:
        advice = ADVICE.get(code_of(error), "")
        fail(f"the run's database cannot be written: {error}. {advice}".rstrip(), run)
    except OSError as error:
        fail(_os_error_in_words(error), run)
    except BodyschemaError as error:
        fail(str(error), run)


def _os_error_in_words(error: OSError) -> str:
    if error.filename is None or error.strerror is None:
        return str(error)
    return f"{error.filename} cannot be read or written: {error.strerror}."


def fail(sentence: str, run: Path | None) -> NoReturn:
    """Says what went wrong, where the run is if it can be resumed, and exits with 1."""
    err.print(f"estimator: {sentence}", highlight=False, soft_wrap=True)
    if run is not None and _can_be_resumed(run):
        err.print(
            f"The run is safe in {run}. Go on with: {command_line('estimator', 'resume', run)}",
            highlight=False,
            soft_wrap=True,
        )
    raise typer.Exit(1)


def _can_be_resumed(run: Path) -> bool:
    try:
        return holds_run(run)
    except RunDirectoryError:
        return False


def print_run_directory(run: Path) -> None:
    """Says where a run lies and what is in it."""
    names = ("report.html", "result.json", "readings.csv", "plots/")
    existing = ", ".join(name for name in names if (run / name).exists())
    out.print(f"Run: {run} ({existing})", soft_wrap=True)


def exit_if_unexplained(result: Result) -> None:
    """Exits with 1 where a run ends without a body that explains the readings."""
    if result.judged is not None and not result.judged.explained:
        raise typer.Exit(1)


@contextmanager
def unless_unwritable(directory: Path, advice: str = "") -> Iterator[None]:
    """Goes on where some file of a directory cannot be written, and says so, with some advice."""
    try:
        yield
    except OSError as error:
        note = (
            f"Note: {directory} cannot be written ({error.strerror}): files there may be missing "
            f"or old. {advice}"
        )
        err.print(note.rstrip(), highlight=False, soft_wrap=True)
