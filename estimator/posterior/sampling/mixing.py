"""Markov chains from the sets of attachments that were weighed to those that no search has found.

Where few readings leave many sets of attachments, a search finds part of them only: more of those
in which the readings determine a leg than of the many in which that leg touches nothing. So samples
of the sets found are overconfident. Chains that begin with these samples leave the posterior
invariant, and reach the other sets as often as their share of it demands.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Attachments, Cost, Predictor, Unknowns
from estimator.posterior.sampling.weighing import WeighedModes

_CHAIN_PARTS: Final = 2  # parts of the chains, independent of each other


def mixed(
    modes: WeighedModes,
    scales: Array,
    predictor: Predictor,
    likelihood: Likelihood,
    rng: np.random.Generator,
    *,
    workers: Executor,
    steps: int,
) -> tuple[WeighedModes, Array]:
    """The modes with those that chains reach, and the chains' ends as samples.

    Of a mode that only chains have reached, the effective sample size is the number of these
    chains, and the draws are their ends.

    Args:
        modes: The modes that were weighed.
        scales: Logarithms of their samples' noise factors, shape (n, 2).
        predictor: Computes readings.
        likelihood: Likelihood of the observations.
        rng: Seeds the chains.
        workers: Executor that moves the chains; its number of workers changes no result.
        steps: Number of steps of each chain.

    Returns:
        The modes, and logarithms of their new samples' noise factors, shape (n, 2).
    """
    seeds = rng.integers(2**32, size=_CHAIN_PARTS).tolist()
    slices = (slice(part, None, _CHAIN_PARTS) for part in range(_CHAIN_PARTS))
    tasks = [
        (modes.values[rows], scales[rows], seed) for rows, seed in zip(slices, seeds, strict=True)
    ]
    moved = workers.map(partial(_moved, predictor, likelihood, steps), tasks)
    *arrays, costs = zip(*moved, strict=True)
    for cost in costs:
        predictor.add_cost(cost)
    values, scales, fits = map(np.concatenate, arrays)
    return _with_others(replace(modes, values=values), fits, predictor.unknowns), scales


def _moved(
    predictor: Predictor, likelihood: Likelihood, steps: int, task: tuple[Array, Array, int]
) -> tuple[Array, Array, Array, Cost]:
    """Ends of chains after some steps, their noise factors and fits, and the cost of that."""
    values, scales, seed = task
    before = predictor.cost
    chains = Population(predictor, np.random.default_rng(seed), values, scales)
    chains.observe(likelihood, surely=False)
    for _ in range(steps):
        chains.step()
    return chains.values, chains.scales, chains.posterior_fits(1), predictor.cost.since(before)


def _with_others(modes: WeighedModes, fits: Array, unknowns: Unknowns) -> WeighedModes:
    """The modes, and besides those of samples whose attachments none of the modes has."""
    values, unweighed = modes.values, dict[Attachments, list[int]]()
    weighed = set(unknowns.keys(modes.points))
    for row, key in enumerate(unknowns.keys(values)):
        if key not in weighed:
            unweighed.setdefault(key, []).append(row)
    if not unweighed:
        return modes
    counts = np.array([float(len(rows)) for rows in unweighed.values()])
    share = counts.sum() / len(values)
    best = [max(rows, key=fits.__getitem__) for rows in unweighed.values()]
    return replace(
        modes,
        points=np.concatenate([modes.points, values[best]]),
        shares=np.concatenate([(1 - share) * modes.shares, share * _shares(counts)]),
        ess=np.concatenate([modes.ess, counts]),
        draws=[*modes.draws, *(values[rows] for rows in unweighed.values())],
    )


def _shares(counts: Array) -> Array:
    """Shares of sets with so many chains in them, shape (n,).

    A set keeps what lies two standard deviations below its count; the rest is shared out evenly.
    Otherwise one of many equally good sets would lead by chance.
    """
    sure = np.maximum(counts - 2 * np.sqrt(counts), 0.0)
    shares: Array = (sure + (counts - sure).mean()) / counts.sum()
    return shares
