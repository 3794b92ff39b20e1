"""What a run stores of its population when its search is over."""

from __future__ import annotations

from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel

from estimator.storage.database import RunDatabase, reading, transaction
from estimator.storage.records import BestFit, Finish

_Record = TypeVar("_Record", bound=BaseModel)

_NOTHING: Final = "null"


class SearchEnd:
    """What is stored at the end of a run's search; empty before.

    Args:
        database: Database of the run.
        directory: Run directory, for messages.
    """

    def __init__(self, database: RunDatabase, directory: Path):
        self._database = database
        self._directory = directory

    def save_finish(self, finish: Finish) -> None:
        """Commits the reference back-end's simulation of the leading models."""
        self._save("finish", finish)

    def finish(self) -> Finish | None:
        """The reference back-end's simulation of the leading models; ``None``: not done."""
        return self._saved("finish", Finish)

    def save_best_fit(self, fit: BestFit | None) -> None:
        """Commits how the best model explains the readings, with which the run is over.

        Args:
            fit: ``None`` where no model has valid readings.
        """
        self._save("best fit", fit)

    def best_fit(self) -> BestFit | None:
        """How the best model explains the readings; ``None``: it was not judged."""
        return self._saved("best fit", BestFit)

    @property
    def is_reached(self) -> bool:
        """Whether the best model was judged, or none could be: nothing is left to do."""
        return self._text("best fit") is not None

    def _save(self, key: str, record: BaseModel | None) -> None:
        text = _NOTHING if record is None else record.model_dump_json(round_trip=True)
        with transaction(self._database):
            self._database.execute("INSERT INTO meta VALUES (?, ?)", (key, text))

    def _saved(self, key: str, kind: type[_Record]) -> _Record | None:
        text = self._text(key)
        with reading(self._directory):
            return None if text in (None, _NOTHING) else kind.model_validate_json(text)

    def _text(self, key: str) -> str | None:
        with reading(self._directory):
            row = self._database.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
            return None if row is None else str(row[0])
