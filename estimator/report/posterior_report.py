"""What a posterior says, in the problem's names: ``posterior`` in ``result.json``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from pydantic import computed_field

from estimator.body.morphology import Array
from estimator.posterior.fitted import Attachment, FittedPosterior
from estimator.posterior.model.sensor_data import SCALED
from estimator.posterior.posterior import quantiles
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.range_ends import LEARNT_WIDTH, PRIOR_WIDTH, LengthAtEnd, lengths_at_ends
from estimator.report.verdict import verdict_on_posterior
from estimator.storage.posteriors import RIVAL, Interval, PosteriorSummary, Record, StoredPosterior
from estimator.storage.store import RunStore

_MAX_RIVALS: Final = 5
_QUANTILES: Final = (0.05, 0.5, 0.95)
_SUM_WIDTH: Final = 0.5  # largest width of a sum's interval, relative to either length's
_VAGUE_WIDTH: Final = 0.02  # m; narrower intervals of single lengths need no sums
_SQUARE: Final = 0.05  # tolerance relative to the longer side; else sensors tell where a leg sits


class Rival(Record):
    """Another set of attachments that explains the readings.

    Attributes:
        probability: Share of the posterior that has these attachments.
        differs: Attachments that differ from the best body's, such as ``mount of leg 1: left``.
        indistinguishable: Whether no sensor can tell these attachments from the best body's.
    """

    probability: float
    differs: tuple[str, ...]
    indistinguishable: bool


class SumOfLengths(Record):
    """The sum of two legs' lengths, known where neither length is, as of parts in line.

    Attributes:
        legs: Indices of the two legs, in motor order, from 0.
        length_m: Sum of the two lengths, m.
    """

    legs: tuple[int, int]
    length_m: Interval


class ParameterEstimate(Record):
    """What the readings say of one parameter in which robots differ a little from what is stated.

    Attributes:
        name: Name of the parameter's row in the table of parameters.
        sentence: Words that complete "a robot with …", with the amount and its interval.
        interval: The amount, a factor or in SI units.
    """

    name: str
    sentence: str
    interval: Interval


class Step(Record):
    """How the posterior changed with one interaction.

    Attributes:
        reason: Why the motor program was chosen.
        expected_gain_bits: Information that the interaction was expected to give, bits.
        information_gain_bits: Information that the interaction gave, bits.
        probability: Stated probability of the attachments afterwards; ``None``: it is not known.
        explained: Whether some body of the problem explained the readings so far.
    """

    reason: str
    expected_gain_bits: float | None
    information_gain_bits: float | None
    probability: float | None
    explained: bool


class PosteriorReport(PosteriorSummary):
    """The posterior after a run's interactions so far.

    Attributes:
        contradictions: Contradictions between the problem and what the robot states of itself.
        verdict: Whether some body of the problem explains the readings, as sentences.
        attachments: Choices that the problem leaves open, each as the best body has it.
        lengths_m: Length of each leg, m, in motor order.
        sums: Sums of two legs' lengths, where the readings determine these but not each length.
        parameters: Parameters in which robots differ a little from what is stated, as far as the
            readings determine them.
        rivals: Other sets of attachments, the most probable first.
        equivalent: Faults of a robot that no movement can tell from the best body.
        noise: Factor on the expected noise of tilt and clearance: what the robot announces,
            together with the error that models leave, 0.2° and 0.8 mm.
        steps: How the posterior changed, one entry per interaction.
        samples: Number of samples that stand for the posterior.
        changes: What has changed since the robot was identified, as sentences.
        at_ends: Lengths that the readings press against an end of the problem's range: until it is
            widened, or more movements tell, the body does not count as found.
    """

    contradictions: tuple[str, ...]
    verdict: str
    attachments: tuple[Attachment, ...]
    lengths_m: tuple[Interval, ...]
    sums: tuple[SumOfLengths, ...]
    parameters: tuple[ParameterEstimate, ...]
    rivals: tuple[Rival, ...]
    equivalent: tuple[str, ...]
    noise: dict[str, Interval]
    steps: tuple[Step, ...]
    samples: int
    changes: tuple[str, ...] = ()
    at_ends: tuple[LengthAtEnd, ...] = ()

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether the problem is the robot's, and some body of it explains the readings."""
        return super().explained and not self.contradictions


def posterior_report(store: RunStore, fitted: FittedPosterior) -> PosteriorReport:
    """Report on a run's latest posterior."""
    summaries = [summary for summary, _ in store.posteriors()]
    stored, problem, genome = summaries[-1], fitted.problem, fitted.genome
    contradictions = tuple(problem.contradictions(fitted.capabilities))
    genes, weights, lengths = fitted.samples, fitted.weights, fitted.leg_lengths
    scales = np.exp(fitted.scales)
    return PosteriorReport(
        **{name: getattr(stored, name) for name in PosteriorSummary.model_fields},
        contradictions=contradictions,
        verdict=verdict_on_posterior(
            stored, contradictions, [joint.name for joint in fitted.capabilities.joints]
        ),
        attachments=fitted.attachments,
        lengths_m=length_intervals(lengths, weights),
        sums=sums_of_lengths(lengths, weights),
        parameters=_parameters(fitted),
        rivals=_rivals(genome, stored),
        equivalent=_equivalent(genome, stored, problem, fitted.modalities),
        noise={
            name: _interval(scales[:, column], weights)
            for column, name in enumerate(SCALED)
            if name in fitted.modalities
        },
        steps=tuple(
            Step(
                reason=interaction.reason,
                expected_gain_bits=interaction.bits,
                information_gain_bits=summary.information_gain_bits,
                probability=summary.probability,
                explained=summary.explained and not contradictions,
            )
            for interaction, summary in zip(store.interactions(), summaries, strict=False)
        ),
        samples=len(genes),
        changes=tuple(f"{change.sentence} ({change.probability:.2f})" for change in stored.changes),
        at_ends=lengths_at_ends(fitted),
    )


def _rivals(genome: Genome, stored: StoredPosterior) -> tuple[Rival, ...]:
    rivals, best = [], np.array([stored.best])
    for mode in stored.modes[1 : 1 + _MAX_RIVALS]:
        if mode.probability < RIVAL:
            break
        differs = []
        for column, gene in enumerate(genome.genes):
            if gene.is_choice:
                (value,) = genome.words(column, np.array([mode.genes]))
                if (value,) != genome.words(column, best):
                    differs.append(f"{gene.name}: {value}")
        rivals.append(
            Rival(
                probability=mode.probability,
                differs=tuple(differs),
                indistinguishable=mode.indistinguishable,
            )
        )
    return tuple(rivals)


def _equivalent(
    genome: Genome, stored: StoredPosterior, problem: Problem, modalities: Sequence[str]
) -> tuple[str, ...]:
    """Faults whose readings are those of some body, as far as the problem leaves the body open."""
    best = genome.decode(np.array(stored.best))
    mounts, hinges = (
        [gene.part for gene in genome.genes if gene.trait == trait and gene.is_choice]
        for trait in ("mount", "hinge")
    )
    faults = []
    if mounts and "tilt" in modalities:
        faults.append("a tilt whose sign is reversed feels like the mirror image of the body")
        length, width, _ = best.base.size
        if math.isclose(length, width, rel_tol=_SQUARE):
            faults.append(
                "an accelerometer turned by 90°, or whose axes are exchanged, feels like the body "
                "turned so, or its mirror image"
            )
    if len(mounts) > 1:
        faults.append(
            "servos that have exchanged plugs, and gauges with them, feel like other legs"
        )
    carriers = {part.parent for part in best.parts}
    faults += [
        f"a servo of {problem.parts[part].name} that never moves feels like a roll"
        for part in hinges
        if best.hinge(part).name.startswith("roll") and part not in carriers
    ]
    return tuple(faults)


def length_intervals(lengths: Array, weights: Array) -> tuple[Interval, ...]:
    """Length of each leg with its 90 % interval, m, in motor order.

    Args:
        lengths: Lengths of the legs of each sample, m, shape (n, legs).
        weights: Weights of the samples, shape (n,).
    """
    return tuple(_interval(column, weights) for column in lengths.T)


def sums_of_lengths(lengths: Array, weights: Array) -> tuple[SumOfLengths, ...]:
    """The pairs of legs whose sum is known much better than either length.

    Args:
        lengths: Lengths of the legs of each sample, m, shape (n, legs).
        weights: Weights of the samples, shape (n,).
    """
    widths = [_interval(column, weights).width for column in lengths.T]
    sums = []
    for first, second in combinations(range(lengths.shape[1]), 2):
        narrower = min(widths[first], widths[second])
        total = _interval(lengths[:, first] + lengths[:, second], weights)
        if narrower > _VAGUE_WIDTH and total.width < _SUM_WIDTH * narrower:
            sums.append(SumOfLengths(legs=(first, second), length_m=total))
    return tuple(sums)


def _parameters(fitted: FittedPosterior) -> tuple[ParameterEstimate, ...]:
    """Estimates of the parameters of which the readings say much more than was known before."""
    estimates = []
    for name, deviations in fitted.unknowns.amounts(fitted.points).items():
        row = next(row for row in fitted.problem.table if row.name == name)
        interval = _interval(deviations, fitted.weights)
        excludes_zero = interval.low > 0 or interval.high < 0
        is_learnt = excludes_zero or interval.width < LEARNT_WIDTH * PRIOR_WIDTH * row.narrow
        if row.switch or not row.narrow or not is_learnt:
            continue
        low, median, high = row.amounts(
            1.0, np.array([interval.low, interval.median, interval.high])
        ).tolist()
        estimates.append(
            ParameterEstimate(
                name=name,
                sentence=row.said(median, (low, high)),
                interval=Interval(low=low, median=median, high=high),
            )
        )
    return tuple(estimates)


def _interval(values: Array, weights: Array) -> Interval:
    low, median, high = quantiles(values, weights, _QUANTILES).tolist()
    if not math.isfinite(median):
        raise ValueError("a posterior holds values that are not finite")
    return Interval(low=low, median=median, high=high)
