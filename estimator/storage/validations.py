"""Predictions of motor programs not yet performed, and what was observed afterwards."""

from __future__ import annotations

import json
from pathlib import Path

from estimator.readings.observation import Observation
from estimator.storage.database import RunDatabase, reading, transaction
from estimator.storage.records import Prediction, Ticket, performed


class Validations:
    """The validations of a run, numbered from 0.

    Args:
        database: Database of the run.
        directory: Run directory, for messages.
        joints: Number of the robot's joints.
    """

    def __init__(self, database: RunDatabase, directory: Path, joints: int):
        self._database = database
        self._directory = directory
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
        with reading(self._directory):
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
