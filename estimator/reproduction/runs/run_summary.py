"""A run as one line of a list."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from estimator.evaluation.score import Score
from estimator.evaluation.validate import Validation
from estimator.report.result import Result
from estimator.report.terminal_tables import number
from estimator.reproduction.runs.plan import PlannedRun
from estimator.reproduction.runs.single_run import documents


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


def summarise(run: PlannedRun, root: Path, failure: str | None) -> Summary:
    """Reads a run's summary; ``failure`` is what is known of why it is not finished."""
    written = documents(run, root)
    if written is None:
        return Summary(run=run, failure=failure or "not finished")
    return Summary(
        run=run,
        failure=None,
        result=written.result,
        score=written.score,
        validation=written.validation,
    )
