"""Which runs the paper's figures need: seeds, variants, budgets. Fixed here, before any run.

Reported results use the seeds 1000 to 1029, on which nothing was ever tuned. A seed decides a run's
motor programs, its search and the simulated robot's noise. Every variant meets the same seeds, and
so the same motor programs: variants differ in what they are told about the same movements.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from estimator.reproduction.paper_run import Budget, PlannedRun, Variant

SEEDS: Final = tuple(range(1000, 1030))
PARAMETRIC: Final = "parametric"
TOPOLOGICAL: Final = "topological"
TOPOLOGICAL_8X4: Final = "topological-20"  # the genome of the paper's text
PARAMETRIC_RUNS: Final = 30
TOPOLOGICAL_RUNS: Final = 10  # the paper's; up to 30 on request
PREDICTIONS: Final = 20
"""Fresh motor programs that each topological run predicts in the end."""

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
        PlannedRun(
            problem=problem,
            variant=ALL_MODALITIES,
            seed=seed,
            budget=budget,
            predicts=PREDICTIONS,
        )
        for seed in SEEDS[: runs or TOPOLOGICAL_RUNS]
    )
