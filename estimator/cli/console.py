"""Output to the terminal: text, the progress of a run, and the end of a command that failed."""

from __future__ import annotations

import json
import sqlite3
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, NoReturn, Self

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment

from estimator.errors import RunDirectoryError
from estimator.identification.method import Listener, information_in_words
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation
from estimator.storage.database import holds_run
from protocol.errors import BodyschemaError, RobotError
from protocol.text import printable

if TYPE_CHECKING:
    from estimator.report.result import Result


class Terminal(Console):
    """A console that prints text verbatim: no markup, no control characters.

    Names, sentences and phases come from robots, runs and files that others made: square brackets
    are no markup, and what is not printable is shown as an escape.

    Args:
        **options: As of ``rich.console.Console``.
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
        yield
    except KeyboardInterrupt:
        fail("interrupted", run)
    except RunDirectoryError as error:
        fail(str(error), None)
    except sqlite3.Error as error:
        busy = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY
        advice = (
            "Another process holds it, or its file system has no locks: then choose another disk."
            if busy
            else "Look whether the disk is full."
        )
        fail(f"the run's database cannot be written: {error}. {advice}", run)
    except OSError as error:
        fail(_said(error), run)
    except BodyschemaError as error:
        fail(str(error), run)


def _said(error: OSError) -> str:
    if error.filename is None or error.strerror is None:
        return str(error)
    return f"{error.filename} cannot be read or written: {error.strerror}."


def fail(sentence: str, run: Path | None) -> NoReturn:
    """Says what went wrong, where the run is if it can be resumed, and exits with 1."""
    err.print(f"estimator: {sentence}", highlight=False, soft_wrap=True)
    if run is not None and _can_be_resumed(run):
        err.print(
            f"The run is safe in {run}. Go on with: estimator resume {run}",
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
    there = ", ".join(name for name in names if (run / name).exists())
    out.print(f"Run: {run} ({there})", soft_wrap=True)


def exit_if_unexplained(result: Result) -> None:
    """Exits with 1 where a run ends without a body that explains the readings."""
    if result.judged is not None and not result.judged.explained:
        raise typer.Exit(1)


@contextmanager
def unless_unwritable(directory: Path) -> Iterator[None]:
    """Leaves the files of a directory as they are where they cannot be written, and says so."""
    try:
        yield
    except OSError as error:
        note = (
            f"Note: {directory} cannot be written ({error.strerror}): its files are as they were."
        )
        err.print(note, highlight=False, soft_wrap=True)


class Screen(Listener):
    """Shows a run's progress; use it as a context manager around the work.

    Args:
        console: Where to write.
        interactive: Whether a person sits there who can be asked.
    """

    def __init__(self, console: Console, *, interactive: bool | None = None):
        self._console = console
        self._interactive = sys.stdin.isatty() if interactive is None else interactive
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=12),
            TaskProgressColumn(),
            TimeRemainingColumn(compact=True),
            TextColumn("left"),
            console=console,
            speed_estimate_period=600.0,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task("starting", total=None)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def expect(self, work: float, done: float) -> None:
        """Sets the length of the bar."""
        self._progress.update(self._task, total=work, completed=done)

    def worked(self, work: float, what: str) -> None:
        """Moves the bar on."""
        self._progress.update(self._task, advance=work, description=what)

    def say(self, sentence: str) -> None:
        """Writes a line."""
        self._console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def chosen(self, number: int, reason: str, bits: float | None) -> None:
        """Says why a movement is made."""
        expected = "" if bits is None else f"; {information_in_words(bits)}"
        self.say(f"Interaction {number + 1} {reason}{expected}.")

    def moving(self, number: int, phase: str, fraction: float) -> None:
        """Shows the phase of the motion."""
        description = f"interaction {number + 1}: {phase} {fraction:4.0%}"
        self._progress.update(self._task, description=description)

    def observed(self, number: int, observation: Observation) -> None:
        """Says what was measured."""
        readings = (modality.say(observation) for modality in MODALITIES.values())
        self.say(f"Interaction {number + 1}: {', '.join(readings)}.")

    def may_retry(self, error: RobotError) -> bool:
        """Asks the person in front of the screen, if there is one."""
        if not self._interactive:
            return False
        self._progress.stop()
        try:
            self._console.print(str(error), style="yellow", markup=False)
            self._console.input("Press Enter to try again, or Ctrl-C to stop. ")
        except EOFError:
            return False
        self._progress.start()
        return True
