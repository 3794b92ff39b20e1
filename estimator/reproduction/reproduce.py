"""Completes the runs that figures need, and draws the figures."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from estimator.cluster import Cluster
from estimator.errors import EstimatorError
from estimator.identification.method import Listener
from estimator.physics.backends import physics_class
from estimator.report.evaluations import TRUTH
from estimator.report.result import PAGE
from estimator.reproduction import figure2, figure3, figure4, figure5, figure6
from estimator.reproduction.claims_table import ClaimsTable
from estimator.reproduction.figure import DrawnFigure
from estimator.reproduction.harness import complete
from estimator.reproduction.paper_claims import Samples, Share
from estimator.reproduction.paper_runs import FIGURES, SEEDS, Budget, Summary, planned_runs
from estimator.reproduction.report import reproduction_page, write_report
from estimator.reproduction.robot_process import print_body
from protocol.system.files import replace_text


def figures_of(name: str) -> tuple[str, ...]:
    """The figures that a name on the command line stands for.

    Raises:
        EstimatorError: There is no such figure.
    """
    if name == "all":
        return FIGURES
    if name not in FIGURES:
        raise EstimatorError(f"there is no {name!r}: choose {', '.join(FIGURES)} or all")
    return (name,)


def reproduce(
    root: Path,
    figures: Collection[str],
    listener: Listener,
    *,
    runs: int | None = None,
    budget: Budget | None = None,
    jobs: int = 1,
    cluster: Cluster | None = None,
    command: str = "",
) -> Mapping[str, str]:
    """Completes the runs that figures need, resuming those that are begun, and draws the figures.

    Args:
        root: The reproduction's directory.
        figures: Names of figures, some of ``paper_runs.FIGURES``.
        listener: Hears what happens.
        runs: Number of seeds of Figures 3 to 6; ``None``: the paper's 30 and 10.
        budget: What is asked of every run; ``None``: as in the paper.
        jobs: Number of runs at a time, where there is no cluster.
        cluster: Cluster that does the runs; ``None``: processes of this computer do.
        command: The command as it was typed.

    Returns:
        Why runs could not be finished, by name of the run.

    Raises:
        BodyschemaError: Something prevents it; the message says what. Runs that fail do not.
    """
    budget = budget or Budget()
    physics_class(budget.physics)
    if runs is not None and not 1 <= runs <= len(SEEDS):
        raise EstimatorError(f"--runs must lie in 1 to {len(SEEDS)}, not {runs}")
    if (budget.population or 2) % 2:
        raise EstimatorError(
            f"--population must be even, not {budget.population}: models mate in pairs"
        )
    planned = planned_runs(figures, runs, budget)
    completed = complete(
        root,
        planned,
        listener,
        jobs=jobs,
        cluster=cluster,
        command=command,
        asked=budget.in_words,
        shared={TRUTH: print_body},
    )
    listener.say("Drawing.")
    drawn, claims = _draw(root, figures, runs, budget)
    write_report(
        root,
        budget=budget,
        sessions=completed.sessions,
        figures=drawn,
        claims=claims,
        runs=[Summary.read(run, root, completed.failures.get(run.name)) for run in planned],
    )
    replace_text(root / PAGE, reproduction_page(root))
    return completed.failures


def _draw(
    root: Path, figures: Collection[str], runs: int | None, budget: Budget
) -> tuple[tuple[DrawnFigure, ...], ClaimsTable | None]:
    samples: Samples | None = None
    successes: Share | None = None
    drawn = []
    if "fig2" in figures:
        drawn.append(figure2.make(root, budget))
    if "fig3" in figures:
        figure_3, samples = figure3.make(root, budget, runs)
        drawn.append(figure_3)
    if "fig4" in figures:
        drawn.append(figure4.make(root, budget, runs))
    if "fig5" in figures:
        drawn.append(figure5.make(root, budget, runs))
    if "fig6" in figures:
        figure_6, successes = figure6.make(root, budget, runs, "fig6")
        drawn.append(figure_6)
    if "fig6-8x4" in figures:
        figure_6, _ = figure6.make(root, budget, runs, "fig6-8x4")
        drawn.append(figure_6)
    if samples is None and successes is None:
        return tuple(drawn), None
    table = ClaimsTable.of(samples, successes)
    table.write(root)
    return tuple(drawn), table
