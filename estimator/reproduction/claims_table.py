"""The claims table as files and as Markdown."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Final

from estimator.report.tables import mm
from estimator.reproduction.figure import write_json
from estimator.reproduction.paper_claims import (
    SIGNIFICANT,
    STATEMENTS,
    SUCCESS_WORDS,
    TILT_ALONE,
    TILT_ALONE_DOES_NOT,
    TILT_ALONE_SUFFICES,
    MeanDifference,
    Samples,
    Share,
    SuccessRateComparison,
    TiltAloneComparison,
    VariantComparison,
    judge,
    judge_successes,
    tilt_alone,
    verdict_on,
)
from estimator.reproduction.paper_runs import VARIANTS
from estimator.reproduction.tables import markdown, write_csv

NAME: Final = "claims"
HEADER: Final = (
    *("panel", "better", "worse", "pairs", "mean_better_m", "mean_worse_m"),
    *("mean_difference_m", "mean_difference_low_m", "mean_difference_high_m"),
    *("p", "p_holm", "p_holm_opposite", "verdict"),
)

_COLUMNS: Final = (
    *("better", "than", "pairs", "means (mm)", "difference (mm)", "p", "p, Holm", "verdict"),
)


@dataclass(frozen=True, kw_only=True)
class ClaimsTable:
    """Verdicts on all claims; what was not run is empty or ``None``."""

    findings: tuple[VariantComparison, ...]
    asides: tuple[TiltAloneComparison, ...]
    successes: SuccessRateComparison | None

    @classmethod
    def of(cls, samples: Samples | None, successes: Share | None) -> ClaimsTable:
        """Judges what was run."""
        return cls(
            findings=() if samples is None else judge(samples),
            asides=() if samples is None else tilt_alone(samples),
            successes=None if successes is None else judge_successes(successes),
        )

    def write(self, root: Path) -> None:
        """Writes ``claims.csv`` and ``claims.json``."""
        rows = [
            (
                *(finding.panel, finding.better, finding.worse, finding.pairs, *finding.means),
                *(astuple(finding.difference) if finding.difference else (None, None, None)),
                *(finding.p, finding.corrected, finding.corrected_opposite, finding.verdict),
            )
            for finding in self.findings
        ]
        write_csv(root / f"{NAME}.csv", HEADER, rows)
        write_json(root / f"{NAME}.json", asdict(self))

    def markdown(self) -> list[str]:
        """The table for people, as paragraphs."""
        paragraphs = []
        for statement in STATEMENTS if self.findings else ():
            findings = [finding for finding in self.findings if finding.panel == statement.panel]
            held = sum(finding.verdict == "holds" for finding in findings)
            paragraphs += [
                f"**Figure {statement.panel}: {verdict_on(statement, findings)}** "
                f'({held} of {len(findings)} hold). "{statement.words}"',
                markdown(_COLUMNS, map(_row, findings)),
            ]
        if self.findings:
            paragraphs += [
                "Runs are compared in pairs, seed by seed, at the end of the last iteration: "
                "one-sided Wilcoxon signed-rank tests, Holm's correction over all "
                f"{len(self.findings)}; *holds* and *contradicted* (the opposite, corrected alike) "
                f"mean p < {SIGNIFICANT:g}. The claims were declared before any run, the paired "
                "test chosen afterwards. Difference: mean of first minus second, below 0 for the "
                "paper and above 0 against it, with its 95 % interval (bootstrap, bias-corrected "
                "and accelerated), each by itself and not corrected for their number.",
                *self._tilt_alone(),
            ]
        if self.successes is not None:
            paragraphs.append(_successes(self.successes))
        return paragraphs

    def _tilt_alone(self) -> list[str]:
        start = (
            "**Does tilt alone suffice? The paper says both.** Of Figure 3a: "
            f'"{TILT_ALONE_SUFFICES}". In its conclusions: "{TILT_ALONE_DOES_NOT}". So neither is '
            "in the table as a claim. What was found (two-sided, not corrected):"
        )
        return [start, "\n".join(f"- {_aside(item)}" for item in self.asides)]


def _row(item: VariantComparison) -> tuple[str, ...]:
    return (
        _variant(item.better),
        _variant(item.worse),
        f"{item.pairs}",
        f"{mm(item.means[0])}, {mm(item.means[1])}",
        _difference(item.difference),
        _p(item.p),
        _p(item.corrected),
        item.verdict,
    )


def _aside(item: TiltAloneComparison) -> str:
    if item.p is None:
        return f"Figure {item.panel}: not run."
    of_tilt, of_other = item.means
    verdict = "not told apart from"
    if item.p < SIGNIFICANT and of_tilt is not None and of_other is not None:
        verdict = "better than" if of_tilt < of_other else "worse than"
    return (
        f"Figure {item.panel}: variant {_variant(TILT_ALONE)} is {verdict} {_variant(item.other)}: "
        f"{mm(of_tilt)} against {mm(of_other)} mm, difference {_difference(item.difference)}, "
        f"p = {_p(item.p)}."
    )


def _successes(item: SuccessRateComparison) -> str:
    ours, papers = item.ours, item.papers
    needed = "more runs"
    if item.refuting is not None:
        needed = f"at least {item.refuting} successes in {ours.trials} runs"
    return (
        f'**Figure 6: {item.verdict}.** "{SUCCESS_WORDS}". Ours: {ours.successes} of '
        f"{ours.trials}, 95 % interval {ours.low:.0%} to {ours.high:.0%} (Wilson); the paper's "
        f"{papers.successes} of {papers.trials}: {papers.low:.0%} to {papers.high:.0%}. Fisher's "
        f"exact test, two-sided: p = {_p(item.p)}; *contradicted* means p < {SIGNIFICANT:g}. *Not "
        f"refuted* says only that these runs cannot tell the two rates apart: to show ours to be "
        f"higher would have taken {needed}."
    )


def _variant(number: int) -> str:
    return f"{number} ({', '.join(VARIANTS[number - 1].modalities)})"


def _difference(item: MeanDifference | None) -> str:
    if item is None:
        return "–"
    mean = f"{item.mean * 1000:+.1f}"
    if item.low is None or item.high is None:
        return mean
    return f"{mean} ({item.low * 1000:+.1f} to {item.high * 1000:+.1f})"


def _p(value: float | None) -> str:
    if value is None:
        return "–"
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}"
