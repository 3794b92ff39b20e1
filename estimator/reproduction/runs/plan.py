"""Which runs the paper's figures need: seeds, variants, budgets. Fixed here, before any run.

Reported results use the seeds 1000 to 1029, on which nothing was ever tuned. A seed decides a run's
motor programs, its search and the simulated robot's noise. Every variant meets the same seeds, and
so the same motor programs: variants differ in what they are told about the same movements.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from estimator.identification.order import Order
from estimator.physics.backends import REFERENCE
from estimator.problem.problem import Problem

SEEDS: Final = tuple(range(1000, 1030))
PARAMETRIC: Final = "parametric"
TOPOLOGICAL: Final = "topological"
TOPOLOGICAL_8X4: Final = "topological-20"  # the genome of the paper's text
PARAMETRIC_RUNS: Final = 30
TOPOLOGICAL_RUNS: Final = 10  # the paper's; up to 30 on request
PREDICTIONS: Final = 20
"""Fresh motor programs that each topological run predicts in the end."""

FIGURES: Final = ("fig2", "fig3", "fig4", "fig5", "fig6", "fig6-8x4")


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


class Budget(BaseModel):
    """What is asked of every run; ``None`` is the problem's own choice, which is the paper's.

    Attributes:
        physics: Back-end that predicts what models feel.
        interactions: Interactions with the robot.
        population: Models in the population.
        generations: Generations after each interaction.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    physics: str = REFERENCE
    interactions: int | None = Field(default=None, ge=1)
    population: int | None = Field(default=None, ge=2)
    generations: int | None = Field(default=None, ge=1)

    @property
    def is_the_papers(self) -> bool:
        """Whether nothing was cut or added."""
        return self.interactions is self.population is self.generations is None


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run.

    Attributes:
        problem: Name of the problem.
        variant: Modalities that count.
        seed: Source of all its randomness, and of the robot's noise.
        budget: What is asked of it.
    """

    problem: str
    variant: Variant
    seed: int
    budget: Budget

    @property
    def name(self) -> str:
        """For people, and as the run's place below a reproduction's directory."""
        return f"{self.problem}/{self.variant.name}/{self.seed}"

    @property
    def predicts(self) -> int:
        """How many fresh motor programs it predicts in the end."""
        return 0 if self.problem == PARAMETRIC else PREDICTIONS

    def directory(self, root: Path) -> Path:
        """Its run directory."""
        return root / "runs" / self.name

    def order(self, robot: str) -> Order:
        """What to ask for, of a robot at a given address."""
        return Order(
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


def work_of(run: PlannedRun) -> int:
    """How much work a run is, in simulations, before any early verdict."""
    search, budget = Problem.load(run.problem).search, run.budget
    interactions = budget.interactions or search.interactions
    population = budget.population or search.population
    generations = budget.generations or search.generations
    pairs = interactions * (interactions + 1) // 2
    return population * (interactions + generations * pairs + run.predicts)


def planned_runs(
    figures: Collection[str], runs: int | None, budget: Budget
) -> tuple[PlannedRun, ...]:
    """The runs that some figures need, the longest first, each once.

    Args:
        figures: Some of ``FIGURES``.
        runs: How many seeds of Figures 3 to 6; default: the paper's 30 and 10.
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
        PlannedRun(problem=problem, variant=ALL_MODALITIES, seed=seed, budget=budget)
        for seed in SEEDS[: runs or TOPOLOGICAL_RUNS]
    )
