"""The record of a reproduction: the budget of its runs, and every start of the command.

Layout of the directory::

    DIR/
    ├── reproduction.json    budget of all runs, and the sessions in which they were made
    ├── truth.urdf           the simulated robot's body, for the scorer and Figure 5 alone
    ├── runs/PROBLEM/MODALITIES/SEED/    one run directory each
    ├── figN.png, figN.csv, figN.json    each figure
    ├── claims.csv, claims.json          the claims table
    ├── runs.csv             every run
    └── report.md            all of it for people
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from estimator.errors import RunDirectoryError
from estimator.reproduction.runs.plan import Budget
from estimator.storage.locking import lock
from estimator.versions import versions
from protocol.system.files import replace_text
from protocol.system.process import Closable

LEDGER: Final = "reproduction.json"
_LOCK: Final = "reproduction.lock"


class LedgerEntry(BaseModel):
    """One start of the command.

    Attributes:
        command: As it was typed.
        started: When, in UTC.
        jobs: Runs at a time.
        seconds: How long it worked; a session that was killed is known up to its last finished run.
        versions: Of everything that computed.
    """

    model_config = ConfigDict(frozen=True)

    command: str
    started: str
    jobs: int
    seconds: float
    versions: dict[str, str]


class _Content(BaseModel):
    model_config = ConfigDict(frozen=True)

    budget: Budget
    sessions: tuple[LedgerEntry, ...] = ()


class Ledger(Closable):
    """The directory of a reproduction, kept for one process; use it as a context manager.

    Args:
        root: The directory; made if it is not there.
        budget: What is asked of every run.
        command: As it was typed.
        jobs: Runs at a time.
        clock: Wall clock, s.

    Raises:
        RunDirectoryError: It cannot be made, another process works on it, or its runs were asked
            for with another budget.
    """

    def __init__(
        self,
        root: Path,
        budget: Budget,
        *,
        command: str,
        jobs: int,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._path = root / LEDGER
        self._clock = clock
        self._started = clock()
        self._lock = lock(root, _LOCK)
        try:
            self._content = self._read(budget)
        except BaseException:
            os.close(self._lock)
            raise
        now = datetime.now(UTC).isoformat(timespec="seconds")
        self._session = LedgerEntry(
            command=command, started=now, jobs=jobs, seconds=0.0, versions=versions()
        )
        self.note()

    def close(self) -> None:
        """Notes how long the session has worked, and lets others work on the directory."""
        self.note()
        os.close(self._lock)

    @property
    def sessions(self) -> tuple[LedgerEntry, ...]:
        """All starts of the command, the present one last."""
        seconds = self._clock() - self._started
        return (*self._content.sessions, self._session.model_copy(update={"seconds": seconds}))

    def note(self) -> None:
        """Puts on disk how long this session has worked."""
        content = self._content.model_copy(update={"sessions": self.sessions})
        replace_text(self._path, content.model_dump_json(indent=2) + "\n")

    def _read(self, budget: Budget) -> _Content:
        if not self._path.exists():
            return _Content(budget=budget)
        try:
            content = _Content.model_validate_json(self._path.read_text("utf-8"))
        except (OSError, ValidationError) as error:
            raise RunDirectoryError(f"{self._path} is no ledger of a reproduction.") from error
        if content.budget != budget:
            differences = ", ".join(
                f"{name} {getattr(content.budget, name) or 'as in the paper'}, not "
                f"{getattr(budget, name) or 'as in the paper'}"
                for name in Budget.model_fields
                if getattr(content.budget, name) != getattr(budget, name)
            )
            raise RunDirectoryError(
                f"{self._path.parent} holds runs with {differences}: give another --out."
            )
        return content
