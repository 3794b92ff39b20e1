"""Report of a reproduction: ``report.md``, the same as a page, and ``runs.csv`` with every run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from estimator.errors import RunDirectoryError
from estimator.physics.backends import REFERENCE
from estimator.readings.modalities import MODALITIES
from estimator.report.page.templates import picture, render
from estimator.report.tables import number
from estimator.reproduction.claims_table import ClaimsTable
from estimator.reproduction.figure import DrawnFigure
from estimator.reproduction.harness import in_words, made_by
from estimator.reproduction.ledger import Session
from estimator.reproduction.paper_runs import (
    PARAMETRIC,
    PARAMETRIC_RUNS,
    TOPOLOGICAL,
    TOPOLOGICAL_8X4,
    TOPOLOGICAL_RUNS,
    Budget,
    Summary,
)
from estimator.reproduction.tables import markdown, write_csv
from protocol.system.files import replace_text
from protocol.text import command_line

REPORT: Final = "report.md"
HEADER: Final = (
    *("problem", "modalities", "seed", "finished", "sensor_error"),
    *("true_bodys_sensor_error", "mean_leg_error_m"),
    *("mean_leg_error_touched_m", "mean_leg_error_never_touched_m"),
    *("configurations_right", "configurations_right_up_to_equivalence", "configurations_total"),
    *("touch_error", "tilt_error_deg", "clearance_error_mm"),
    *("simulations_requested", "simulations_run", "simulations_invalid", "simulations_undecided"),
    *("wall_seconds", "failure"),
)
_COLUMNS: Final = (
    *("run", "error", "the truth's", "legs wrong by (mm)", "right", "up to equivalence"),
    *("predictions wrong by", "simulations requested", "simulated", "s"),
)


def write_report(
    root: Path,
    *,
    budget: Budget,
    sessions: Sequence[Session],
    figures: Sequence[DrawnFigure],
    claims: ClaimsTable | None,
    runs: Sequence[Summary],
) -> None:
    """Writes ``report.md`` and ``runs.csv``.

    Args:
        root: The reproduction's directory.
        budget: What was asked of every run.
        sessions: The starts of the command that made the runs.
        figures: The figures as drawn.
        claims: Verdicts on the paper's claims, if any figure bears on them.
        runs: All runs, failed ones included.
    """
    write_csv(root / "runs.csv", HEADER, map(_csv_row, runs))
    paragraphs = [
        "# Reproduction of Bongard, Zykov and Lipson (2006)",
        *_how(root, budget, sessions, runs),
    ]
    if claims is not None:
        paragraphs += ["## Claims", *claims.markdown()]
    for figure in figures:
        paragraphs.append(f"## Figure {figure.name.removeprefix('fig')}")
        if figure.complete:
            paragraphs.append(f"![Figure {figure.name.removeprefix('fig')}]({figure.name}.png)")
        paragraphs += [f"*{figure.caption}*", *figure.sentences]
        if figure.complete:
            paragraphs.append(
                f"Numbers: [{figure.name}.csv]({figure.name}.csv), "
                f"[{figure.name}.json]({figure.name}.json)."
            )
    paragraphs += ["## Runs", *_runs(runs)]
    replace_text(root / REPORT, "\n\n".join(paragraphs) + "\n")


def reproduction_page(root: Path) -> str:
    """Returns the report as a page of HTML.

    Args:
        root: The reproduction's directory.

    Raises:
        RunDirectoryError: There is no report.
    """
    try:
        text = (root / REPORT).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunDirectoryError(
            f"{root} holds no reproduction: {REPORT} cannot be read ({error}). Make one with "
            f"`{command_line('estimator', 'reproduce', 'all', '--out', root)}`; of a single run, "
            "leave out --paper."
        ) from error
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(text)
    for token in tokens:
        for child in token.children or ():
            _contain(child, root)
    body = Markup(parser.renderer.render(tokens, parser.options, {}))  # the parser escapes all HTML
    return render("reproduction.html", body=body)


def _how(
    root: Path, budget: Budget, sessions: Sequence[Session], runs: Sequence[Summary]
) -> list[str]:
    finished = [summary.result for summary in runs if summary.result is not None]
    seeds = sorted({summary.run.seed for summary in runs})
    requested = sum(result.simulations_requested for result in finished)
    simulated = sum(result.simulations_run for result in finished)
    invalid = sum(result.simulations_invalid or 0 for result in finished)
    undecided = sum(result.simulations_undecided or 0 for result in finished)
    used = sorted(
        {
            ", ".join(f"{name} {version}" for name, version in sorted(result.versions.items()))
            for result in finished
        }
    )
    commands = "\n".join(
        f"- `{item.command}` ({item.started}, {item.jobs} at a time, {in_words(item.seconds)})"
        for item in sessions
    )
    note = "The paper's budgets: population, generations, interactions as in the problems."
    if not budget.is_the_papers:
        cut = ", ".join(
            f"{name} {value}"
            for name in ("interactions", "population", "generations")
            if (value := getattr(budget, name)) is not None
        )
        note = f"**Not the paper's budgets**: {cut}. So nothing here says anything about the paper."
    last_word = ""
    if budget.physics != REFERENCE:
        last_word = (
            f"; in the end the leading models of each run are simulated in {REFERENCE}, whose "
            "ranking counts"
        )
    return [
        "Made by:\n\n" + commands,
        f"Physics: {budget.physics}{last_word}. {note} Motor programs are random, as the paper's.",
        f"{len(finished)} of {len(runs)} runs finished, seeds {seeds[0]} to {seeds[-1]}: "
        f"{_counts(runs)}. Each went through the protocol, with a sim-robotd process of its own "
        "whose noise has the run's seed.",
        f"Wall clock: {in_words(sum(item.seconds for item in sessions))}; the runs' own times "
        f"add up to {in_words(sum(result.wall_seconds for result in finished))}. "
        f"{requested:,} simulations requested, {simulated:,} simulated; of these {invalid:,} were "
        f"invalid and {undecided:,} undecided.",
        *(f"Versions: {item}." for item in used),
        made_by(root, [summary.run for summary in runs if summary.failure is None]),
    ]


def _counts(runs: Sequence[Summary]) -> str:
    """How many runs there are of each kind, beside the paper's numbers."""
    papers = {
        PARAMETRIC: PARAMETRIC_RUNS,
        TOPOLOGICAL: TOPOLOGICAL_RUNS,
        TOPOLOGICAL_8X4: TOPOLOGICAL_RUNS,
    }
    counts = []
    for problem, papers_runs in papers.items():
        planned = [summary.run for summary in runs if summary.run.problem == problem]
        variants = len({run.variant for run in planned})
        if variants > 1:
            counts.append(
                f"{len(planned)} {problem}, {variants} variants; the paper: {papers_runs} each"
            )
        elif planned:
            counts.append(f"{len(planned)} {problem}; the paper: {papers_runs}")
    return ". ".join(counts)


def _runs(runs: Sequence[Summary]) -> list[str]:
    failed = [item for item in runs if item.failure is not None]
    paragraphs = []
    if failed:
        lines = "\n".join(f"- {item.run.name}: {item.failure}" for item in failed)
        paragraphs.append(
            f"**{len(failed)} of {len(runs)} runs are not finished** and missing above; the same "
            f"command tries them again:\n\n{lines}"
        )
    return [
        *paragraphs,
        "Error: subjective error of the best model; the truth's: of the true body, had it been a "
        "model. Right: configurations of the best model. "
        "Predictions: of 20 fresh motor programs: share of touch bits, tilt, clearance.",
        markdown(_COLUMNS, map(_markdown_row, runs)),
    ]


def _markdown_row(item: Summary) -> tuple[str, ...]:
    if item.result is None or item.score is None:
        return item.run.name, "not finished", *[""] * (len(_COLUMNS) - 2)
    errors = item.validation and item.validation.best_model
    predictions = "–"
    if errors and None not in errors.values():
        terms = MODALITIES.values()
        predictions = ", ".join(term.say_error(errors[term.error_name]) for term in terms)
    score, result = item.score, item.result
    total = score.configurations_total
    searched = score.configurations_informative > 0
    return (
        item.run.name,
        number(result.sensor_error),
        number(score.true_body_error),
        f"{score.mean_leg_error_m * 1000:.1f}",
        f"{score.configurations_right} of {total}" if searched else "–",
        f"{score.configurations_right_up_to_equivalence} of {total}" if searched else "–",
        predictions,
        f"{result.simulations_requested:,}",
        f"{result.simulations_run:,}",
        f"{result.wall_seconds:.0f}",
    )


def _csv_row(item: Summary) -> tuple[object, ...]:
    run, result, score = item.run, item.result, item.score
    errors = item.validation and item.validation.best_model
    return (
        *(run.problem, run.variant.name, run.seed, int(item.failure is None)),
        result and result.sensor_error,
        score and score.true_body_error,
        score and score.mean_leg_error_m,
        score and score.mean_leg_error_touched_m,
        score and score.mean_leg_error_never_touched_m,
        score and score.configurations_right,
        score and score.configurations_right_up_to_equivalence,
        score and score.configurations_total,
        *(errors and errors[modality.error_name] for modality in MODALITIES.values()),
        result and result.simulations_requested,
        result and result.simulations_run,
        result and result.simulations_invalid,
        result and result.simulations_undecided,
        result and round(result.wall_seconds, 3),
        item.failure,
    )


def _contain(item: Token, root: Path) -> None:
    """Embeds a picture in the page; of one that does not exist the text alone stays."""
    if item.type != "image":
        return
    file = root / Path(str(item.attrs["src"])).name
    item.attrs["src"] = picture(file.read_bytes()) if file.is_file() else ""
