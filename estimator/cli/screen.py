"""The progress of a run on the terminal."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

from estimator.identification.method import Listener, information_in_words
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation
from protocol.errors import RobotError


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
