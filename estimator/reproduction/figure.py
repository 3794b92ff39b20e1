"""What all figures have in common: the finished runs that they read, and their files."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array, Morphology
from estimator.evaluation.attachments import Comparison, Truth
from estimator.evaluation.score import Score
from estimator.evaluation.validate import Validation
from estimator.physics.base import WorldSettings
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.evaluations import TRUTH
from estimator.report.plots import draw_errors, draw_lengths
from estimator.report.result import Result
from estimator.report.summarise import finite
from estimator.reproduction.paper_runs import PlannedRun, Summary
from estimator.reproduction.tables import write_csv
from estimator.storage.records import Generation, InteractionRecord, Prediction
from estimator.storage.store import RunStore
from protocol.system.files import replace_file, replace_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Row = tuple[object, ...]


@dataclass(frozen=True, kw_only=True)
class DrawnFigure:
    """A figure as the report shows it.

    Attributes:
        name: Stem of its files' names, such as ``fig2``.
        caption: What is to be seen.
        sentences: What came out, in words.
        complete: Whether there is a picture; if not, the sentences say why.
    """

    name: str
    caption: str
    sentences: tuple[str, ...]
    complete: bool = True

    @classmethod
    def missing(cls, name: str, caption: str, why: str = "All runs are missing.") -> DrawnFigure:
        """A figure without a picture, for want of finished runs."""
        return cls(name=name, caption=caption, sentences=(why,), complete=False)


def write_figure(
    root: Path,
    name: str,
    picture: Figure,
    *,
    header: tuple[str, ...],
    rows: Sequence[Row],
    numbers: dict[str, Any],
) -> None:
    """Writes the three files of a figure: table, numbers and picture."""
    write_csv(root / f"{name}.csv", header, rows)
    write_json(root / f"{name}.json", numbers)
    replace_file(  # without the version of Matplotlib
        root / f"{name}.png",
        lambda fresh: picture.savefig(fresh, dpi=_DPI, metadata={"Software": None}),
    )


HISTORY: tuple[str, ...] = ("panel", "generation", "iteration", "quantity", "of", "value")
"""Columns of a table of errors and lengths over generations."""


def history_rows(run: FinishedRun, panels: tuple[str, str]) -> Iterator[Row]:
    """Rows of a table: each model's error and the best model's leg lengths, of every generation.

    Args:
        run: The run.
        panels: Name of the panel of errors, and of the panel of lengths.
    """
    for item in run.generations:
        for model, error in enumerate(item.errors, start=1):
            error_text = f"{error:.6g}" if math.isfinite(error) else None
            yield panels[0], item.number, item.iteration + 1, "subjective_error", model, error_text
    for item in run.generations:
        lengths = run.best_lengths(item).tolist()
        for joint, length in zip(run.score.joints, lengths, strict=True):
            length_text = f"{length:.6g}"
            yield panels[1], item.number, item.iteration + 1, "leg_length_m", joint, length_text


def history_numbers(run: FinishedRun) -> dict[str, Any]:
    """Numbers of a run at the end of each iteration."""
    ends = run.iteration_ends
    return {
        "seed": run.planned.seed,
        "modalities": list(run.planned.variant.modalities),
        "joints": list(run.score.joints),
        "true_lengths_m": list(run.score.true_lengths_m),
        "last_generations": [generation.number for generation in ends],
        "best_errors": [finite(min(generation.errors)) for generation in ends],
        "best_lengths_m": [run.best_lengths(generation).tolist() for generation in ends],
    }


_DPI: Final = 150


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes numbers for programs."""
    replace_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


@dataclass(frozen=True, kw_only=True)
class FinishedRun:
    """A run with its score.

    Attributes:
        planned: What was planned.
        problem: Its problem, written out for the robot.
        genome: Genome that decodes its models.
        world: World in which its models are simulated.
        truth: The robot's body, which the search never saw.
        generations: The population after each generation. The best model of the last one is the
            run's, in whose choice the reference back-end has the last word.
        interactions: Interactions performed, with what was observed.
        predictions: Fresh motor programs, predicted and then performed; empty where none were.
        result: The run in numbers.
        score: Score of its final best model against the true body.
        validation: Its prediction errors; ``None`` where nothing was predicted.
    """

    planned: PlannedRun
    problem: Problem
    genome: Genome
    world: WorldSettings
    truth: Truth
    generations: tuple[Generation, ...]
    interactions: tuple[InteractionRecord, ...]
    predictions: tuple[Prediction, ...]
    result: Result
    score: Score
    validation: Validation | None

    @classmethod
    def read(cls, run: PlannedRun, root: Path) -> FinishedRun:
        """Reads a run that is finished."""
        summary = Summary.read(run, root)
        assert summary.result is not None
        assert summary.score is not None
        with RunStore.open(run.directory(root), to_write=False) as store:
            validations = store.validations.all()
            return cls(
                planned=run,
                problem=store.problem,
                genome=store.genome,
                world=store.world,
                truth=Truth.read(root / TRUTH, store.problem, store.capabilities),
                generations=_generations(store),
                interactions=tuple(store.interactions()),
                predictions=tuple(validations[-1]) if validations else (),
                result=summary.result,
                score=summary.score,
                validation=summary.validation,
            )

    @property
    def iteration_ends(self) -> tuple[Generation, ...]:
        """The last generation of each iteration."""
        return tuple({item.iteration: item for item in self.generations}.values())

    @property
    def true_lengths(self) -> Array:
        """Length of each leg of the robot, m, shape (legs,)."""
        return np.array(self.score.true_lengths_m)

    def best(self, generation: Generation) -> Morphology:
        """The best model of a generation."""
        return self.genome.decode(np.array(generation.best))

    def best_lengths(self, generation: Generation) -> Array:
        """Leg lengths of the best model of a generation, m, shape (legs,)."""
        lengths: Array = leg_lengths([self.best(generation)])[0]
        return lengths

    def draw_history(self, errors: Axes, lengths: Axes) -> None:
        """Draws every model's error, and the best models' leg lengths beside the robot's."""
        draw_errors(errors, self.generations)
        draw_lengths(
            lengths,
            self.generations,
            self.genome,
            self.score.joints,
            targets=self.score.true_lengths_m,
            mounts=[leg.limb.mount for leg in self.truth.legs.values()],
        )

    def configurations_right(self, generation: Generation) -> tuple[bool, ...]:
        """Which configurations the best model of a generation has right, in the genome's order."""
        comparison = Comparison(self.problem, self.genome, self.best(generation), self.truth)
        return tuple(item.right for item in comparison.configurations())

    @property
    def successful(self) -> bool:
        """Whether the final best model has every configuration right."""
        return self.score.configurations_right == self.score.configurations_total


def _generations(store: RunStore) -> tuple[Generation, ...]:
    *earlier, last = store.generations()
    fitted = FittedPosterior.of(store)
    assert fitted is not None
    assert fitted.best is not None
    return *earlier, replace(last, best=tuple(fitted.best.tolist()))


def read_finished(root: Path, runs: Iterable[PlannedRun]) -> Iterator[FinishedRun]:
    """Reads those runs of a reproduction that are finished, one at a time, in the order given."""
    return (FinishedRun.read(run, root) for run in runs if run.is_finished(root))
