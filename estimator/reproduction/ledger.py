"""The record of a study: what was asked of its runs, the sessions that made them, their commits."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from estimator.errors import RunDirectoryError
from estimator.storage.database import lock
from estimator.versions import commit, versions
from protocol.system.files import replace_text
from protocol.system.process import Closable

RUNS: Final = "runs"
LEDGER: Final = "study.json"
_LOCK_FILE: Final = "study.lock"
_COMMITS_FILE: Final = "made.json"


class Session(BaseModel):
    """One start of the command.

    Attributes:
        command: The command as it was typed.
        started: Time of the start, in UTC.
        jobs: Number of runs at a time.
        seconds: How long it worked, s; of a session that was killed, up to its last finished run.
        commit: Commit of the code.
        versions: Versions of everything that computed, by name.
    """

    model_config = ConfigDict(frozen=True)

    command: str
    started: str
    jobs: int
    seconds: float
    commit: str
    versions: dict[str, str]


class _Content(BaseModel):
    model_config = ConfigDict(frozen=True)

    asked: dict[str, str]
    sessions: tuple[Session, ...] = ()


class Ledger(Closable):
    """The record of a study, whose directory it locks; use it as a context manager.

    Args:
        root: Directory of the study; made if it is not there.
        asked: What all runs of the study must have in common, by name.
        command: The command as it was typed.
        jobs: Number of runs at a time.

    Raises:
        RunDirectoryError: The directory cannot be made, another process works on it, or its runs
            were asked for otherwise.
    """

    def __init__(self, root: Path, asked: Mapping[str, str], command: str, jobs: int):
        self._path = root / LEDGER
        self._started = time.monotonic()
        self._lock = lock(root, _LOCK_FILE)
        try:
            self._content = self._read(dict(asked))
        except BaseException:
            os.close(self._lock)
            raise
        self._session = Session(
            command=command,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            jobs=jobs,
            seconds=0.0,
            commit=commit(),
            versions=versions(),
        )
        self.note()

    def close(self) -> None:
        """Lets others work on the directory."""
        os.close(self._lock)

    @property
    def sessions(self) -> tuple[Session, ...]:
        """All starts of the command, the present one last."""
        seconds = time.monotonic() - self._started
        return (*self._content.sessions, self._session.model_copy(update={"seconds": seconds}))

    def keep(self, name: str, content: str) -> None:
        """Writes a file of the directory that must not change later.

        Raises:
            RunDirectoryError: The file is there with another content.
        """
        path = self._path.with_name(name)
        if not path.exists():
            replace_text(path, content)
        elif path.read_text("utf-8") != content:
            raise RunDirectoryError(
                f"{path} is not what it would be now, so that its runs would not be alike: give "
                "another --out."
            )

    def note(self) -> None:
        """Puts on disk how long this session has worked."""
        content = self._content.model_copy(update={"sessions": self.sessions})
        replace_text(self._path, content.model_dump_json(indent=2) + "\n")

    def _read(self, asked: dict[str, str]) -> _Content:
        root = self._path.parent
        if not self._path.exists():
            if (root / RUNS).exists():
                raise RunDirectoryError(
                    f"{root} holds runs of another version, without {LEDGER}: give another --out."
                )
            return _Content(asked=asked)
        try:
            content = _Content.model_validate_json(self._path.read_text("utf-8"))
        except (OSError, ValidationError) as error:
            raise RunDirectoryError(f"{self._path} is no ledger of a study.") from error
        if content.asked != asked:
            names = sorted({*content.asked, *asked})
            nothing = "nothing"
            differences = ", ".join(
                f"{name} {content.asked.get(name, nothing)}, not {asked.get(name, nothing)}"
                for name in names
                if content.asked.get(name) != asked.get(name)
            )
            raise RunDirectoryError(f"{root} holds runs with {differences}: give another --out.")
        return content


def note_commit(place: Path, *, resumed: bool) -> None:
    """Notes which commit begins or resumes a run, in the run's directory."""
    earlier = commits_of(place) if resumed else ()
    if earlier[-1:] != (commit(),):
        place.mkdir(parents=True, exist_ok=True)
        replace_text(place / _COMMITS_FILE, json.dumps({"commits": [*earlier, commit()]}) + "\n")


def commits_of(place: Path) -> tuple[str, ...]:
    """The commits that had a part in a run, in order; none where nobody knows."""
    try:
        return tuple(map(str, json.loads((place / _COMMITS_FILE).read_text("utf-8"))["commits"]))
    except (OSError, ValueError, KeyError, TypeError):
        return ()
