"""A run as one line of a list."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from estimator.evaluation.score import Score
from estimator.evaluation.validate import Validation
from estimator.report.evaluation_files import read_document, read_score, read_validation
from estimator.report.result import Result
from estimator.report.run_files import RESULT
from estimator.report.tables.terminal import number
from estimator.reproduction.runs.plan import PlannedRun


@dataclass(frozen=True, kw_only=True)
class Summary:
    """One run, finished or not.

    Attributes:
        run: What was planned.
        failure: Why it is not finished; ``None`` where it is.
        result: The run in numbers.
        score: Its best model against the truth.
        validation: Its prediction errors, where any were asked for.
    """

    run: PlannedRun
    failure: str | None
    result: Result | None = None
    score: Score | None = None
    validation: Validation | None = None

    @classmethod
    def read(cls, run: PlannedRun, root: Path, failure: str | None = None) -> Self:
        """Reads the files of a run; ``failure`` is what is known of why it is not finished."""
        directory = run.directory(root)
        result, score = read_document(directory / RESULT, Result), read_score(directory)
        validation = read_validation(directory)
        if result is None or score is None or (run.predicts and validation is None):
            return cls(run=run, failure=failure or "not finished")
        return cls(run=run, failure=None, result=result, score=score, validation=validation)

    @property
    def sentence(self) -> str:
        """How the run went."""
        if self.result is None or self.score is None:
            return f"failed: {self.failure}"
        right = ""
        if self.score.configurations_informative:
            right = (
                f", {self.score.configurations_right} of {self.score.configurations_total} "
                "configurations right"
            )
        return (
            f"error {number(self.result.sensor_error)}, legs wrong by "
            f"{self.score.mean_leg_error_m * 1000:.0f} mm{right}, {self.result.wall_seconds:.0f} s"
        )
