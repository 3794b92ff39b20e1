"""What a posterior says, in the problem's names: ``posterior`` in ``result.json``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict, computed_field

from estimator.body.morphology import Array
from estimator.posterior.fitted import Attachment, FittedPosterior
from estimator.posterior.model.sensor_data import SCALED
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.verdict import verdict_on_posterior
from estimator.storage.posteriors import RIVAL, Interval, PosteriorSummary, StoredPosterior
from estimator.storage.store import RunStore

_RIVALS: Final = 5
_INTERVAL: Final = (0.05, 0.5, 0.95)
_LEARNT_MUCH: Final = 0.3  # width of the posterior's interval by that of the prior's
_PRIOR_WIDTH: Final = 3.29  # standard deviations, of 90 %
_TOGETHER: Final = 0.5  # of either length's interval
_VAGUE: Final = 0.02  # m; narrower intervals of single lengths need no sums
_SQUARE: Final = 0.05  # of the longer side; else sensors tell where a leg sits


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)


class Rival(_Record):
    """Another set of attachments that explains the readings.

    Attributes:
        probability: Share of the posterior.
        differs: What it has otherwise than the best body, such as ``mount of leg 1: left``.
        indistinguishable: Whether no sensor can tell it from the best body.
    """

    probability: float
    differs: tuple[str, ...]
    indistinguishable: bool


class SumOfLengths(_Record):
    """The lengths of two legs together, which are known where neither is, as of parts in line.

    Attributes:
        legs: Which, in motor order, from 0.
        length_m: Of both, m.
    """

    legs: tuple[int, int]
    length_m: Interval


class ParameterEstimate(_Record):
    """What the readings say of one of the things that robots have a little otherwise than stated.

    Attributes:
        name: Of the row in the table of parameters.
        sentence: The rest of "a robot with …", with the amount and its interval.
        interval: Of the amount, a factor or SI.
    """

    name: str
    sentence: str
    interval: Interval


class Step(_Record):
    """How the posterior changed with one interaction.

    Attributes:
        reason: Why its motor program was chosen.
        expected_gain_bits: Information that it was expected to give.
        information_gain_bits: Information that it gave.
        probability: Stated of the attachments afterwards; ``None``: it is not known.
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
        contradictions: Between the problem and what the robot states of itself.
        verdict: Whether some body of the problem explains the readings, as sentences.
        attachments: What the problem leaves open, as the best body has it.
        lengths_m: Of each leg, m, in motor order.
        sums: Of two legs, where the readings determine these but not the single lengths.
        parameters: What the readings say of what robots have a little otherwise than stated.
        rivals: Other sets of attachments, the most probable first.
        equivalent: Faults that no movement can tell from the best body.
        noise: Factor on the noise that is expected of tilt and clearance: what the robot announces,
            together with what models leave, 0.2° and 0.8 mm.
        steps: One per interaction.
        samples: How many stand for the posterior.
        changes: What has changed since the robot was identified, as sentences.
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

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether some body of the problem, which is the robot's, explains the readings."""
        return super().explained and not self.contradictions


def posterior_report(store: RunStore) -> PosteriorReport | None:
    """What a run's posterior says; ``None`` where its method has none, or none yet."""
    history = FittedPosterior.history(store)
    if not history:
        return None
    fitted = history[-1]
    stored, problem, genome = fitted.summary, fitted.problem, fitted.genome
    assert stored is not None
    summaries = [one.summary for one in history if one.summary is not None]
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
        noise={name: _interval(scales[:, column], weights) for column, name in enumerate(SCALED)},
        steps=tuple(
            Step(
                reason=interaction.reason,
                expected_gain_bits=interaction.bits,
                information_gain_bits=one.information_gain_bits,
                probability=one.probability,
                explained=one.explained and not contradictions,
            )
            for interaction, one in zip(store.interactions(), summaries, strict=False)
        ),
        samples=len(genes),
        changes=tuple(f"{one.sentence} ({one.probability:.2f})" for one in stored.changes),
    )


def _rivals(genome: Genome, stored: StoredPosterior) -> tuple[Rival, ...]:
    rivals, best = [], np.array([stored.best])
    for mode in stored.modes[1 : 1 + _RIVALS]:
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
    """Faults that feel like a body, as far as the problem leaves the body open."""
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
    """Length of each leg, m, in motor order.

    Args:
        lengths: Of the legs of each sample, m, shape (n, legs).
        weights: Of the samples, shape (n,).
    """
    return tuple(_interval(column, weights) for column in lengths.T)


def sums_of_lengths(lengths: Array, weights: Array) -> tuple[SumOfLengths, ...]:
    """The pairs of legs whose sum is known much better than either length.

    Args:
        lengths: Of the legs of each sample, m, shape (n, legs).
        weights: Of the samples, shape (n,).
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


def _parameters(fitted: FittedPosterior) -> tuple[ParameterEstimate, ...]:
    """Of what the readings say much more than was known before."""
    estimates = []
    for name, deviations in fitted.unknowns.amounts(fitted.points).items():
        row = next(one for one in fitted.problem.table if one.name == name)
        known = _interval(deviations, fitted.weights)
        off = known.low > 0 or known.high < 0
        learnt = off or _width(known) < _LEARNT_MUCH * _PRIOR_WIDTH * row.narrow
        if row.switch or not row.narrow or not learnt:
            continue
        low, median, high = row.amounts(
            1.0, np.array([known.low, known.median, known.high])
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
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    low, median, high = (
        float(values[order][min(int(np.searchsorted(share, at)), len(values) - 1)])
        for at in _INTERVAL
    )
    if not math.isfinite(median):
        raise ValueError("a posterior holds values that are not finite")
    return Interval(low=low, median=median, high=high)
