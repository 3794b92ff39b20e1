"""What the paper claims, declared before any run, and what our runs say about it.

A claim about Figure 3 is that the models of one variant tend to be better than those of another at
the end of the last iteration. Each is tested one-sided; all of them together are corrected for
their number, and so are the opposite tests:

* *holds*: models are better, corrected p below 0.05;
* *contradicted*: they are worse, corrected p below 0.05;
* *not shown*: neither.

All variants meet the same seeds, so the samples of two variants are not independent but positively
correlated, which makes the tests err on the side of *not shown*.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from estimator.reproduction.statistics import (
    Share,
    different,
    holm,
    rates_differ,
    share,
    smaller,
)

SIGNIFICANT: Final = 0.05

Verdict: TypeAlias = Literal["holds", "not shown", "contradicted"]
Panel: TypeAlias = Literal["3a", "3b"]
Samples: TypeAlias = Mapping[tuple[Panel, int], Sequence[float]]
"""Model quality of each run, smaller is better, by panel and number of the variant."""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A sentence of the paper, and what it claims: each of some variants is better than each other.

    Attributes:
        panel: Of Figure 3; it decides how quality is measured.
        words: The paper's own.
        better: Numbers of the variants that are claimed to be better.
        worse: Than these.
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

PAPERS_SUCCESSES: Final = share(1, 10)
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
class Finding:
    """One claim of the table.

    Attributes:
        panel: Of Figure 3.
        better: Number of the variant that is claimed to be better.
        worse: Number of the other.
        runs: Runs of each.
        means: Mean quality of each, m.
        p: That the first is better, one-sided, not corrected; ``None`` where a sample is empty.
        corrected: The same after Holm's correction.
        corrected_opposite: That the first is worse, after Holm's correction.
        verdict: What follows.
    """

    panel: Panel
    better: int
    worse: int
    runs: tuple[int, int]
    means: tuple[float | None, float | None]
    p: float | None
    corrected: float | None
    corrected_opposite: float | None
    verdict: Verdict


@dataclass(frozen=True, kw_only=True)
class Aside:
    """Tilt alone beside tilt with more.

    No claim, for the paper says both that tilt alone suffices and that it does not.

    Attributes:
        panel: Of Figure 3.
        other: Number of the variant that tilt alone is compared with.
        means: Mean quality of tilt alone and of the other, m.
        p: That they do not differ, two-sided, not corrected.
    """

    panel: Panel
    other: int
    means: tuple[float | None, float | None]
    p: float | None


@dataclass(frozen=True, kw_only=True)
class SuccessFinding:
    """How often all configurations were found, beside the paper's 1 in 10."""

    ours: Share
    papers: Share
    p: float
    verdict: Verdict


def judge(samples: Samples) -> tuple[Finding, ...]:
    """The verdict on every claim about Figure 3."""
    claims = [
        (statement.panel, better, worse)
        for statement in STATEMENTS
        for better in statement.better
        for worse in statement.worse
    ]
    pairs = [
        (samples.get((panel, better), ()), samples.get((panel, worse), ()))
        for panel, better, worse in claims
    ]
    tested = [index for index, pair in enumerate(pairs) if all(map(len, pair))]
    values = [smaller(*pairs[index]) for index in tested]
    opposite = [smaller(*reversed(pairs[index])) for index in tested]
    triples = zip(values, holm(values), holm(opposite), strict=True)
    corrected = dict(zip(tested, triples, strict=True))
    found = []
    for index, ((panel, better, worse), pair) in enumerate(zip(claims, pairs, strict=True)):
        p, less, more = corrected.get(index, (None, None, None))
        found.append(
            Finding(
                panel=panel,
                better=better,
                worse=worse,
                runs=(len(pair[0]), len(pair[1])),
                means=(_mean(pair[0]), _mean(pair[1])),
                p=p,
                corrected=less,
                corrected_opposite=more,
                verdict=_verdict(less, more),
            )
        )
    return tuple(found)


def overall(statement: Statement, findings: Sequence[Finding]) -> Verdict:
    """The verdict on a sentence of the paper: that on its weakest claim."""
    verdicts = {item.verdict for item in findings if item.panel == statement.panel}
    if "contradicted" in verdicts:
        return "contradicted"
    return "holds" if verdicts == {"holds"} else "not shown"


def tilt_alone(samples: Samples) -> tuple[Aside, ...]:
    """How models that know tilt alone compare with those that know more."""
    panels: tuple[Panel, ...] = ("3a", "3b")
    found = []
    for panel in panels:
        alone = samples.get((panel, TILT_ALONE), ())
        for number in TILT_AND_MORE:
            other = samples.get((panel, number), ())
            known = len(alone) and len(other)
            found.append(
                Aside(
                    panel=panel,
                    other=number,
                    means=(_mean(alone), _mean(other)),
                    p=different(alone, other) if known else None,
                )
            )
    return tuple(found)


def judge_successes(ours: Share) -> SuccessFinding:
    """The verdict on the paper's success rate.

    It is contradicted where the two rates differ significantly. It holds where ours leaves room for
    1 in 10, after at least as many runs as the paper's: the interval of a few leaves room for
    anything. Otherwise it is not shown.
    """
    p = rates_differ(ours, PAPERS_SUCCESSES)
    rate = PAPERS_SUCCESSES.successes / PAPERS_SUCCESSES.trials
    verdict: Verdict = "not shown"
    if p < SIGNIFICANT:
        verdict = "contradicted"
    elif ours.low <= rate <= ours.high and ours.trials >= PAPERS_SUCCESSES.trials:
        verdict = "holds"
    return SuccessFinding(ours=ours, papers=PAPERS_SUCCESSES, p=p, verdict=verdict)


def _verdict(less: float | None, more: float | None) -> Verdict:
    if less is not None and less < SIGNIFICANT:
        return "holds"
    if more is not None and more < SIGNIFICANT:
        return "contradicted"
    return "not shown"


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None
