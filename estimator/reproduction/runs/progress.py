"""How far a whole reproduction is, and how long the rest will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from estimator.identification.listener import Listener
from estimator.reproduction.runs.plan import PlannedRun


class OverallProgress:
    """Progress over all runs, by work rather than by number: runs differ a hundredfold.

    Args:
        listener: Is told.
        works: The work of each run, in simulations.
        done: How much of it was done before.
        clock: Wall clock, s.
    """

    def __init__(
        self,
        listener: Listener,
        works: Mapping[PlannedRun, float],
        done: Mapping[PlannedRun, float],
        clock: Callable[[], float] = time.monotonic,
    ):
        self._listener = listener
        self._works = dict(works)
        self._done = {run: min(done.get(run, 0.0), work) for run, work in works.items()}
        self._ended = 0
        self._before = sum(self._done.values())
        self._clock = clock
        self._started = clock()
        listener.expect(sum(self._works.values()), self._before)

    def worked(self, run: PlannedRun, work: float) -> None:
        """Some of a run's work is done."""
        self._add(run, min(work, self._works[run] - self._done[run]))

    def ended(self, run: PlannedRun, sentence: str) -> None:
        """A run is over; the sentence says how it went."""
        self._ended += 1
        self._add(run, self._works[run] - self._done[run])
        left = self.seconds_left()
        later = "" if not left else f"; {in_words(left)} left"
        total = len(self._works)
        self._listener.say(f"{self._ended}/{total} {run.name}: {sentence}{later}")

    def seconds_left(self) -> float | None:
        """Time that the rest will take at the pace so far, s; ``None`` while there is no pace."""
        done, elapsed = sum(self._done.values()), self._clock() - self._started
        if done <= self._before or elapsed <= 0:
            return None
        return (sum(self._works.values()) - done) * elapsed / (done - self._before)

    def _add(self, run: PlannedRun, work: float) -> None:
        self._done[run] += work
        self._listener.worked(work, f"{self._ended}/{len(self._works)} runs, {run.name}")


def in_words(seconds: float) -> str:
    """A time in words, no more exact than it is known."""
    if seconds < 90:
        return f"about {max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"about {minutes} min"
    return f"about {minutes // 60} h {minutes % 60:02d} min"
