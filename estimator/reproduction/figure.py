"""What all figures have in common; their files, each written as a whole or not at all."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from estimator.reproduction.finished_run import FinishedRun
from protocol.system.replace_file import replace_file, replace_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = tuple[object, ...]


@dataclass(frozen=True, kw_only=True)
class DrawnFigure:
    """A figure as the report shows it.

    Attributes:
        name: Stem of its files, such as ``fig2``.
        caption: What is to be seen.
        sentences: What came out, in words.
        complete: Whether there is a picture; if not, the sentences say why.
    """

    name: str
    caption: str
    sentences: tuple[str, ...]
    complete: bool = True


def write_figure(
    root: Path,
    name: str,
    picture: Figure,
    *,
    header: tuple[str, ...],
    rows: Sequence[Row],
    numbers: dict[str, Any],
) -> None:
    """The three files of a figure."""
    write_csv(root / f"{name}.csv", header, rows)
    write_json(root / f"{name}.json", numbers)
    write_png(root / f"{name}.png", picture)


HISTORY: tuple[str, ...] = ("panel", "generation", "iteration", "quantity", "of", "value")
"""Columns of a table of errors and lengths over generations."""


def history_rows(run: FinishedRun, panels: tuple[str, str]) -> Iterator[Row]:
    """Every model's error, and the best model's leg lengths, of every generation.

    Args:
        run: The run.
        panels: Names of the panel of errors and of that of lengths.
    """
    for item in run.generations:
        for model, error in enumerate(item.errors, start=1):
            known = f"{error:.6g}" if math.isfinite(error) else None
            yield panels[0], item.number, item.iteration + 1, "subjective_error", model, known
    for item in run.generations:
        lengths = run.best_lengths(item).tolist()
        for joint, length in zip(run.score.joints, lengths, strict=True):
            value = f"{length:.6g}"
            yield panels[1], item.number, item.iteration + 1, "leg_length_m", joint, value


def _finite(error: float) -> float | None:
    """An error for JSON; ``None`` for a model that could not be simulated."""
    return error if math.isfinite(error) else None


def history_numbers(run: FinishedRun) -> dict[str, Any]:
    """A run at the end of each iteration."""
    ends = run.iteration_ends
    return {
        "seed": run.planned.seed,
        "modalities": list(run.planned.variant.modalities),
        "joints": list(run.score.joints),
        "true_lengths_m": list(run.score.true_lengths_m),
        "last_generations": [item.number for item in ends],
        "best_errors": [_finite(min(item.errors)) for item in ends],
        "best_lengths_m": [run.best_lengths(item).tolist() for item in ends],
    }


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI: Final = 150


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table; ``None`` becomes an empty cell."""

    def write(fresh: Path) -> None:
        with fresh.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows(rows)

    replace_file(path, write)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Numbers for programs."""
    replace_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_png(path: Path, figure: Figure) -> None:
    """A picture; the version of Matplotlib does not enter it."""
    replace_file(path, lambda fresh: figure.savefig(fresh, dpi=_DPI, metadata={"Software": None}))
