"""The runs of the paper's figures: which there are, what is asked of each, and what it has left.

Which runs there are (seeds, variants, budgets) was fixed here before any run. Reported results use
the seeds 1000 to 1029, on which nothing was ever tuned. A seed decides a run's motor programs, its
search and the simulated robot's noise. Every variant meets the same seeds, and so the same motor
programs: variants differ in which readings of those movements they are given.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Self

from pydantic import BaseModel, ConfigDict, Field

from estimator.errors import InteractionError, RunDirectoryError
from estimator.evaluation.score import Score, score
from estimator.evaluation.validate import Validation, validate
from estimator.identification.method import Listener
from estimator.identification.run import identify, reconnect, resume
from estimator.physics.backends import REFERENCE, in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.problem.problem import Problem
from estimator.report.evaluations import SCORE, TRUTH, VALIDATION, read_validation
from estimator.report.result import RESULT, Result, read_document, write_document
from estimator.report.run_files import write_report
from estimator.report.tables import number
from estimator.reproduction import harness
from estimator.reproduction.robot_process import RobotProcess, catch_up
from estimator.storage.database import holds_run
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS
from protocol.errors import RobotUnreachableError

_ATTEMPTS: Final = 3  # at reaching the simulated robot, before a run counts as failed; not tuned

_without_plots = partial(write_report, plots=False)


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One experimental variant.

    Attributes:
        number: Its column in Figure 3, from 1.
        modalities: Modalities that the subjective error counts.
    """

    number: int
    modalities: tuple[str, ...]

    @property
    def name(self) -> str:
        """Short name, fit for a directory."""
        return "+".join(self.modalities)


class Budget(BaseModel):
    """What is asked of every run; ``None`` is the problem's own choice, which is the paper's.

    Attributes:
        physics: Back-end that predicts readings.
        interactions: Number of interactions with the robot.
        population: Number of models in the population.
        generations: Number of generations after each interaction.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    physics: str = REFERENCE
    interactions: int | None = Field(default=None, ge=1)
    population: int | None = Field(default=None, ge=2)
    generations: int | None = Field(default=None, ge=1)

    @property
    def is_the_papers(self) -> bool:
        """Whether all numbers are the paper's."""
        return self.interactions is self.population is self.generations is None

    @property
    def in_words(self) -> dict[str, str]:
        """Value of each field by its name, for people."""
        return {name: str(value or "as in the paper") for name, value in self}


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run of a study.

    Attributes:
        problem: Name of the problem.
        variant: Variant, which says what modalities count.
        seed: Seed of the run and of the robot's noise.
        budget: What is asked of the run.
        predicts: Number of fresh motor programs that it predicts in the end.
    """

    problem: str
    variant: Variant
    seed: int
    budget: Budget
    predicts: int = 0

    @property
    def name(self) -> str:
        """Name for people, and the run's path among the runs of the study."""
        return f"{self.problem}/{self.variant.name}/{self.seed}"

    @property
    def work(self) -> float:
        """Amount of work of the run, in simulations; early verdicts save some of it."""
        search, budget = Problem.load(self.problem).search, self.budget
        interactions = budget.interactions or search.interactions
        population = budget.population or search.population
        generations = budget.generations or search.generations
        pairs = interactions * (interactions + 1) // 2
        return population * (interactions + generations * pairs + self.predicts)

    def work_done(self, root: Path) -> float:
        """Amount of its work that is on disk, in simulations."""
        if not holds_run(self.directory(root)):
            return 0.0
        try:
            with RunStore.open(self.directory(root), to_write=False) as store:
                settings, generations = store.settings, store.generations()
                predicted = [item for validation in store.validations.all() for item in validation]
        except RunDirectoryError:
            return 0.0
        length = settings.generations + 1
        searched = sum(item.iteration + 1 if item.number % length else 1 for item in generations)
        performed = sum(item.observation is not None for item in predicted)
        return settings.population * (searched + (len(predicted) + performed) / 2)

    def directory(self, root: Path) -> Path:
        """Directory of the run."""
        return harness.directory(self, root)

    def order(self, robot: str) -> RunConfig:
        """Configuration of the run with a robot at a given address."""
        return RunConfig(
            method="paper",
            robot=robot,
            problem=self.problem,
            seed=self.seed,
            physics=self.budget.physics,
            modalities=self.variant.modalities,
            interactions=self.budget.interactions,
            population=self.budget.population,
            generations=self.budget.generations,
        )

    def is_finished(self, root: Path) -> bool:
        """Whether the run has written all its files."""
        return Summary.read(self, root).failure is None

    def sentence(self, root: Path) -> str:
        """How the run went, in words, once it is finished."""
        summary = Summary.read(self, root)
        result, score = summary.result, summary.score
        assert result is not None
        assert score is not None
        right = (
            f", {score.configurations_right} of {score.configurations_total} configurations right"
        )
        return (
            f"error {number(result.sensor_error)}, legs wrong by "
            f"{score.mean_leg_error_m * 1000:.0f} mm"
            f"{right if score.configurations_informative else ''}, {result.wall_seconds:.0f} s"
        )

    def do(self, root: Path, listener: Listener) -> None:
        """Begins or resumes the run, and finishes it.

        A robot that fails is replaced by a new one, a limited number of times.

        Args:
            root: The study's directory, with the truth in it.
            listener: Hears what happens.

        Raises:
            BodyschemaError: Something prevents it; the message says what.
        """
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                with RobotProcess(self.seed) as robot:
                    self._search_and_validate(root, robot.uri, listener)
                break
            except (InteractionError, RobotUnreachableError) as error:
                if attempt == _ATTEMPTS:
                    raise
                listener.say(f"{error} A new robot is started.")
        self._score(root)

    def _search_and_validate(self, root: Path, uri: str, listener: Listener) -> None:
        directory, quiet = self.directory(root), _WorkOnly(listener)
        if holds_run(directory):
            with RunStore.open(directory, to_write=False) as store:
                catch_up(store, uri)
            resume(directory, IN_THIS_PROCESS, quiet, robot=uri, report=_without_plots)
        else:
            identify(directory, self.order(uri), IN_THIS_PROCESS, quiet, report=_without_plots)
        if self.predicts and read_validation(directory) is None:
            self._validate(directory, uri, quiet)

    def _validate(self, directory: Path, uri: str, listener: Listener) -> None:
        with (
            RunStore.open(directory) as store,
            closing(in_this_process(store.settings.physics, store.world)) as physics,
            closing(reconnect(store, uri, listener)) as link,
        ):
            validation = validate(
                store, physics, link, programs=self.predicts, saved=None, listener=listener
            )
        write_document(directory / VALIDATION, validation)

    def _score(self, root: Path) -> None:
        directory = self.directory(root)
        with (
            RunStore.open(directory, to_write=False) as store,
            StaticsPhysics(store.world) as physics,
            closing(in_this_process(store.settings.reference, store.world)) as reference,
        ):
            run_score = score(store, root / TRUTH, physics, reference)
        write_document(directory / SCORE, run_score)


class _WorkOnly(Listener):
    """Passes on only that work is done, and nothing that is said."""

    def __init__(self, listener: Listener):
        self._listener = listener

    def worked(self, work: float, what: str) -> None:
        self._listener.worked(work, what)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """One run as a line of a list, finished or not.

    Attributes:
        run: What was planned.
        failure: Why it is not finished; ``None`` where it is.
        result: The run in numbers.
        score: Score of its best model against the true body.
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
        result = read_document(directory / RESULT, Result)
        score = read_document(directory / SCORE, Score)
        validation = read_validation(directory)
        if result is None or score is None or (run.predicts and validation is None):
            return cls(run=run, failure=failure or "not finished")
        return cls(run=run, failure=None, result=result, score=score, validation=validation)


SEEDS: Final = tuple(range(1000, 1030))
PARAMETRIC: Final = "parametric"
TOPOLOGICAL: Final = "topological"
TOPOLOGICAL_8X4: Final = "topological-20"  # the genome of the paper's text
PARAMETRIC_RUNS: Final = 30
TOPOLOGICAL_RUNS: Final = 10  # the paper's; up to 30 on request
PREDICTIONS: Final = 20
"""Number of fresh motor programs that each topological run predicts in the end."""

FIGURES: Final = ("fig2", "fig3", "fig4", "fig5", "fig6", "fig6-8x4")


VARIANTS: Final = tuple(
    Variant(number=number, modalities=modalities)
    for number, modalities in enumerate(
        (
            ("touch", "tilt", "clearance"),
            ("tilt", "clearance"),
            ("touch", "clearance"),
            ("touch", "tilt"),
            ("touch",),
            ("tilt",),
            ("clearance",),
        ),
        start=1,
    )
)

ALL_MODALITIES: Final = VARIANTS[0]
TOUCH_AND_TILT: Final = VARIANTS[3]


def planned_runs(
    figures: Collection[str], runs: int | None, budget: Budget
) -> tuple[PlannedRun, ...]:
    """The runs that some figures need, the longest first, each once.

    Args:
        figures: Names of figures, some of ``FIGURES``.
        runs: Number of seeds of Figures 3 to 6; default: the paper's 30 and 10.
        budget: What is asked of every run.
    """
    planned: dict[PlannedRun, None] = {}
    if {"fig4", "fig5", "fig6"} & set(figures):
        planned |= dict.fromkeys(topological_runs(runs, budget))
    if "fig6-8x4" in figures:
        planned |= dict.fromkeys(topological_runs(runs, budget, TOPOLOGICAL_8X4))
    if "fig2" in figures:
        planned |= dict.fromkeys(typical_runs(budget))
    if "fig3" in figures:
        for variant in VARIANTS:
            planned |= dict.fromkeys(parametric_runs(variant, runs, budget))
    return tuple(planned)


def typical_runs(budget: Budget) -> tuple[PlannedRun, ...]:
    """Figure 2's two runs. The paper calls its own typical; ours are those of the first seed."""
    return tuple(
        PlannedRun(problem=PARAMETRIC, variant=variant, seed=SEEDS[0], budget=budget)
        for variant in (ALL_MODALITIES, TOUCH_AND_TILT)
    )


def parametric_runs(variant: Variant, runs: int | None, budget: Budget) -> tuple[PlannedRun, ...]:
    """Figure 3's runs of one variant."""
    return tuple(
        PlannedRun(problem=PARAMETRIC, variant=variant, seed=seed, budget=budget)
        for seed in SEEDS[: runs or PARAMETRIC_RUNS]
    )


def topological_runs(
    runs: int | None, budget: Budget, problem: str = TOPOLOGICAL
) -> tuple[PlannedRun, ...]:
    """The runs of Figures 4, 5 and 6, or of Figure 6 with another genome."""
    return tuple(
        PlannedRun(
            problem=problem,
            variant=ALL_MODALITIES,
            seed=seed,
            budget=budget,
            predicts=PREDICTIONS,
        )
        for seed in SEEDS[: runs or TOPOLOGICAL_RUNS]
    )
