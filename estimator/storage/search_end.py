"""What came of a population when its search was over."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from estimator.storage.database import reading, transaction
from estimator.storage.records import BestFit, Finish

_Record = TypeVar("_Record", bound=BaseModel)


class SearchEnd:
    """The end of a run's search; nothing of it is there before.

    Args:
        database: The run's.
        directory: The run directory, for sentences.
    """

    def __init__(self, database: sqlite3.Connection, directory: Path):
        self._database = database
        self._directory = directory

    def save_finish(self, finish: Finish) -> None:
        """Commits the reference back-end's simulation of the leading models."""
        self._save("finish", finish)

    def finish(self) -> Finish | None:
        """The reference back-end's simulation of the leading models; ``None``: not done."""
        return self._saved("finish", Finish)

    def save_best_fit(self, fit: BestFit) -> None:
        """Commits how the best model explains the readings."""
        self._save("best fit", fit)

    def best_fit(self) -> BestFit | None:
        """How the best model explains the readings; ``None``: it was not judged."""
        return self._saved("best fit", BestFit)

    def _save(self, key: str, record: BaseModel) -> None:
        with transaction(self._database):
            self._database.execute(
                "INSERT INTO meta VALUES (?, ?)", (key, record.model_dump_json())
            )

    def _saved(self, key: str, kind: type[_Record]) -> _Record | None:
        with reading(self._directory):
            row = self._database.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
            return None if row is None else kind.model_validate_json(row[0])
