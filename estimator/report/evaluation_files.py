"""What evaluations leave beside a run: ``validation.json``, ``score.json`` and ``truth.urdf``.

Only reports read them; the search never does. A file that is missing, damaged or of another version
counts as none.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel, ValidationError

from estimator.errors import TruthError
from estimator.evaluation.score import Score
from estimator.evaluation.truth.urdf import Urdf, read_urdf
from estimator.evaluation.validate import Validation
from estimator.report.result import Result
from protocol.system.files import replace_text

SCORE: Final = "score.json"
TRUTH: Final = "truth.urdf"
VALIDATION: Final = "validation.json"

_Document = TypeVar("_Document", bound=BaseModel)


def write_score(directory: Path, score: Score, truth: Path) -> None:
    """Keeps a run's score, and the body that it was scored against.

    Raises:
        OSError: The directory cannot be written.
    """
    replace_text(directory / TRUTH, truth.read_text("utf-8"))
    replace_text(directory / SCORE, score.model_dump_json(indent=2) + "\n")


def read_score(directory: Path) -> Score | None:
    """A run's score."""
    return read_document(directory / SCORE, Score)


def score_of(directory: Path, result: Result) -> Score | None:
    """A run's score, if the run has not gone on since."""
    score, lengths = read_score(directory), [leg.length_m for leg in result.legs]
    return score if score and score.is_of(result.complete, lengths) else None


def read_validation(directory: Path) -> Validation | None:
    """A run's prediction errors."""
    return read_document(directory / VALIDATION, Validation)


def read_true_body(directory: Path) -> Urdf | None:
    """The body that a run was scored against."""
    try:
        return read_urdf(directory / TRUTH)
    except (OSError, TruthError):
        return None


def read_document(file: Path, kind: type[_Document]) -> _Document | None:
    """A document; ``None`` where there is none, or one that is damaged or of another version."""
    try:
        return kind.model_validate_json(file.read_bytes())
    except (OSError, ValidationError):
        return None
