"""Threads that share out rows of arrays, for compiled functions that release the interpreter."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import TypeVar

from protocol.system.process import Closable

Result = TypeVar("Result")


class Threads(Closable):
    """A group of threads; a context manager, which ends them. New work starts new ones.

    Args:
        jobs: How many, at least 1.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._executor: ThreadPoolExecutor | None = None

    def share_out(
        self, function: Callable[[int, int], Result], count: int, *, fewest: int
    ) -> list[Result]:
        """Calls a function with the start and the end of each thread's rows.

        Args:
            function: Works on its rows as if there were no others.
            count: Of rows.
            fewest: Rows that are worth waking a thread for.

        Returns:
            The results, in the order of the rows.
        """
        pieces = min(self._jobs, max(1, count // fewest))
        if pieces == 1:
            return [function(0, count)]
        if self._executor is None:
            self._executor = ThreadPoolExecutor(self._jobs, thread_name_prefix="rows")
        ends = [count * piece // pieces for piece in range(pieces + 1)]
        work = [self._executor.submit(function, start, end) for start, end in pairwise(ends)]
        return [piece.result() for piece in work]

    def close(self) -> None:
        """Ends the threads; may be called twice."""
        if self._executor is not None:
            self._executor.shutdown()
            self._executor = None
