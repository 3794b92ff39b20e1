"""What a posterior says, in numbers: the part of ``result.json`` that is its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.morphology import Array
from estimator.posterior.fitted import Attachment, FittedPosterior
from estimator.posterior.model.sensor_data import SCALED
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.posterior.verdict import verdict_on_fit
from estimator.storage.beliefs import RIVAL, Belief, Foretold, NextMovement, NotKnown
from estimator.storage.store import RunStore

_RIVALS: Final = 5
_INTERVAL: Final = (0.05, 0.5, 0.95)
_LEARNT: Final = 0.7  # of the prior's interval
_TOGETHER: Final = 0.5  # of either length's interval
_VAGUE: Final = 0.02  # m; narrower intervals of single lengths need no sums
_SQUARE: Final = 0.05  # of the longer side; else a leg that sits elsewhere is felt


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class Rival(_Record):
    """Another set of attachments that explains the readings.

    Attributes:
        probability: Share of the posterior.
        differs: What it has otherwise than the best body, such as ``mount of leg 1: left``.
        alike: Whether no sensor can tell it from the best body.
    """

    probability: float
    differs: tuple[str, ...]
    alike: bool


class Interval(_Record):
    """A quantity with its 90 % interval.

    Attributes:
        low: 5 % of the posterior lie below.
        median: Half of it lies below.
        high: 95 % lie below.
    """

    low: float
    median: float
    high: float


class SumOfLengths(_Record):
    """The lengths of two legs together, which are known where neither is, as of parts in line.

    Attributes:
        legs: Which, in motor order, from 0.
        length_m: Of both, m.
    """

    legs: tuple[int, int]
    length_m: Interval


class FoundAlong(_Record):
    """A nuisance parameter.

    Attributes:
        name: What it is.
        unit: Of the interval.
        interval: With 90 % of the posterior.
        learnt: Whether the interval is clearly narrower than the prior's; otherwise the readings
            say nothing of it.
    """

    name: str
    unit: str
    interval: Interval
    learnt: bool


class Step(_Record):
    """How belief grew with one interaction.

    Attributes:
        reason: Why its motor program was chosen.
        expected_bits: Information that it was expected to give.
        gained_bits: Information that it gave.
        probability: Stated of the attachments afterwards; ``None``: it is not known.
        explained: Whether some body of the problem explained the readings so far.
    """

    reason: str
    expected_bits: float | None
    gained_bits: float | None
    probability: float | None
    explained: bool


class PosteriorSummary(_Record):
    """The posterior after a run's interactions so far.

    Attributes:
        explained: Whether some body of the problem explains the readings.
        verdict: The same as a sentence.
        unexplained: Numbers of the interactions that the best body leaves unexplained, from 1.
        probability: Stated probability of the attachments; ``None``: it is not known.
        not_known: Why the probability is not known; ``None``: it is.
        departed: Probability that the robot is built otherwise than the problem says: a part of
            what is missing from ``probability``. 0 where that was not looked at.
        attachments: What the problem leaves open, as the best body has it.
        lengths_m: Of each leg, m, in motor order.
        sums: Of two legs, where the readings tell these but not the single lengths.
        nuisances: What else was only roughly known.
        rivals: Other sets of attachments, the most probable first. Those that no sensor can tell
            from the best body's are what no movement can decide.
        equivalent: What else would feel exactly so: faults that no movement tells from the best
            body.
        untested: How else than the problem says the robot may be built: such bodies, with other
            lengths, explain the readings as well as the best one.
        decides: The movement that would tell most, where others are left at the end of a run.
        noise: Factor on the noise that is expected of tilt and clearance: what the robot announces,
            together with what models leave, 0.2° and 0.8 mm.
        steps: One per interaction.
        foretold: Each interaction as the best body foretells it.
        samples: How many stand for the posterior.
        simulated: How many of them the reference back-end simulated.
        effective: Effective sample size of those.
    """

    explained: bool
    verdict: str
    unexplained: tuple[int, ...] = ()
    probability: float | None
    not_known: NotKnown | None = None
    departed: float = 0.0
    attachments: tuple[Attachment, ...]
    lengths_m: tuple[Interval, ...]
    sums: tuple[SumOfLengths, ...] = ()
    nuisances: tuple[FoundAlong, ...] = ()
    rivals: tuple[Rival, ...]
    equivalent: tuple[str, ...] = ()
    untested: tuple[str, ...] = ()
    decides: NextMovement | None = None
    noise: dict[str, Interval]
    steps: tuple[Step, ...]
    foretold: tuple[Foretold, ...]
    samples: int
    simulated: int
    effective: float | None


def posterior_summary(store: RunStore) -> PosteriorSummary | None:
    """Sums up what a run believes; ``None`` where its method has no posterior, or none yet."""
    history = FittedPosterior.history(store)
    if not history:
        return None
    fitted = history[-1]
    belief, problem, genome = fitted.belief, fitted.problem, fitted.genome
    assert belief is not None
    beliefs = [one.belief for one in history if one.belief is not None]
    contradictions = problem.contradictions(fitted.capabilities)
    genes, weights, lengths = fitted.samples, fitted.weights, fitted.leg_lengths
    scales = np.exp(fitted.scales)
    return PosteriorSummary(
        explained=belief.explained and not contradictions,
        verdict=verdict_on_fit(belief, contradictions),
        unexplained=tuple(item.interaction + 1 for item in belief.unexplained),
        probability=belief.probability,
        not_known=belief.not_known,
        departed=belief.departed,
        attachments=fitted.attachments,
        lengths_m=length_intervals(lengths, weights),
        sums=sums_of_lengths(lengths, weights),
        nuisances=_nuisances(genome, genes, weights),
        rivals=_rivals(genome, belief),
        equivalent=_equivalent(genome, belief, problem, fitted.modalities),
        untested=belief.untested,
        decides=belief.decides,
        noise={name: _interval(scales[:, column], weights) for column, name in enumerate(SCALED)},
        steps=tuple(
            Step(
                reason=interaction.reason,
                expected_bits=interaction.bits,
                gained_bits=one.gained,
                probability=one.probability,
                explained=one.explained and not contradictions,
            )
            for interaction, one in zip(store.interactions(), beliefs, strict=False)
        ),
        foretold=belief.foretold,
        samples=len(genes),
        simulated=belief.simulated,
        effective=belief.effective,
    )


def _rivals(genome: Genome, belief: Belief) -> tuple[Rival, ...]:
    rivals, best = [], np.array([belief.best])
    for mode in belief.modes[1 : 1 + _RIVALS]:
        if mode.probability < RIVAL:
            break
        differs = []
        for column, gene in enumerate(genome.genes):
            if gene.choices > 1:
                (value,) = genome.words(column, np.array([mode.genes]))
                if (value,) != genome.words(column, best):
                    differs.append(f"{gene.name}: {value}")
        rivals.append(
            Rival(probability=mode.probability, differs=tuple(differs), alike=mode.like_the_first)
        )
    return tuple(rivals)


def _equivalent(
    genome: Genome, belief: Belief, problem: Problem, modalities: Sequence[str]
) -> tuple[str, ...]:
    """Faults that feel like a body, as far as the problem leaves the body open."""
    best = genome.decode(np.array(belief.best))
    mounts, hinges = (
        [gene.part for gene in genome.genes if gene.trait == trait and gene.choices > 1]
        for trait in ("mount", "hinge")
    )
    told = []
    if mounts and "tilt" in modalities:
        told.append("a tilt whose sign is reversed feels like the mirror image of the body")
        length, width, _ = best.base.size
        if math.isclose(length, width, rel_tol=_SQUARE):
            told.append(
                "an accelerometer turned by 90°, or whose axes are exchanged, feels like the body "
                "turned so, or its mirror image"
            )
    if len(mounts) > 1:
        told.append("servos that have exchanged plugs, and gauges with them, feel like other legs")
    carriers = {part.parent for part in best.parts}
    told += [
        f"a servo of {problem.parts[part].name} that never moves feels like a roll"
        for part in hinges
        if best.hinge(part).name.startswith("roll") and part not in carriers
    ]
    return tuple(told)


def length_intervals(lengths: Array, weights: Array) -> tuple[Interval, ...]:
    """Length of each leg, m, in motor order.

    Args:
        lengths: Of the legs of each sample, m, shape (n, legs).
        weights: Of the samples, shape (n,).
    """
    return tuple(_interval(column, weights) for column in lengths.T)


def sums_of_lengths(lengths: Array, weights: Array) -> tuple[SumOfLengths, ...]:
    """The pairs of legs whose sum is known much better than either length.

    Arguments are those of ``length_intervals``.
    """
    widths = [_width(_interval(column, weights)) for column in lengths.T]
    sums = []
    for one, other in combinations(range(lengths.shape[1]), 2):
        vaguest = min(widths[one], widths[other])
        together = _interval(lengths[:, one] + lengths[:, other], weights)
        if vaguest > _VAGUE and _width(together) < _TOGETHER * vaguest:
            sums.append(SumOfLengths(legs=(one, other), length_m=together))
    return tuple(sums)


def _width(interval: Interval) -> float:
    return interval.high - interval.low


def _nuisances(genome: Genome, genes: Array, weights: Array) -> tuple[FoundAlong, ...]:
    told = []
    for column, gene in enumerate(genome.genes):
        if gene.trait == "nuisance":
            interval = _interval(genome.quantities(column, genes[:, column]), weights)
            low, high = genome.quantities(column, np.array([_INTERVAL[0], _INTERVAL[-1]]))
            learnt = interval.high - interval.low < _LEARNT * (high - low)
            told.append(
                FoundAlong(name=gene.name, unit=gene.unit, interval=interval, learnt=bool(learnt))
            )
    return tuple(told)


def _interval(values: Array, weights: Array) -> Interval:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    low, median, high = (
        float(values[order][min(int(np.searchsorted(share, at)), len(values) - 1)])
        for at in _INTERVAL
    )
    if not math.isfinite(median):
        raise ValueError("a posterior holds values that are not finite")
    return Interval(low=low, median=median, high=high)
