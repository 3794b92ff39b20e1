"""The summary of a posterior, as stored, loaded and reported: probability, fit, predictions."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from estimator.body.limbs import driven_limbs, leg_lengths
from estimator.body.morphology import Array
from estimator.posterior.checks.verdict import judge, standardised_residuals
from estimator.posterior.indistinguishable import Indistinguishable, indistinguishable_shares
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import (
    MOSTLY,
    Mode,
    Posterior,
    coverage_of_classes,
    systematic,
)
from estimator.storage.posteriors import (
    LOW_ESS,
    AttachmentsStated,
    Cause,
    Interval,
    PredictedInteraction,
    StoredMode,
    StoredPosterior,
)

_STORED_MODES: Final = 120  # modes that are stored, at most
_RARITY: Final = 0.02  # probability below which a deviation is not named
_COMPARED_MODES: Final = 20  # modes that are compared with the first where no probability is stated


def summarise(
    posterior: Posterior,
    predictor: Predictor,
    likelihood: Likelihood,
    indistinguishable: Indistinguishable,
    *,
    before: Posterior | None = None,
) -> StoredPosterior:
    """Summarises a posterior.

    Args:
        posterior: The posterior after some interactions.
        predictor: Computes readings.
        likelihood: Likelihood of what was observed in these interactions.
        indistinguishable: Tests whether bodies are indistinguishable.
        before: The posterior before the last interaction, by which that one's information is
            measured.
    """
    unknowns, gained = predictor.unknowns, None
    if before is not None:
        gained = information_gained(before, posterior, predictor, likelihood)
    return StoredPosterior(
        genes=tuple(map(tuple, unknowns.cube(posterior.values).tolist())),
        amounts={
            name: tuple(amounts.tolist())
            for name, amounts in unknowns.amounts(posterior.values).items()
        },
        scales=tuple(map(tuple, posterior.scales.tolist())),
        weights=tuple(posterior.weights.tolist()),
        **attachments_stated(posterior, predictor, indistinguishable)._asdict(),
        causes=_causes(posterior, unknowns),
        as_stated_m=_as_stated(posterior, unknowns),
        too_early=len(likelihood) < unknowns.telling,
        information_gain_bits=gained,
        predicted=_predicted(posterior, predictor, likelihood),
        **dict(judge(posterior, predictor, likelihood)),
    )


def attachments_stated(
    posterior: Posterior, predictor: Predictor, indistinguishable: Indistinguishable
) -> AttachmentsStated:
    """The best body, its rivals, and how probable its attachments are; see ``summarise``."""
    modes, unknowns = posterior.modes[:_STORED_MODES], predictor.unknowns
    compared = modes if posterior.adequate_fit else modes[:_COMPARED_MODES]
    shares = np.zeros(len(modes))
    shares[: len(compared)] = indistinguishable_shares(
        compared, posterior, predictor, indistinguishable
    )
    chances, found = np.array([mode.probability for mode in modes]), [mode.found for mode in modes]
    coverage = coverage_of_classes(chances, np.array(found), shares)
    # Errors of evidences are independent: they even out over modes for which few draws stand each.
    counted = chances * shares
    class_ess = float(counted.sum() ** 2 / np.sum(counted**2 / [mode.ess for mode in modes]))
    return AttachmentsStated(
        best=tuple(unknowns.cube(_middle_body(posterior, predictor)[None])[0].tolist()),
        modes=tuple(
            StoredMode(
                probability=mode.probability,
                ess=mode.ess,
                genes=tuple(unknowns.cube(mode.point[None])[0].tolist()),
                amounts={
                    name: float(amounts[0])
                    for name, amounts in unknowns.amounts(mode.point[None]).items()
                },
                indistinguishable=bool(share >= MOSTLY),
                found=mode.found,
            )
            for mode, share in zip(modes, shares.tolist(), strict=True)
        ),
        probability_within_problem=(
            min(float(chances @ shares), coverage) if posterior.adequate_fit else None
        ),
        coverage=coverage,
        low_ess=bool(unknowns.choices.size) and class_ess < LOW_ESS,
    )


def _causes(posterior: Posterior, unknowns: Unknowns) -> tuple[Cause, ...]:
    """Deviations that may explain the readings, the most probable first."""
    causes = []
    for cause in posterior.causes:
        if cause.probability < _RARITY:
            break
        row = unknowns.table[cause.row]
        ends = np.array([cause.low, cause.median, cause.high])
        low, median, high = row.amounts(1.0, ends).tolist()
        causes.append(
            Cause(
                name=row.name,
                probability=cause.probability,
                sentence=row.said(median, (low, high)),
                check=row.check,
            )
        )
    return tuple(causes)


def _as_stated(posterior: Posterior, unknowns: Unknowns) -> tuple[Interval, ...]:
    if posterior.as_stated is None:
        return ()
    lengths = leg_lengths(unknowns.decode_all(posterior.as_stated))
    quantiles = np.quantile(lengths, (0.05, 0.5, 0.95), axis=0).T.tolist()
    return tuple(Interval(low=low, median=median, high=high) for low, median, high in quantiles)


def _middle_body(posterior: Posterior, predictor: Predictor) -> Array:
    """The first mode's attachments with the weighted medians of its samples' lengths.

    The parts of a leg of several have the lengths of the sample whose leg is the median: medians of
    parts do not add up to it.
    """
    unknowns, first = predictor.unknowns, posterior.modes[0]
    rows = [key == first.attachments for key in unknowns.keys(posterior.values)]
    best = first.point.copy()
    if not any(rows):
        return best
    values, weights = posterior.values[rows], posterior.weights[rows]
    for column in unknowns.continuous.tolist():
        best[column] = values[_middle(values[:, column], weights), column]
    legs = _legs_of_several_lengths(first.point, unknowns)
    if legs:
        lengths = leg_lengths(unknowns.decode_all(values))
        for leg, columns in legs.items():
            best[columns] = values[_middle(lengths[:, leg], weights), columns]
    return best


def _middle(numbers: Array, weights: Array) -> int:
    """Index of the weighted median."""
    order = np.argsort(numbers, kind="stable")
    below = np.cumsum(weights[order]) < 0.5 * weights.sum()
    return int(order[below.sum()])


def _legs_of_several_lengths(point: Array, unknowns: Unknowns) -> dict[int, list[int]]:
    """Columns of the unknown lengths of each leg that has several, by its number."""
    (body,) = unknowns.decode_all(point[None])
    groups, legs = body.rigid_groups, [limb.motor for limb in driven_limbs(body)]
    columns: dict[int, list[int]] = {}
    for column, gene in enumerate(unknowns.genes):
        motor = body.parts[groups[gene.part]].motor if gene.trait == "length" else None
        if motor is not None:
            columns.setdefault(legs.index(motor), []).append(column)
    return {leg: leg_columns for leg, leg_columns in columns.items() if len(leg_columns) > 1}


def _predicted(
    posterior: Posterior, predictor: Predictor, likelihood: Likelihood
) -> tuple[PredictedInteraction, ...]:
    best = posterior.modes[0].point[None]
    readings = likelihood.readings_of(predictor, best)
    residuals = standardised_residuals(best, predictor, likelihood)
    misfits = likelihood.misfits_of(predictor, posterior.values)
    inliers = likelihood.inlier_share(misfits, scales=posterior.scales)
    outlier = 1 - posterior.weights @ inliers
    counts = {name: observed.count for name, observed in likelihood.data.observed.items()}
    return PredictedInteraction.each(readings, residuals, counts, outlier)


def load_posterior(stored: StoredPosterior, unknowns: Unknowns) -> Posterior:
    """Loads the posterior that was stored with its summary."""
    names = {name for mode in stored.modes for name in mode.amounts}
    points = unknowns.points(
        np.array([mode.genes for mode in stored.modes]).reshape(-1, unknowns.genes_size),
        {name: np.array([mode.amounts.get(name, 0.0) for mode in stored.modes]) for name in names},
    )
    amounts = {name: np.array(column) for name, column in stored.amounts.items()}
    return Posterior(
        values=unknowns.points(np.array(stored.genes), amounts),
        scales=np.array(stored.scales),
        weights=np.array(stored.weights),
        modes=tuple(
            Mode(key, mode.probability, point, mode.ess, mode.found)
            for key, mode, point in zip(unknowns.keys(points), stored.modes, points, strict=True)
        ),
        adequate_fit=stored.probability_within_problem is not None,
        changed=(
            np.array([change.amounts for change in stored.changes]).T if stored.changes else None
        ),
    )


SAMPLES: Final = 200
"""Number of samples by which information is measured; its logarithm is the most that results."""


def information_gained(
    before: Posterior, after: Posterior, predictor: Predictor, likelihood: Likelihood
) -> float:
    """Information that the last interaction gave about the body, bits.

    Each sample of the posterior is compared with samples of the previous posterior by the
    density of what was observed, as the expected information gain does it with predicted readings.
    If the posteriors are right the mean over interactions is therefore the same.

    Args:
        before: The posterior before the last interaction.
        after: The posterior after the last interaction.
        predictor: Computes readings.
        likelihood: Likelihood of all interactions.
    """
    last = likelihood[-1:]
    rows = systematic(before.weights, SAMPLES - 1, 0.5)
    earlier_logs = last.normalised(predictor, before.values[rows], before.scales[rows])
    logs = last.normalised(predictor, after.values, after.scales)[:, 0]
    mean = np.logaddexp(logs, logsumexp(earlier_logs)) - math.log(1 + len(earlier_logs))
    return float(after.weights @ (logs - mean)) / math.log(2)
