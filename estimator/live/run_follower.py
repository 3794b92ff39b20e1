"""Follows a run directory that another process writes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from estimator.errors import RunDirectoryError
from estimator.live.run_view import RunState, RunView
from estimator.storage.database import file_status
from estimator.storage.locking import is_locked
from estimator.storage.store import LOCK, RunStore

_AT_LEAST: Final = 0.5  # s between two readings
_IDLE: Final = 20  # times as long as a reading takes: it has no more than 5 % of a core
_SILENT: Final = 3.0  # s without news, after which it is asked whether anybody still writes


class RunFollower:
    """Reads a run again whenever it has changed. It neither writes nor keeps the writer waiting.

    Args:
        directory: The run directory.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._seen: tuple[int, int] | None = None
        self._next = 0.0
        self._view: RunView | None = None

    def news(self) -> RunView | None:
        """How the run stands, or ``None`` where that is known already.

        Raises:
            RunDirectoryError: There is no run, or it is damaged.
        """
        now = time.monotonic()
        if now < self._next:
            return None
        self._next = now + _AT_LEAST
        stamp = self._stamp()
        silent = stamp == self._seen
        if silent and (self._view is None or self._view.state is not RunState.GOES_ON):
            return None
        written_to = is_locked(self._directory, LOCK)
        if silent and written_to:
            self._next = now + _SILENT
            return None
        with RunStore.open(self._directory, to_write=False) as store:
            view = RunView.of(store, written_to=written_to)
        self._seen, self._view = stamp, view
        took = time.monotonic() - now
        self._next = now + max(_AT_LEAST, _IDLE * took)
        return view

    def _stamp(self) -> tuple[int, int]:
        """What changes with every transaction."""
        now = file_status(self._directory)
        if now is None:
            raise RunDirectoryError(
                f"{self._directory} holds no run. Start one with `estimator identify`."
            )
        return now.st_mtime_ns, now.st_size
