"""What the paper claims, declared before any run, and what our runs say about it.

A claim about Figure 3 is that the models of one variant tend to be better than those of another at
the end of the last iteration. Each is tested one-sided; all of them together are corrected for
their number, and so are the opposite tests:

* *holds*: models are better, corrected p below 0.05;
* *contradicted*: they are worse, corrected p below 0.05;
* *not shown*: neither.

All variants meet the same seeds, so runs are compared in pairs: Wilcoxon's signed-rank test on the
differences, seed by seed. The claims were declared before any run; the paired test came later, in
place of Mann and Whitney's for independent samples, when the results were known.

All tests are SciPy's, which takes as long to load as all the rest of the command, so it is loaded
where it is needed.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

_RESAMPLES: Final = 9999
_SEED: Final = 0


@dataclass(frozen=True, kw_only=True)
class Share:
    """Successes out of trials, with the 95 % interval of their rate (Wilson 1927)."""

    successes: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class MeanDifference:
    """Mean of paired differences with its 95 % interval; no interval where there is one pair."""

    mean: float
    low: float | None
    high: float | None


def share(successes: int, trials: int) -> Share:
    """A rate with its 95 % interval."""
    interval = _scipy().binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return Share(
        successes=successes, trials=trials, low=float(interval.low), high=float(interval.high)
    )


def signed_rank(differences: Sequence[float], alternative: Literal["less", "two-sided"]) -> float:
    """Returns p of Wilcoxon's signed-rank test; ``less``: that differences tend to be negative.

    Pairs without a difference are left out, as Wilcoxon did.
    """
    if not any(differences):
        return 1.0
    return float(_scipy().wilcoxon(differences, alternative=alternative).pvalue)


def mean_difference(differences: Sequence[float]) -> MeanDifference:
    """The mean of paired differences with its bootstrap interval.

    Differences of model quality are skewed: most are small, and a few runs go astray. The
    bias-corrected and accelerated bootstrap (Efron 1987) allows for that; its random source is
    fixed.
    """
    mean = float(np.mean(differences))
    if min(differences) == max(differences):
        bound = mean if len(differences) > 1 else None
        return MeanDifference(mean=mean, low=bound, high=bound)
    interval = (
        _scipy()
        .bootstrap((differences,), np.mean, n_resamples=_RESAMPLES, method="BCa", rng=_SEED)
        .confidence_interval
    )
    return MeanDifference(mean=mean, low=float(interval.low), high=float(interval.high))


def holm(values: Sequence[float]) -> list[float]:
    """Values of p corrected for their number (Holm 1979), in the order given."""
    order = sorted(range(len(values)), key=lambda index: values[index])
    corrected = [0.0] * len(values)
    highest = 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(values) - rank) * values[index]))
        corrected[index] = highest
    return corrected


def rates_differ(one: Share, other: Share) -> float:
    """Two-sided p of Fisher's exact test that two rates are the same."""
    table = [[rate.successes, rate.trials - rate.successes] for rate in (one, other)]
    return float(_scipy().fisher_exact(table).pvalue)


def mean_and_deviation(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Mean and standard deviation of a sample; ``None`` where there are too few values."""
    mean = float(np.mean(values)) if len(values) else None
    return mean, float(np.std(values, ddof=1)) if len(values) > 1 else None


def _scipy() -> Any:
    return importlib.import_module("scipy.stats")


SIGNIFICANT: Final = 0.05

ClaimVerdict: TypeAlias = Literal["holds", "not shown", "contradicted"]
SuccessVerdict: TypeAlias = Literal["not refuted", "contradicted"]
Panel: TypeAlias = Literal["3a", "3b"]
Samples: TypeAlias = Mapping[tuple[Panel, int], Mapping[int, float]]
"""For each panel and number of a variant, model quality by seed; smaller is better."""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A sentence of the paper: each of some variants is claimed to be better than each of others.

    Attributes:
        panel: Panel of Figure 3, which decides how quality is measured.
        words: The paper's own words.
        better: Numbers of the variants that are claimed to be better.
        worse: Numbers of the variants that they are claimed to be better than.
    """

    panel: Panel
    words: str
    better: tuple[int, ...]
    worse: tuple[int, ...]


STATEMENTS: Final = (
    Statement(
        panel="3a",
        words=(
            "for the experiment variants that included tilt information in calculating model "
            "quality (columns 1, 2, 4 and 6), evolved models were more accurate than when tilt "
            "information was excluded from the calculation (columns 3, 5 and 7)"
        ),
        better=(1, 2, 4, 6),
        worse=(3, 5, 7),
    ),
    Statement(
        panel="3b",
        words=(
            "when both tilt and clearance sensor data is available (columns 1 and 2), models are "
            "better than when either of these sensor modalities is not available (columns 3-7)"
        ),
        better=(1, 2),
        worse=(3, 4, 5, 6, 7),
    ),
)

PAPERS_SUCCESSES: Final = 1
PAPERS_RUNS: Final = 10
SUCCESS_WORDS: Final = (
    "constrained to nine identification iterations, only one of the 10 independent runs performed "
    "found all 12 of the correct local configurations"
)

TILT_ALONE_SUFFICES: Final = "only the tilt sensor data is required in order to produce good models"
TILT_ALONE_DOES_NOT: Final = (
    "neither the tilt nor clearance sensor data explicitly report the length of the robot's legs, "
    "but both modalities are required by the model synthesis process to produce accurate models"
)
TILT_ALONE: Final = 6
TILT_AND_MORE: Final = (1, 2)


@dataclass(frozen=True, kw_only=True)
class VariantComparison:
    """One claim of the table.

    Attributes:
        panel: Panel of Figure 3.
        better: Number of the variant that is claimed to be better.
        worse: Number of the variant that is claimed to be worse.
        pairs: Number of seeds that both variants were run with.
        means: Mean quality of the better and of the worse variant on these seeds, m.
        difference: Mean quality of the first minus that of the second, m; below 0 the first is
            better. ``None`` without a pair.
        p: p of the one-sided test that the first is better, not corrected; ``None`` without a pair.
        corrected: p after Holm's correction.
        corrected_opposite: p of the test that the first is worse, after Holm's correction.
        verdict: Verdict on the claim.
    """

    panel: Panel
    better: int
    worse: int
    pairs: int
    means: tuple[float | None, float | None]
    difference: MeanDifference | None
    p: float | None
    corrected: float | None
    corrected_opposite: float | None
    verdict: ClaimVerdict


@dataclass(frozen=True, kw_only=True)
class TiltAloneComparison:
    """Models that know tilt alone, compared with models that know more.

    This is no claim, for the paper says both that tilt alone suffices and that it does not.

    Attributes:
        panel: Panel of Figure 3.
        other: Number of the variant that tilt alone is compared with.
        means: Mean quality of tilt alone and of the other on the seeds that both were run with, m.
        difference: Mean quality of tilt alone minus that of the other, m; ``None`` without a pair.
        p: p of the two-sided test that they do not differ, not corrected; ``None`` without a pair.
    """

    panel: Panel
    other: int
    means: tuple[float | None, float | None]
    difference: MeanDifference | None
    p: float | None


@dataclass(frozen=True, kw_only=True)
class SuccessRateComparison:
    """How often all configurations were found, beside the paper's 1 in 10.

    Attributes:
        ours: Our rate.
        papers: The paper's.
        p: p of the two-sided test that the two rates are the same.
        verdict: Verdict on the paper's rate.
        refuting: The fewest successes above the paper's rate that would have contradicted it in
            this many runs; ``None`` where no number could.
    """

    ours: Share
    papers: Share
    p: float
    verdict: SuccessVerdict
    refuting: int | None


@dataclass(frozen=True)
class _Paired:
    """Quality of two variants on the seeds that both were run with."""

    one: tuple[float, ...]
    other: tuple[float, ...]

    @classmethod
    def of(cls, samples: Samples, panel: Panel, one: int, other: int) -> _Paired:
        first, second = samples.get((panel, one), {}), samples.get((panel, other), {})
        seeds = sorted(first.keys() & second.keys())
        return cls(tuple(first[seed] for seed in seeds), tuple(second[seed] for seed in seeds))

    def __len__(self) -> int:
        return len(self.one)

    @property
    def means(self) -> tuple[float | None, float | None]:
        return mean_and_deviation(self.one)[0], mean_and_deviation(self.other)[0]

    @property
    def differences(self) -> list[float]:
        return [a - b for a, b in zip(self.one, self.other, strict=True)]

    @property
    def mean_difference(self) -> MeanDifference | None:
        return mean_difference(self.differences) if len(self) else None


def judge(samples: Samples) -> tuple[VariantComparison, ...]:
    """The verdict on every claim about Figure 3."""
    claims = [
        (statement.panel, better, worse)
        for statement in STATEMENTS
        for better in statement.better
        for worse in statement.worse
    ]
    pairs = [_Paired.of(samples, *claim) for claim in claims]
    tested = [index for index, pair in enumerate(pairs) if len(pair)]
    differences = [pairs[index].differences for index in tested]
    p_values = [signed_rank(values, "less") for values in differences]
    opposite = [signed_rank([-value for value in values], "less") for values in differences]
    triples = zip(p_values, holm(p_values), holm(opposite), strict=True)
    corrected = dict(zip(tested, triples, strict=True))
    comparisons = []
    for index, ((panel, better, worse), pair) in enumerate(zip(claims, pairs, strict=True)):
        p, p_holm, p_opposite = corrected.get(index, (None, None, None))
        comparisons.append(
            VariantComparison(
                panel=panel,
                better=better,
                worse=worse,
                pairs=len(pair),
                means=pair.means,
                difference=pair.mean_difference,
                p=p,
                corrected=p_holm,
                corrected_opposite=p_opposite,
                verdict=_verdict(p_holm, p_opposite),
            )
        )
    return tuple(comparisons)


def verdict_on(statement: Statement, comparisons: Sequence[VariantComparison]) -> ClaimVerdict:
    """The verdict on a sentence of the paper: that on its weakest claim."""
    verdicts = {item.verdict for item in comparisons if item.panel == statement.panel}
    if "contradicted" in verdicts:
        return "contradicted"
    return "holds" if verdicts == {"holds"} else "not shown"


def tilt_alone(samples: Samples) -> tuple[TiltAloneComparison, ...]:
    """How models that know tilt alone compare with those that know more."""
    panels: tuple[Panel, ...] = ("3a", "3b")
    asides = []
    for panel in panels:
        for number in TILT_AND_MORE:
            pair = _Paired.of(samples, panel, TILT_ALONE, number)
            asides.append(
                TiltAloneComparison(
                    panel=panel,
                    other=number,
                    means=pair.means,
                    difference=pair.mean_difference,
                    p=signed_rank(pair.differences, "two-sided") if len(pair) else None,
                )
            )
    return tuple(asides)


def judge_successes(ours: Share) -> SuccessRateComparison:
    """The verdict on the paper's success rate.

    It is contradicted where the two rates differ significantly. Otherwise it is not refuted, which
    is little: few runs leave room for almost any rate.
    """
    papers = share(PAPERS_SUCCESSES, PAPERS_RUNS)
    p = rates_differ(ours, papers)
    rate = papers.successes / papers.trials
    counts = range(math.ceil(rate * ours.trials), ours.trials + 1)
    refuting = (
        count for count in counts if rates_differ(share(count, ours.trials), papers) < SIGNIFICANT
    )
    return SuccessRateComparison(
        ours=ours,
        papers=papers,
        p=p,
        verdict="contradicted" if p < SIGNIFICANT else "not refuted",
        refuting=next(refuting, None),
    )


def _verdict(less: float | None, more: float | None) -> ClaimVerdict:
    if less is not None and less < SIGNIFICANT:
        return "holds"
    if more is not None and more < SIGNIFICANT:
        return "contradicted"
    return "not shown"
