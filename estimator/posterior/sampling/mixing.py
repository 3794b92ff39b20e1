"""Samples that go on from the sets of attachments that were weighed to those that nobody has met.

Where few readings leave many sets of attachments, a search meets part of them only: more of those
that hold a leg fast than of the many ways in which a leg may be attached that touches nothing. So
samples of what was met know too much. Chains that begin with them leave the posterior as it is, and
go to the others as often as these deserve.
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
from estimator.posterior.model.unknowns import Attachments, Cost, Predictor
from estimator.posterior.sampling.weighing import WeighedModes

_TOGETHER: Final = 64  # chains that one worker moves


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
    """The modes with those that chains have gone on to, and the points where they are then.

    Of those the effective number is that of their chains, and the draws are where these are.

    Args:
        modes: That were weighed; chains begin at their ``values``, an even number.
        scales: Logarithms of these points' noise factors, shape (n, 2).
        predictor: Computes readings.
        likelihood: Of the observations.
        rng: Draws.
        workers: Move the chains; results do not depend on how many there are.
        steps: Of the chains.

    Returns:
        The modes, and the noise factors of their points.
    """
    unknowns, count = predictor.unknowns, len(modes.values)
    values, scales, fits = modes.values.copy(), scales.copy(), np.zeros(count)
    several, pairs = max(1, count // _TOGETHER), np.arange(count).reshape(-1, 2)
    parts = [pairs[first::several].ravel() for first in range(several)]
    tasks = [(values[rows], scales[rows], int(rng.integers(2**32))) for rows in parts]
    done = workers.map(partial(_moved, predictor, likelihood, steps), tasks)
    for rows, (chains, cost) in zip(parts, done, strict=True):
        values[rows], scales[rows], fits[rows] = chains
        predictor.add_cost(cost)
    weighed, others = set(unknowns.keys(modes.points)), dict[Attachments, list[int]]()
    for row, key in enumerate(unknowns.keys(values)):
        if key not in weighed:
            others.setdefault(key, []).append(row)
    modes = replace(modes, values=values)
    if not others:
        return modes, scales
    behind = np.array([float(len(rows)) for rows in others.values()])
    left = behind.sum() / len(values)
    best = [max(rows, key=fits.__getitem__) for rows in others.values()]
    modes = replace(
        modes,
        points=np.concatenate([modes.points, values[best]]),
        shares=np.concatenate([(1 - left) * modes.shares, left * _shares(behind)]),
        ess=np.concatenate([modes.ess, behind]),
        draws=[*modes.draws, *(values[rows] for rows in others.values())],
    )
    return modes, scales


def _moved(
    predictor: Predictor, likelihood: Likelihood, steps: int, task: tuple[Array, Array, int]
) -> tuple[tuple[Array, Array, Array], Cost]:
    """Points, noise factors and fits of chains that have moved, and what that cost."""
    values, scales, seed = task
    before = predictor.cost
    chains = Population(predictor, np.random.default_rng(seed), values, scales)
    chains.observe(likelihood, surely=False)
    for _ in range(steps):
        chains.step()
    told = chains.values, chains.scales, chains.posterior_fits(1)
    return told, predictor.cost.since(before)


def _shares(counts: Array) -> Array:
    """Shares of sets with so many chains in them, shape (n,).

    A set has for sure what lies two standard deviations below its count; all else belongs to any.
    Else one of many that are as good would lead by chance.
    """
    sure = np.maximum(counts - 2 * np.sqrt(counts), 0.0)
    shares: Array = (sure + (counts - sure).mean()) / counts.sum()
    return shares
