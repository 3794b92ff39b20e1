"""Completes the runs that figures need, and draws the figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from estimator.errors import EstimatorError, RunDirectoryError
from estimator.identification.listener import Listener
from estimator.parallel.cluster import Cluster
from estimator.physics.backends import abilities_of
from estimator.report.evaluation_files import TRUTH
from estimator.report.run_files import PAGE
from estimator.reproduction.claims.claims_table import ClaimsTable
from estimator.reproduction.claims.paper_claims import Samples
from estimator.reproduction.claims.statistics import Share
from estimator.reproduction.figures import figure2, figure3, figure4, figure5, figure6
from estimator.reproduction.figures.figure import DrawnFigure
from estimator.reproduction.page import reproduction_page
from estimator.reproduction.report import write_report
from estimator.reproduction.runs.finished_run import FinishedRuns
from estimator.reproduction.runs.ledger import Ledger
from estimator.reproduction.runs.plan import (
    FIGURES,
    SEEDS,
    Budget,
    PlannedRun,
    planned_runs,
    work_of,
)
from estimator.reproduction.runs.progress import OverallProgress
from estimator.reproduction.runs.robot_process import print_body
from estimator.reproduction.runs.run_processes import Ended, Said, Worked, Workers
from estimator.reproduction.runs.run_summary import Summary
from estimator.reproduction.runs.runs_on_cluster import ClusterWorkers
from estimator.reproduction.runs.single_run import is_finished, work_done
from protocol.system.files import replace_text


@dataclass(frozen=True, kw_only=True)
class ReproductionRequest:
    """Which figures to reproduce, and how.

    Attributes:
        figures: Some of ``plan.FIGURES``.
        runs: Seeds of Figures 3 to 6; ``None``: the paper's 30 and 10.
        budget: What is asked of every run.
        jobs: Runs at a time, where there is no cluster.
        command: As it was typed.
    """

    figures: tuple[str, ...]
    runs: int | None = None
    budget: Budget = field(default_factory=Budget)
    jobs: int = 1
    command: str = ""


@dataclass(frozen=True, kw_only=True)
class ReproductionResult:
    """The outcome of a reproduction.

    Attributes:
        figures: As drawn.
        claims: The claims table; ``None`` where no figure bears on it.
        failures: Runs that could not be finished, with the reason.
    """

    figures: tuple[DrawnFigure, ...]
    claims: ClaimsTable | None
    failures: dict[PlannedRun, str]


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
    root: Path, request: ReproductionRequest, listener: Listener, *, cluster: Cluster | None = None
) -> ReproductionResult:
    """Completes the runs that figures need, resuming those that are begun, and draws the figures.

    Args:
        root: The reproduction's directory.
        request: What is asked for.
        listener: Hears what happens.
        cluster: Where to do the runs; ``None``: in processes of this computer.

    Raises:
        BodyschemaError: Something prevents it; the message says what. Runs that fail do not: they
            are listed in the outcome.
    """
    _check(request)
    jobs = request.jobs if cluster is None else cluster.workers
    workers = Workers(jobs, root) if cluster is None else ClusterWorkers(cluster, root)
    with Ledger(root, request.budget, command=request.command, jobs=jobs) as ledger:
        _keep_truth(root)
        runs = planned_runs(request.figures, request.runs, request.budget)
        try:
            failures = _do(root, runs, workers, listener, ledger)
        except KeyboardInterrupt:
            listener.say("Nothing is lost: the same command goes on from here.")
            raise
        listener.say("Drawing.")
        finished_runs = FinishedRuns(root)
        drawn, claims = _draw(finished_runs, request)
        summaries = [Summary.read(run, root, failures.get(run)) for run in runs]
        write_report(
            root,
            budget=request.budget,
            sessions=ledger.sessions,
            figures=drawn,
            claims=claims,
            runs=summaries,
        )
        replace_text(root / PAGE, reproduction_page(root))
    return ReproductionResult(figures=drawn, claims=claims, failures=failures)


def _check(request: ReproductionRequest) -> None:
    abilities_of(request.budget.physics)
    if request.runs is not None and not 1 <= request.runs <= len(SEEDS):
        raise EstimatorError(f"--runs must lie in 1 to {len(SEEDS)}, not {request.runs}")
    if (request.budget.population or 2) % 2:
        raise EstimatorError(
            f"--population must be even, not {request.budget.population}: models mate in pairs"
        )


def _keep_truth(root: Path) -> None:
    body, path = print_body(), root / TRUTH
    if not path.exists():
        replace_text(path, body)
    elif path.read_text("utf-8") != body:
        raise RunDirectoryError(
            f"The simulated robot has another body than the one of the runs in {root}: give "
            "another --out."
        )


def _do(
    root: Path,
    runs: Sequence[PlannedRun],
    workers: Workers | ClusterWorkers,
    listener: Listener,
    ledger: Ledger,
) -> dict[PlannedRun, str]:
    """Completes the unfinished runs; returns those that failed, with the reason."""
    left = [run for run in runs if not is_finished(run, root)]
    if len(left) < len(runs):
        listener.say(f"{len(runs) - len(left)} of {len(runs)} runs are finished already.")
    progress = OverallProgress(
        listener,
        {run: work_of(run) for run in left},
        {run: work_done(run, root) for run in left},
    )
    failures = {}
    with workers:
        for run, news in workers.do(left):
            if isinstance(news, Worked):
                progress.worked(run, news.work)
            elif isinstance(news, Said):
                listener.say(f"{run.name}: {news.sentence}")
            elif isinstance(news, Ended):
                if news.failure is not None:
                    failures[run] = news.failure
                progress.ended(run, Summary.read(run, root, news.failure).sentence)
                ledger.note()
    return failures


def _draw(
    finished_runs: FinishedRuns, request: ReproductionRequest
) -> tuple[tuple[DrawnFigure, ...], ClaimsTable | None]:
    budget, runs, asked = request.budget, request.runs, request.figures
    samples: Samples | None = None
    successes: Share | None = None
    drawn = []
    if "fig2" in asked:
        drawn.append(figure2.make(finished_runs, budget))
    if "fig3" in asked:
        models = figure3.make(finished_runs, budget, runs)
        samples = models.samples
        drawn.append(models.drawn)
    if "fig4" in asked:
        drawn.append(figure4.make(finished_runs, budget, runs))
    if "fig5" in asked:
        drawn.append(figure5.make(finished_runs, budget, runs))
    if "fig6" in asked:
        counted, successes = figure6.make(finished_runs, budget, runs, figure6.FOUR_BY_FOUR)
        drawn.append(counted)
    if "fig6-8x4" in asked:
        counted, _ = figure6.make(finished_runs, budget, runs, figure6.EIGHT_BY_FOUR)
        drawn.append(counted)
    if samples is None and successes is None:
        return tuple(drawn), None
    table = ClaimsTable.of(samples, successes)
    table.write(finished_runs.root)
    return tuple(drawn), table
