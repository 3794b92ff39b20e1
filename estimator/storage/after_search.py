"""What a run stores when its search is over: the last word on its models, and what they predict."""

from __future__ import annotations

import json
from typing import Final, TypeVar

from pydantic import BaseModel

from estimator.readings.observation import Observation
from estimator.storage.database import RunDatabase, reading, transaction
from estimator.storage.records import BestFit, Finish, Prediction, Ticket, performed

_Record = TypeVar("_Record", bound=BaseModel)

_NOTHING: Final = "null"


class SearchEnd:
    """What is stored at the end of a run's search; empty before."""

    def __init__(self, database: RunDatabase):
        self._database = database

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
        with reading(self._database.directory):
            return None if text in (None, _NOTHING) else kind.model_validate_json(text)

    def _text(self, key: str) -> str | None:
        with reading(self._database.directory):
            return self._database.meta(key)


class Validations:
    """The validations of a run, numbered from 0: what was predicted, and what was observed then.

    Args:
        database: Database of the run.
        joints: Number of the robot's joints.
    """

    def __init__(self, database: RunDatabase, joints: int):
        self._database = database
        self._joints = joints

    def predict(self, predictions: list[Prediction]) -> int:
        """Commits predictions of motor programs not yet performed; returns the validation's number.

        They cannot be changed afterwards, so a prediction is never made with the outcome in view.
        """
        with transaction(self._database):
            (number,) = self._database.execute(
                "SELECT COALESCE(MAX(validation) + 1, 0) FROM predictions"
            ).fetchone()
            self._database.executemany(
                "INSERT INTO predictions (validation, number, program, readings) "
                "VALUES (?, ?, ?, ?)",
                [
                    (number, index, json.dumps(item.program), json.dumps(item.readings))
                    for index, item in enumerate(predictions)
                ],
            )
        return int(number)

    def ask(self, validation: int, number: int, ticket: Ticket | None) -> None:
        """Commits the request id under which a predicted motor program is about to be asked for."""
        with transaction(self._database):
            self._database.execute(
                "UPDATE predictions SET request_id = ?, session = ? "
                "WHERE validation = ? AND number = ?",
                (ticket and ticket.request_id, ticket and ticket.session, validation, number),
            )

    def observe(self, validation: int, number: int, observation: Observation) -> None:
        """Commits what a predicted motor program returned."""
        with transaction(self._database):
            self._database.execute(
                "UPDATE predictions SET observation = ? WHERE validation = ? AND number = ?",
                (observation.model_dump_json(), validation, number),
            )

    def all(self) -> list[list[Prediction]]:
        """The predictions of each validation, with the observations made so far."""
        by_validation: dict[int, list[Prediction]] = {}
        with reading(self._database.directory):
            rows = self._database.execute(
                "SELECT validation, readings, program, request_id, session, observation "
                "FROM predictions ORDER BY validation, number"
            )
            for validation, readings, *columns in rows:
                prediction = Prediction(
                    readings=json.loads(readings), **performed(self._joints, *columns)
                )
                by_validation.setdefault(validation, []).append(prediction)
        return list(by_validation.values())
