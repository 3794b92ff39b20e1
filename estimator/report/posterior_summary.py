"""What a posterior says, in numbers: the part of ``result.json`` that is its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array, Morphology
from estimator.posterior.densities import SCALED
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.storage.beliefs import Belief, Foretold
from estimator.storage.store import RunStore

SURE_ENOUGH: Final = 10.0
"""Effective sample size below which a probability is not known."""

_RIVALS: Final = 5
_WORTH_TELLING: Final = 0.01
_INTERVAL: Final = (0.05, 0.5, 0.95)


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class Attachment(_Record):
    """One thing that a problem leaves open about how a part is attached.

    Attributes:
        what: Its name, such as ``side of leg 1``.
        value: The best body's.
        probability: Share of the posterior that has this value.
    """

    what: str
    value: str
    probability: float


class Rival(_Record):
    """Another set of attachments that explains the readings.

    Attributes:
        probability: Share of the posterior.
        differs: What it has otherwise than the best body, such as ``side of leg 1: left``.
        alike: Whether no sensor can tell it from the best body.
    """

    probability: float
    differs: tuple[str, ...]
    alike: bool


class Interval(_Record):
    """A quantity with its 90 % interval."""

    low: float
    median: float
    high: float


class Step(_Record):
    """How belief grew with one interaction.

    Attributes:
        reason: Why its motor program was chosen.
        expected_bits: Information that it was expected to give.
        gained_bits: Information that it gave.
        probability: Stated of the attachments afterwards.
    """

    reason: str
    expected_bits: float | None
    gained_bits: float | None
    probability: float


class PosteriorSummary(_Record):
    """The posterior after a run's interactions so far.

    Attributes:
        explained: Whether some body of the problem explains the readings.
        verdict: The same as a sentence.
        probability: Stated probability of the attachments; ``None``: it is not known.
        attachments: What the problem leaves open, as the best body has it.
        lengths_m: Of each leg, m, in motor order.
        rivals: Other sets of attachments, the most probable first.
        noise: Factor on the announced noise of tilt and clearance.
        steps: One per interaction.
        foretold: Each interaction as the best body foretells it.
        samples: How many stand for the posterior.
        simulated: How many of them the reference back-end simulated.
        effective: Effective sample size of those.
    """

    explained: bool
    verdict: str
    probability: float | None
    attachments: tuple[Attachment, ...]
    lengths_m: tuple[Interval, ...]
    rivals: tuple[Rival, ...]
    noise: dict[str, Interval]
    steps: tuple[Step, ...]
    foretold: tuple[Foretold, ...]
    samples: int
    simulated: int
    effective: float | None


def posterior_summary(store: RunStore, problem: Problem) -> PosteriorSummary | None:
    """Sums up what a run believes; ``None`` where its method has no posterior, or none yet."""
    beliefs = store.beliefs()
    if not beliefs:
        return None
    belief, _ = beliefs[-1]
    genome = Genome(problem, problem.base(store.capabilities))
    weights = np.array(belief.weights)
    genes = np.array(belief.genes)
    bodies = genome.decode_all(genes)
    scales = np.exp(np.array(belief.scales))
    return PosteriorSummary(
        explained=is_explained(belief),
        verdict=verdict_on_fit(belief),
        probability=belief.probability if _is_known(belief) else None,
        attachments=_attachments(genome, belief, genes, weights),
        lengths_m=_lengths(bodies, weights),
        rivals=_rivals(genome, belief),
        noise={name: _interval(scales[:, column], weights) for column, name in enumerate(SCALED)},
        steps=tuple(
            Step(
                reason=interaction.reason,
                expected_bits=interaction.bits,
                gained_bits=one.gained,
                probability=one.probability,
            )
            for interaction, (one, _) in zip(store.interactions(), beliefs, strict=False)
        ),
        foretold=belief.foretold,
        samples=len(genes),
        simulated=belief.simulated,
        effective=belief.effective,
    )


def is_explained(belief: Belief) -> bool:
    """Whether some body of the problem explains the readings; one accident is allowed for."""
    return len(belief.unexplained) < 2 and not belief.noisy


def verdict_on_fit(belief: Belief) -> str:
    """Whether some body of the problem explains the readings, as a sentence."""
    if is_explained(belief):
        rest = (
            f" but interaction {belief.unexplained[0].interaction + 1}, which may be an accident"
            if belief.unexplained
            else ""
        )
        return f"Some body that this problem allows explains every interaction{rest}."
    reasons = []
    if len(belief.unexplained) > 1:
        numbers = [str(item.interaction + 1) for item in belief.unexplained]
        sensors = sorted({name for item in belief.unexplained for name in item.sensors})
        listed = f"{', '.join(numbers[:-1])} and {numbers[-1]}"
        where = f" ({', '.join(sensors)})" if sensors else ""
        reasons.append(f"explains interactions {listed}{where}")
    if belief.noisy:
        reasons.append(
            f"explains {' and '.join(belief.noisy)} without more than twice the announced noise"
        )
    return f"NO BODY THAT THIS PROBLEM ALLOWS {', or '.join(reasons)}."


def _is_known(belief: Belief) -> bool:
    effective = belief.modes[0].effective
    return effective >= SURE_ENOUGH or belief.probability < 0.5


def _attachments(
    genome: Genome, belief: Belief, genes: Array, weights: Array
) -> tuple[Attachment, ...]:
    told = []
    for column, gene in enumerate(genome.genes):
        if gene.choices > 1:
            value = genome.choice(column, belief.best[column])
            same = [genome.choice(column, one) == value for one in genes[:, column].tolist()]
            told.append(
                Attachment(
                    what=gene.name,
                    value=genome.word(column, value),
                    probability=min(float(weights @ np.array(same)), 1.0),
                )
            )
    return tuple(told)


def _rivals(genome: Genome, belief: Belief) -> tuple[Rival, ...]:
    rivals = []
    for mode in belief.modes[1 : 1 + _RIVALS]:
        if mode.probability < _WORTH_TELLING:
            break
        differs = []
        for column, gene in enumerate(genome.genes):
            if gene.choices > 1:
                value = genome.choice(column, mode.genes[column])
                if value != genome.choice(column, belief.best[column]):
                    differs.append(f"{gene.name}: {genome.word(column, value)}")
        rivals.append(
            Rival(probability=mode.probability, differs=tuple(differs), alike=mode.like_the_first)
        )
    return tuple(rivals)


def _lengths(bodies: Sequence[Morphology], weights: Array) -> tuple[Interval, ...]:
    return tuple(_interval(column, weights) for column in leg_lengths(bodies).T)


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
